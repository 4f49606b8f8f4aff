"""Frames of boards: rendered exactly, path-traced, and warped into photographs, which no code of ours rendered."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.sensor import Sensor, capture_image
from peaksim.geometry.pose import Pose, invert, transform
from peaksim.rendering import render
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import PRINT, Material
from peaksim.scene.paper import Paper, scale_contrast
from peaksim.scene.scene import Quad, Scene
from peaksim.scene.texture import Texture

from peakmark.experiments.cave.rooms import photographs
from peakmark.experiments.comparison.boards import (
    CAMERA,
    CORNERS,
    Print,
    TruePrint,
    random_board,
    random_pose,
    seen_prints,
)
from peakmark.experiments.comparison.prints import MARGIN, SIDE_M, drawn

Gray = NDArray[np.uint8]

_GREY = 110
"""Level of what covers a print."""

_FINE = 4
"""Samples a pixel and axis of warped prints."""


@dataclass(frozen=True)
class View:
    """How a board is photographed."""

    side_px: float = 48.0
    """Side of a print's square in the middle of the image."""
    tilt_deg: float = 0.0
    """Of the board against the line of sight."""
    noise: float = 2.0
    """σ of the read noise, grey levels; paper is near 180."""
    blur_px: float = 0.6
    """σ of the lens."""
    shadow: float = 0.0
    """Share of the light that stripes of shadow take, one and a half sides apart, with edges of a tenth of a side."""
    exposure: float = 1.0
    """Multiplier of the light; noise stays."""
    covered: float = 0.0
    """Share of each print's width that grey covers, from its left."""


SWEEPS: dict[str, tuple[float, ...]] = {
    "side_px": (10, 14, 20, 28, 40, 64, 96),
    "tilt_deg": (0, 30, 45, 60, 70, 75, 80),
    "noise": (0, 5, 10, 20, 30, 40),
    "blur_px": (0.3, 1, 2, 3, 4, 6),
    "shadow": (0, 0.3, 0.5, 0.7, 0.85),
    "exposure": (1, 0.5, 0.25, 0.12),
    "covered": (0, 0.05, 0.1, 0.15, 0.2, 0.3),
}
"""Quantity → values; all others stay at the defaults of `View`."""


@dataclass(frozen=True)
class Shot:
    """An image, what hangs there, and from where it was taken."""

    gray: Gray
    """(H, W)."""
    board: tuple[Print, ...]
    truth: tuple[TruePrint, ...]
    pose: Pose | None
    """(4, 4) world from camera; None where there is no board."""
    camera: Camera = CAMERA


def clean_shot(view: View, rng: np.random.Generator) -> Shot:
    """Return a board on a wall of a photograph, rendered exactly."""
    board, pose = random_board(view.side_px, rng), random_pose(view.side_px, view.tilt_deg, rng)
    frame = render(board_scene(board, rng, view.covered), CAMERA, pose, "exact")
    linear = np.asarray(frame.linear, dtype=np.float32)
    if view.shadow > 0:
        linear = linear * _stripes(view, rng)
    sensor = Sensor(view.blur_px, exposure=0.7 * view.exposure, read_noise=view.noise)
    return Shot(capture_image(linear, sensor, rng), board, seen_prints(board, pose), pose)


def traced_shot(rng: np.random.Generator, samples: int) -> Shot:
    """Return a board under a lamp, a second one and an even sky, printed like paper, some of it glossy; path-traced."""
    view = random_view(rng, 60.0)
    board, pose = random_board(view.side_px, rng), random_pose(view.side_px, view.tilt_deg, rng)
    glossy = rng.random() < 0.3
    paper = Material("plastic" if glossy else "diffuse", (0.05, 0.85), "srgb", 0.2)
    reach = float(np.linalg.norm(pose[:3, 3]))
    lamps = [_lamp(rng, reach) for _ in range(2)]
    sky = Environment(float(rng.uniform(0.05, 0.4)))
    scene = replace(board_scene(board, rng, 0.0, paper), lights=(*lamps, sky))
    frame = render(scene, CAMERA, pose, "traced", samples=samples, seed=int(rng.integers(2**31)), max_depth=3)
    sensor = Sensor(view.blur_px, auto_exposure=90.0, read_noise=view.noise, tone="srgb")
    return Shot(capture_image(frame.linear, sensor, rng), board, seen_prints(board, pose), pose)


def _lamp(rng: np.random.Generator, reach_m: float) -> AreaLight:
    """Return a lamp of a third of the camera's distance, aside from the board and looking at its middle."""
    angle, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.4, 1.2)
    center = reach_m * np.array([np.cos(angle), np.sin(angle), height])
    size = float(reach_m * rng.uniform(0.1, 0.5))
    radiance = float(rng.uniform(0.5, 1.5) * np.pi * np.sum(center**2) / size**2 * np.linalg.norm(center) / center[2])
    return AreaLight(tuple(center), (size, size), radiance / np.pi, tuple(-center))


def warped_shot(rng: np.random.Generator) -> Shot:
    """Return a board warped into a photograph by OpenCV: homography, the photograph's light, a tone curve, JPEG."""
    view = random_view(rng, 70.0)
    board, pose = random_board(view.side_px, rng), random_pose(view.side_px, view.tilt_deg, rng)
    photo = _crop(rng)
    light = cv2.GaussianBlur(photo.astype(np.float32), (0, 0), 25)
    light = np.clip(light / light.mean(), 0.35, 1.4)
    canvas: NDArray[np.float32] = photo.astype(np.float32)
    for one in board:
        _paste(canvas, one, pose, light)
    noisy = cv2.GaussianBlur(canvas, (0, 0), view.blur_px) + rng.normal(0, view.noise, canvas.shape)
    quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(70, 96))]
    coded = cv2.imencode(".jpg", np.clip(np.rint(noisy), 0, 255).astype(np.uint8), quality)[1]
    gray = np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    return Shot(gray, board, seen_prints(board, pose), pose)


