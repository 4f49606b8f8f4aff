"""Random images of sheets on photographed surfaces, markers and other prints, some covered in part, some bent."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.frame import MarkerTruth
from peaksim.geometry.pose import Pose, compose, rotation_about
from peaksim.rendering import render
from peaksim.scene.paper import Paper, scale_contrast
from peaksim.scene.scene import Mark, Quad, Scene
from peaksim.scene.texture import Texture

from peakmark.experiments.search.exposure import expose
from peakmark.experiments.search.grounds import random_ground
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant, marker_image

SIDE_M = 0.06
"""Side of every sheet's pattern, metres."""

WIDTH, HEIGHT = 640, 480

_TEXELS = 198
_SHEETS = ("marker", "array", "tag", "discs", "squares", "letter", "blob", "photograph")
_SHARES = (0.5, 0.1, 0.12, 0.06, 0.06, 0.06, 0.04, 0.06)
_COVERED, _BENT = 0.2, 0.12
"""Shares of sheets that something lies on, and of images on bent paper."""


@dataclass(frozen=True)
class LitImage:
    """An image and where its markers are."""

    gray: NDArray[np.uint8]
    """(H, W)."""
    truth: tuple[MarkerTruth, ...]
    """Of its markers."""


def random_image(
    rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]], made_for: Made = "surf"
) -> LitImage:
    """Return an image of up to 25 sheets in one plane, seen in any size and tilt, in any light."""
    tilt_deg = float(np.degrees(np.arccos(rng.uniform(np.cos(np.radians(78)), 1))))
    tilt_deg = tilt_deg if rng.random() < 0.6 else float(rng.uniform(0, 78))
    side_px = float(np.exp(rng.uniform(np.log(11), np.log(80 if rng.random() < 0.8 else 400))))
    focal = float(rng.uniform(420, 1100))
    camera = Camera(WIDTH, HEIGHT, focal, focal, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    scene = Scene((_wall(rng, photos, side_px), *_sheets(rng, photos, side_px, made_for)))
    frame = render(scene, camera, _pose(rng, focal, side_px, tilt_deg), renderer="exact")
    printed, truth = np.asarray(frame.linear, dtype=np.float64), frame.truth
    if rng.random() < _BENT:
        printed, truth = _bent(printed, truth, side_px, rng)
    return LitImage(expose(printed, rng), truth)


def empty_image(rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]]) -> LitImage:
    """Return an image without markers, 320…800 px wide: as it is, softened, or exposed like the others."""
    ground = random_ground(rng, photos)
    width = int(rng.integers(320, 801))
    size = (width, max(64, round(ground.shape[0] * width / ground.shape[1])))
    smooth = cv2.INTER_AREA if width < ground.shape[1] else cv2.INTER_CUBIC
    image = np.asarray(cv2.resize(ground, size, interpolation=smooth), dtype=np.uint8)
    if rng.random() < 0.5:
        return LitImage(expose(image.astype(np.float64), rng), ())
    soft = cv2.GaussianBlur(image, (0, 0), float(rng.uniform(0.8, 2.0)))
    return LitImage(image if rng.random() < 0.5 else np.asarray(soft, dtype=np.uint8), ())


def plain_image(
    rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]], kinds: tuple[Variant, Variant]
) -> LitImage:
    """Return an image of twelve sheets of either kind in even light, with a little blur and noise.

    Tilts are up to 60° and sides 20…70 px; of two calls with equal generators only the kinds differ.
    """
    tilt_deg, side_px = float(rng.uniform(0, 60)), float(np.exp(rng.uniform(np.log(20), np.log(70))))
    focal = float(rng.uniform(500, 900))
    camera = Camera(WIDTH, HEIGHT, focal, focal, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    quads = [_wall(rng, photos, side_px)]
    for number in range(12):
        row, column = divmod(number, 4)
        pose = compose(rotation_about("z", rng.uniform(0, 360)), [0.0, 0.0, 0.0])
        pose[:2, 3] = ((np.array([column, row]) - [1.5, 1]) * 1.9 + rng.uniform(-0.1, 0.1, 2)) * SIDE_M
        kind = kinds[int(rng.random() < 0.5)]
        texels = np.pad(marker_image(_TEXELS, kind), _TEXELS // 8, constant_values=255)
        size = SIDE_M * texels.shape[0] / _TEXELS
        mark = Mark(f"sheet{number}", kind.kind, SIDE_M)
        quads.append(Quad(f"sheet{number}", Texture.from_array(texels), (size, size), pose, (mark,)))
    frame = render(Scene(tuple(quads)), camera, _pose(rng, focal, side_px, tilt_deg), renderer="exact")
    soft = cv2.GaussianBlur(np.asarray(frame.linear, dtype=np.float64), (0, 0), float(rng.uniform(0.3, 1.0)))
    noisy = 25 + 0.8 * np.asarray(soft) + rng.uniform(0.5, 3) * rng.standard_normal(soft.shape)
    return LitImage(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), frame.truth)


def _wall(rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]], side_px: float) -> Quad:
    """Return the surface under the sheets, six images wide."""
    contrast, mean = float(rng.uniform(0.3, 1)), float(rng.uniform(70, 190))
    photo = scale_contrast(random_ground(rng, photos), contrast, mean)
    texels_per_m = np.exp(rng.uniform(np.log(0.3), np.log(1.5))) * side_px / SIDE_M
    wide = 6 * WIDTH * SIDE_M / side_px
    away = np.eye(4)
    away[2, 3] = -0.05 * SIDE_M
    paper = Paper(photo, photo.shape[1] / texels_per_m)
    return Quad("wall", paper.cover_surface((wide, wide), "wall"), (wide, wide), away)


