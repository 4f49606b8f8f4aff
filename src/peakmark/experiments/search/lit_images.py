"""Random images of single markers on photographed walls, in light, tone and noise as cameras give them."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.frame import MarkerTruth
from peaksim.geometry.pose import Pose, compose, rotation_about
from peaksim.rendering import render
from peaksim.scene import build as scene_build
from peaksim.scene.scene import Mark, Quad, Scene
from peaksim.scene.texture import Texture
from scipy.special import expit

from peakmark.markers.patterns import Polarity, surf_marker

CAMERA = Camera(640, 480, 620.0, 620.0, 319.5, 239.5)
_TEXELS = 99
_MARKERS = 0.6
"""Share of the sheets that carry a marker; the others are decoys."""

_SPACING = 2.4
"""Between the middles of sheets, sides."""


@dataclass(frozen=True)
class LitImage:
    """An image and where its markers are."""

    gray: NDArray[np.uint8]
    """(H, W)."""
    truth: tuple[MarkerTruth, ...]
    """Of its markers."""


def random_image(rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]]) -> LitImage:
    """Return an image of nine sheets with a random rim, markers of either polarity and decoys."""
    side_m, tilt_deg = 0.06, float(rng.uniform(0, 75))
    side_px = float(np.exp(rng.uniform(np.log(15), np.log(130))))
    scene = Scene((_wall(rng, photos), *_sheets(rng, side_m)))
    frame = render(scene, CAMERA, _pose(rng, side_m, side_px, tilt_deg), renderer="exact")
    return LitImage(expose(frame.linear, rng), frame.truth)


def _wall(rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]]) -> Quad:
    photo = scene_build.scale_contrast(photos[str(rng.choice(list(photos)))], float(rng.uniform(0.3, 1)), 140.0)
    away = np.eye(4)
    away[2, 3] = -0.002
    texture = scene_build.Paper(photo, float(rng.uniform(0.8, 2.5))).cover_surface((6.0, 6.0), "wall")
    return Quad("wall", texture, (6.0, 6.0), away)


def _sheets(rng: np.random.Generator, side_m: float) -> list[Quad]:
    quads = []
    for number in range(9):
        row, column = divmod(number, 3)
        pose = compose(rotation_about("z", rng.uniform(0, 360)), [0.0, 0.0, 0.0])
        shift = (np.array([column, row]) - 1) * _SPACING * side_m + rng.uniform(-0.1, 0.1, 2) * side_m
        pose[:2, 3] = shift
        polarity: Polarity = "dark" if rng.random() < 0.5 else "light"
        is_marker = rng.random() < _MARKERS
        pattern = surf_marker(_TEXELS, polarity) if is_marker else draw_decoy(rng)
        texels = np.pad(pattern, round(float(rng.uniform(0.06, 0.3)) * _TEXELS), constant_values=255)
        size = side_m * texels.shape[0] / _TEXELS
        marks = (Mark(f"m{number}", f"surf-{polarity}", side_m),) if is_marker else ()
        quads.append(Quad(f"sheet{number}", Texture.from_array(texels), (size, size), pose, marks))
    return quads


def draw_decoy(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return what else is printed on white paper: a tag, discs, squares, a letter, or a soft blob."""
    image = np.full((_TEXELS, _TEXELS), 255, np.uint8)
    middle, half = _TEXELS // 2, int(rng.integers(12, _TEXELS // 2))
    kind = rng.choice(["tag", "tag", "discs", "squares", "letter", "blob"])
    if kind == "tag":
        family = int(rng.choice([cv2.aruco.DICT_4X4_50, cv2.aruco.DICT_APRILTAG_36h11, cv2.aruco.DICT_5X5_50]))
        dictionary = cv2.aruco.getPredefinedDictionary(family)
        return np.asarray(cv2.aruco.generateImageMarker(dictionary, int(rng.integers(30)), _TEXELS), dtype=np.uint8)
    if kind == "blob":
        y, x = np.mgrid[:_TEXELS, :_TEXELS] - middle
        depth = rng.uniform(60, 255) * np.exp(-(x**2 + y**2) / (2 * (half / 2) ** 2))
        return np.asarray(255 - depth, dtype=np.uint8)
    if kind == "letter":
        text = str(rng.choice(list("abdegopqABDOPQR04689&@%")))
        (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, 3.0, 9)
        corner = (middle - width // 2, middle + height // 2)
        cv2.putText(image, text, corner, cv2.FONT_HERSHEY_DUPLEX, 3.0, int(rng.integers(120)), 9)
        return image
    for radius in sorted(rng.integers(4, half + 1, int(rng.integers(1, 4))).tolist(), reverse=True):
        level = int(rng.integers(256))
        if kind == "discs":
            cv2.circle(image, (middle, middle), radius, level, -1)
        else:
            cv2.rectangle(image, (middle - radius, middle - radius), (middle + radius, middle + radius), level, -1)
    return image


def _pose(rng: np.random.Generator, side_m: float, side_px: float, tilt_deg: float) -> Pose:
    """Return a camera that sees the middle sheet in this size and tilt, with any roll."""
    distance = CAMERA.fx * side_m * np.sqrt(np.cos(np.radians(tilt_deg))) / side_px
    turn = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", tilt_deg)
    turn = turn @ rotation_about("z", rng.uniform(0, 360)) @ np.diag([1.0, -1.0, -1.0])
    aside = turn[:, :2] @ rng.uniform(-60, 60, 2) * distance / CAMERA.fx
    return compose(turn, -distance * turn[:, 2] + aside)


def expose(linear: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return what a camera makes of printed levels (H, W): paper's range, uneven light, blur, tone, noise, JPEG."""
    height, width = linear.shape
    tone = float(np.exp(rng.uniform(np.log(0.8), np.log(2.4))))
    levels = 0.05 + 0.8 * (np.clip(linear, 0, 255) / 255) ** tone
    y, x = np.mgrid[:height, :width]
    angle = rng.uniform(0, 2 * np.pi)
    across = np.cos(angle) * (x / width - 0.5) + np.sin(angle) * (y / height - 0.5)
    levels = levels * (1 + rng.uniform(0, 1.2) * across)
    if rng.random() < 0.4:
        edge = across - rng.uniform(-0.3, 0.3)
        softness_px = rng.uniform(0.5, 15)
        levels = levels * (1 - rng.uniform(0.1, 0.6) * expit(edge * width / softness_px))
    levels = np.asarray(cv2.GaussianBlur(levels, (0, 0), float(rng.uniform(0.3, 1.6))))
    if rng.random() < 0.15:
        levels = _moved(levels, float(rng.uniform(2, 7)), float(rng.uniform(0, 180)))
    levels = 255 * np.clip(rng.uniform(0.5, 1.25) * levels / 0.85, 0, 1)
    levels = levels + rng.normal(0, np.exp(rng.uniform(np.log(0.5), np.log(9))), levels.shape)
    gray = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    if rng.random() < 0.5:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(60, 96))]
        gray = np.asarray(cv2.imdecode(cv2.imencode(".jpg", gray, quality)[1], cv2.IMREAD_GRAYSCALE))
    return gray


def _moved(levels: NDArray[np.float64], length_px: float, angle_deg: float) -> NDArray[np.float64]:
    """Return levels blurred along a line."""
    reach = int(np.ceil(length_px)) | 1
    line = np.zeros((reach, reach), np.float32)
    line[reach // 2] = 1
    spin = cv2.getRotationMatrix2D((reach // 2, reach // 2), angle_deg, 1.0)
    kernel = cv2.warpAffine(line, spin, (reach, reach))
    return np.asarray(cv2.filter2D(levels, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE))
