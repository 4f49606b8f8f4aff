"""Photographs of a printed page by a warp of OpenCV's own, independent of the renderers and of our lens model."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, invert, look_at, transform
from PIL import Image

from peakmark.markers.sheet import Page
from peakmark.markers.sheet_files import raster

_DPI = 254.0  # ten to a millimetre, so that pages are whole numbers of pixels
_FINE = 3  # sub-samples of a pixel along each side
_PAPER = (20.0, 190.0)  # grey levels of ink and paper


@dataclass(frozen=True)
class Paper:
    """A printed page in the plane z = 0: its middle the origin, x right, y up the page."""

    levels: NDArray[np.float32]
    """(H, W) printed levels, 0…255."""
    size_m: NDArray[np.float64]
    """(2,) width and height."""

    @classmethod
    def of(cls, page: Page) -> "Paper":
        return cls(raster(page, _DPI).astype(np.float32), np.array([page.width_mm, page.height_mm]) / 1000)


def pose_over(distance_m: float, tilt_deg: float, direction_deg: float, roll_deg: float) -> Pose:
    """Return a camera that looks at the page's middle; its axis is tilted from the normal towards a direction."""
    tilt, direction, roll = np.radians([tilt_deg, direction_deg, roll_deg])
    eye = distance_m * np.array([np.sin(tilt) * np.cos(direction), np.sin(tilt) * np.sin(direction), np.cos(tilt)])
    return look_at(eye, np.zeros(3), up=[np.sin(roll), np.cos(roll), 0.1])


def photograph(
    paper: Paper, camera: Camera, world_from_camera: Pose, rng: np.random.Generator, sigma: float = 3.0
) -> NDArray[np.uint8]:
    """Return a (H, W) photograph: an area average, uneven light, blur of 0.8 px and noise, on an uneven ground."""
    size = (camera.width, camera.height)
    coarse = rng.uniform(60, 160, (12, 16)).astype(np.float32)
    image = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    (left, top), (right, bottom) = _box(paper, camera, world_from_camera)
    step = (np.arange(_FINE) + 0.5) / _FINE - 0.5
    x = (np.arange(left, right)[:, None] + step).ravel()
    for first in range(top, bottom, 200):  # in strips, which bounds memory
        rows = np.arange(first, min(first + 200, bottom))
        y = (rows[:, None] + step).ravel()
        levels = _seen(paper, camera, world_from_camera, x, y)
        is_paper = (levels >= 0).astype(np.float32)
        small = (right - left, len(rows))
        share = cv2.resize(is_paper, small, interpolation=cv2.INTER_AREA)
        ink, white = _PAPER
        shown = cv2.resize(is_paper * (ink + levels * (white - ink) / 255), small, interpolation=cv2.INTER_AREA)
        light = np.linspace(1, 0.75, right - left, dtype=np.float32)
        part = image[first : rows[-1] + 1, left:right]
        part[:] = part * (1 - share) + shown * light
    image = cv2.GaussianBlur(image, (0, 0), 0.8) + rng.normal(0, sigma, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _box(paper: Paper, camera: Camera, world_from_camera: Pose) -> NDArray[np.int_]:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2 * [*paper.size_m, 0]
    xy = camera.project(transform(invert(world_from_camera), corners))
    low = np.maximum(np.floor(xy.min(axis=0)) - 20, 0)
    high = np.minimum(np.ceil(xy.max(axis=0)) + 20, [camera.width, camera.height])
    return np.array([low, high]).astype(int)


def _seen(
    paper: Paper, camera: Camera, world_from_camera: Pose, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return printed levels at the crossings of (w,) and (h,) px; −1 beside the page."""
    px = np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 1, 2)
    k = np.array(camera.distortion or (0.0,) * 4)
    if camera.model == "fisheye":
        flat = cv2.fisheye.undistortPoints(px, camera.matrix, k)
    else:
        flat = cv2.undistortPointsIter(px, camera.matrix, k, np.eye(3), np.eye(3), (3, 20, 1e-9))
    rays = np.column_stack([flat.reshape(-1, 2), np.ones(len(px))]) @ world_from_camera[:3, :3].T
    hit = world_from_camera[:2, 3] - world_from_camera[2, 3] / rays[:, 2:] * rays[:, :2]
    height, width = paper.levels.shape
    texel = (hit * [1, -1] / paper.size_m + 0.5) * [width, height] - 0.5
    grid = texel.astype(np.float32).reshape(len(y), len(x), 2)
    levels = cv2.remap(paper.levels, grid, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=-1)
    inside = (np.abs(hit) < paper.size_m / 2).all(axis=1).reshape(len(y), len(x))
    return np.where(inside, np.maximum(levels, 0), -1).astype(np.float32)


def save_photograph(path: Path, image: NDArray[np.uint8], orientation: int = 1, focal_35mm: int = 26) -> None:
    """Write a JPEG of quality 60 in RGB, with the EXIF of a phone."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif.get_ifd(0x8769)[0xA405] = focal_35mm
    Image.fromarray(np.dstack([image] * 3)).save(path, quality=60, exif=exif)