def _sheets(
    rng: np.random.Generator, photos: Mapping[str, NDArray[np.uint8]], side_px: float, made_for: Made
) -> list[Quad]:
    spacing = rng.uniform(1.7, np.clip(WIDTH / (5 * side_px), 2.6, 5))
    count = int(np.clip(np.ceil(1.3 * WIDTH / (spacing * side_px)), 2, 5))
    quads = []
    for number in range(count**2):
        row, column = divmod(number, count)
        pose = compose(rotation_about("z", rng.uniform(0, 360)), [0.0, 0.0, 0.0])
        middle = (np.array([column, row]) - (count - 1) / 2) * spacing
        pose[:2, 3] = (middle + rng.uniform(-0.1, 0.1, 2)) * SIDE_M
        quads.append(_sheet(rng, f"sheet{number}", pose, photos, made_for))
        if rng.random() < _COVERED:
            quads.append(_cover(rng, f"cover{number}", pose, photos))
    return quads


def _sheet(
    rng: np.random.Generator, name: str, pose: Pose, photos: Mapping[str, NDArray[np.uint8]], made_for: Made
) -> Quad:
    """Return a sheet with a random rim."""
    kind = str(rng.choice(_SHEETS, p=_SHARES))
    polarity: Polarity = "dark" if rng.random() < 0.5 else "light"
    marks: tuple[Mark, ...] = ()
    if kind == "array":
        texels, marks = _array_sheet(rng, name, made_for)
    elif kind == "marker":
        texels, called = _pattern(rng, _TEXELS, polarity, made_for)
        marks = (Mark(name, called, SIDE_M),)
    elif kind == "photograph":
        texels = np.asarray(cv2.resize(random_ground(rng, photos), (_TEXELS, _TEXELS), interpolation=cv2.INTER_AREA))
    else:
        texels = draw_decoy(rng, kind, 1 if made_for == "surf" else 2)  # one disc is a marker for SIFT
    texels = np.pad(texels, round(float(rng.uniform(0.05, 0.3)) * _TEXELS), constant_values=255)
    white = 255 if rng.random() < 0.7 else int(rng.integers(225, 256))
    texels = np.minimum(texels, white).astype(np.uint8)
    size = SIDE_M * texels.shape[0] / _TEXELS
    return Quad(name, Texture.from_array(texels), (size, size), pose, marks)


def _pattern(rng: np.random.Generator, side: int, polarity: Polarity, made_for: Made) -> tuple[NDArray[np.uint8], str]:
    """Return a marker and what it is called; of those for SIFT two of five are discs."""
    limit: Limit = "energy" if made_for == "surf" or rng.random() < 0.6 else "range"
    variant = Variant(polarity, limit, made_for)
    return marker_image(side, variant), variant.kind


def _array_sheet(rng: np.random.Generator, name: str, made_for: Made) -> tuple[NDArray[np.uint8], tuple[Mark, ...]]:
    """Return three markers in an L and a line of text, in the space of one."""
    side = 9 * int(rng.integers(7, 10))
    step = min(round(rng.uniform(1.3, 1.6) * side), _TEXELS - side)
    image, marks = np.full((_TEXELS, _TEXELS), 255, np.uint8), []
    for number, (row, column) in enumerate(((0, 1), (1, 0), (1, 1))):
        polarity: Polarity = "dark" if rng.random() < 0.5 else "light"
        top, left = row * step, column * step
        image[top : top + side, left : left + side], called = _pattern(rng, side, polarity, made_for)
        middle = (np.array([left, top]) + side / 2) / _TEXELS - 0.5
        center = (float(middle[0] * SIDE_M), float(-middle[1] * SIDE_M))
        marks.append(Mark(f"{name}-{number}", called, SIDE_M * side / _TEXELS, center))
    cv2.putText(image, "peakmark 3-bit array", (2, _TEXELS - 2), cv2.FONT_HERSHEY_PLAIN, 0.9, 90, 1)
    return image, tuple(marks)