def bare_shot(rng: np.random.Generator) -> Shot:
    """Return a part of a photograph without any print, at times softened."""
    photo = _crop(rng)
    return Shot(cv2.GaussianBlur(photo, (0, 0), 1.2) if rng.random() < 0.5 else photo, (), (), None)  # type: ignore[arg-type]


def random_view(rng: np.random.Generator, steepest_deg: float) -> View:
    """Return a view of any size and tilt: sides of 16…96 px, evenly in their logarithm; directions evenly."""
    tilt = np.degrees(np.arccos(rng.uniform(np.cos(np.radians(steepest_deg)), 1)))
    side = np.exp(rng.uniform(np.log(16), np.log(96)))
    return View(float(side), float(tilt), float(rng.uniform(1, 5)), float(rng.uniform(0.3, 1.0)))


def board_scene(
    board: tuple[Print, ...],
    rng: np.random.Generator,
    covered: float = 0.0,
    material: Material = PRINT,
    wall_m: float = 2.4,
) -> Scene:
    """Return a board's prints on a wall of a photograph that nothing was trained on; `wall_m` is its side."""
    photos = _photos()
    photo = scale_contrast(photos[str(rng.choice(list(photos)))], float(rng.uniform(0.3, 1)), 140.0)
    away = np.eye(4)
    away[2, 3] = -0.002
    texture = Paper(photo, float(rng.uniform(0.6, 1.5))).cover_surface((wall_m, wall_m), "wall")
    wall = Quad("wall", texture, (wall_m, wall_m), away, material=material)
    side = (1 + 2 * MARGIN) * SIDE_M
    sheets = [
        Quad(f"print {k}", _texture(one, covered), (side, side), one.pose, material=material)
        for k, one in enumerate(board)
    ]
    return Scene((wall, *sheets))


_TEXTURES: dict[tuple[str, int, float], Texture] = {}


def _texture(one: Print, covered: float) -> Texture:
    key = (one.design, one.code, covered)
    if key not in _TEXTURES:
        _TEXTURES[key] = Texture.from_array(_covered(drawn(one.design, one.code), covered))
    return _TEXTURES[key]


def _covered(paper: Gray, share: float) -> Gray:
    if share == 0:
        return paper
    side = len(paper)
    left, width = side * MARGIN / (1 + 2 * MARGIN), side / (1 + 2 * MARGIN)
    hidden = paper.copy()
    hidden[:, : round(left + share * width)] = _GREY
    return hidden


@cache
def _photos() -> Mapping[str, Gray]:
    return photographs("held-out")


def _crop(rng: np.random.Generator) -> Gray:
    """Return a part of a photograph, as large as the camera's image."""
    photos = _photos()
    photo = photos[str(rng.choice(list(photos)))]
    scale = max(CAMERA.width / photo.shape[1], CAMERA.height / photo.shape[0]) * rng.uniform(1, 1.6)
    size = (int(np.ceil(photo.shape[1] * scale)), int(np.ceil(photo.shape[0] * scale)))
    large = cv2.resize(photo, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC)
    left = int(rng.integers(size[0] - CAMERA.width + 1))
    top = int(rng.integers(size[1] - CAMERA.height + 1))
    return np.ascontiguousarray(large[top : top + CAMERA.height, left : left + CAMERA.width], dtype=np.uint8)


def _stripes(view: View, rng: np.random.Generator) -> NDArray[np.float32]:
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width]
    angle, period = rng.uniform(0, 2 * np.pi), 3 * view.side_px
    along = (x * np.cos(angle) + y * np.sin(angle)) * 2 * np.pi / period + rng.uniform(0, 2 * np.pi)
    edge = 0.1 * view.side_px * 2 * np.pi / period
    dark = 0.5 * (1 + np.tanh(2 * np.sin(along) / edge))
    return np.asarray(1 - view.shadow * dark, dtype=np.float32)


def _paste(canvas: NDArray[np.float32], one: Print, pose: Pose, light: NDArray[np.float32]) -> None:
    """Draw a print, averaged over `_FINE`² samples a pixel, where the camera sees it; in place."""
    corners = CAMERA.project(transform(invert(pose), one.place(CORNERS * (1 + 2 * MARGIN))))
    if not np.isfinite(corners).all():
        return
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 2, [CAMERA.width, CAMERA.height])
    if (high <= low).any():
        return
    width, height = (high - low).tolist()
    longest = max(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))
    texels = int(np.clip(_FINE * longest, 16, len(drawn(one.design, one.code))))
    paper = cv2.resize(drawn(one.design, one.code), (texels, texels), interpolation=cv2.INTER_AREA).astype(np.float32)
    source = (CORNERS + 0.5) * texels - 0.5
    target = (corners - low + 0.5) * _FINE - 0.5
    warp = cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32))
    fine = (width * _FINE, height * _FINE)
    drawn_fine = cv2.warpPerspective(paper, warp, fine, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    mask = cv2.warpPerspective(np.ones_like(paper), warp, fine, flags=cv2.INTER_NEAREST)
    part = (slice(low[1], high[1]), slice(low[0], high[0]))
    lit = 255 * ((0.05 + 0.8 * (drawn_fine / 255) ** 2.2) ** (1 / 2.2))
    shades, shares = (cv2.resize(each, (width, height), interpolation=cv2.INTER_AREA) for each in (lit * mask, mask))
    canvas[part] = (1 - shares) * canvas[part] + shades * light[part] * 0.9