def _cover(rng: np.random.Generator, name: str, pose: Pose, photos: Mapping[str, NDArray[np.uint8]]) -> Quad:
    """Return a thing that covers 5…55 % of the width of the sheet's pattern from one side, or a strip across it."""
    is_strip, angle = rng.random() < 0.3, rng.uniform(0, 2 * np.pi)
    width = rng.uniform(0.08, 0.4) if is_strip else rng.uniform(0.8, 1.6)
    away = rng.uniform(-0.5, 0.5) if is_strip else 0.5 + width / 2 - rng.uniform(0.05, 0.55)
    above = pose @ compose(rotation_about("z", np.degrees(angle)), [0.0, 0.0, 0.05 * SIDE_M])
    above[:3, 3] += pose[:3, :3] @ np.array([np.cos(angle), np.sin(angle), 0.0]) * away * SIDE_M
    texels = cv2.resize(random_ground(rng, photos), (48, 48), interpolation=cv2.INTER_AREA)
    texels = texels if rng.random() < 0.5 else np.full_like(texels, rng.integers(256))
    return Quad(name, Texture.from_array(np.asarray(texels)), (width * SIDE_M, rng.uniform(1.2, 2.4) * SIDE_M), above)


def draw_decoy(rng: np.random.Generator, kind: str, least_rings: int = 1) -> NDArray[np.uint8]:
    """Return what else is printed on white paper: a tag, up to three discs or squares, a letter, or a soft blob."""
    image = np.full((_TEXELS, _TEXELS), 255, np.uint8)
    middle, half = _TEXELS // 2, int(rng.integers(24, _TEXELS // 2))
    if kind == "tag":
        family = int(rng.choice([cv2.aruco.DICT_4X4_50, cv2.aruco.DICT_APRILTAG_36h11, cv2.aruco.DICT_5X5_50]))
        dictionary = cv2.aruco.getPredefinedDictionary(family)
        return np.asarray(cv2.aruco.generateImageMarker(dictionary, int(rng.integers(50)), _TEXELS), dtype=np.uint8)
    if kind == "blob":
        y, x = np.mgrid[:_TEXELS, :_TEXELS] - middle
        depth = rng.uniform(60, 255) * np.exp(-(x**2 + y**2) / (2 * (half / 2) ** 2))
        return np.asarray(255 - depth, dtype=np.uint8)
    if kind == "letter":
        text = str(rng.choice(list("abdegopqABDOPQR04689&@%")))
        (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, 6.0, 18)
        corner = (middle - width // 2, middle + height // 2)
        cv2.putText(image, text, corner, cv2.FONT_HERSHEY_DUPLEX, 6.0, int(rng.integers(120)), 18)
        return image
    for radius in sorted(rng.integers(8, half + 1, int(rng.integers(least_rings, 4))).tolist(), reverse=True):
        level = int(rng.integers(256))
        if kind == "discs":
            cv2.circle(image, (middle, middle), radius, level, -1)
        else:
            cv2.rectangle(image, (middle - radius, middle - radius), (middle + radius, middle + radius), level, -1)
    return image


def _pose(rng: np.random.Generator, focal: float, side_px: float, tilt_deg: float) -> Pose:
    """Return a camera that sees the middle in this size and tilt, with any roll."""
    distance = focal * SIDE_M * np.sqrt(np.cos(np.radians(tilt_deg))) / side_px
    turn = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", tilt_deg)
    turn = turn @ rotation_about("z", rng.uniform(0, 360)) @ np.diag([1.0, -1.0, -1.0])
    aside = turn[:, :2] @ rng.uniform(-60, 60, 2) * distance / focal
    return compose(turn, -distance * turn[:, 2] + aside)


def _bent(
    printed: NDArray[np.float64], truth: tuple[MarkerTruth, ...], side_px: float, rng: np.random.Generator
) -> tuple[NDArray[np.float64], tuple[MarkerTruth, ...]]:
    """Return an image of wavy paper, and where the markers' centres are on it."""
    angle, wave = rng.uniform(0, 2 * np.pi), side_px * rng.uniform(2.0, 5.0)
    depth, phase = side_px * rng.uniform(0.01, 0.06), rng.uniform(0, 2 * np.pi)
    along, across = rng.uniform(0, 2 * np.pi), np.array([np.cos(angle), np.sin(angle)])
    direction = np.array([np.cos(along), np.sin(along)])

    def shift(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(depth * np.sin(2 * np.pi * (across[0] * x + across[1] * y) / wave + phase))

    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    back = shift(x, y)
    maps = ((x + back * direction[0]).astype(np.float32), (y + back * direction[1]).astype(np.float32))
    moved = cv2.remap(printed.astype(np.float32), *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, dtype=np.float64), tuple(
        replace(marker, center_xy=_unshifted(marker.center_xy, shift, direction)) for marker in truth
    )


def _unshifted(
    xy: NDArray[np.float64], shift: Callable[..., NDArray[np.float64]], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the point that `shift` brings to xy, by fixed-point steps."""
    point = xy
    for _ in range(8):
        point = xy - shift(point[0], point[1]) * direction
    return point
