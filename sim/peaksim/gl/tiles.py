"""Tiles of an image, each with a window for OpenGL: a pinhole view that covers the tile, whatever the lens."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.cells import Rays
from peaksim.area.integrate import band_rays, corner_rays
from peaksim.area.shown import SAMPLES
from peaksim.camera.camera import Camera

LONGEST_PX = 1024
"""Longest side of a tile."""
LEAST_COSINE = 0.8
"""Cosine of the widest angle between the middle of a lens's tile and its other directions."""


class ImageTile(NamedTuple):
    """Part of an image."""

    rows: slice
    """Rows of the image."""
    columns: slice
    """Columns of the image."""
    rays: Rays
    """(h + 1, w + 1, 3) directions of the pixel corners, camera frame."""


class Window(NamedTuple):
    """What OpenGL draws: a pinhole view along the third axis of a frame of its own."""

    camera_from_window: NDArray[np.float64]
    """(3, 3) rotation."""
    columns: int
    """Width in samples."""
    rows: int
    """Height in samples."""
    samples_from_window: NDArray[np.float64]
    """(3, 3) matrix from a direction in the window's frame to (column, row, 1) × depth; (0, 0) is the first corner."""
    slant: float
    """Least cosine of the angle between the third axis and any direction of the window."""

    @property
    def samples_from_camera(self) -> NDArray[np.float64]:
        """(3, 3) matrix from a direction in the camera's frame to (column, row, 1) × depth."""
        return self.samples_from_window @ self.camera_from_window.T


def split_into_tiles(camera: Camera, longest_px: int = LONGEST_PX) -> Iterator[ImageTile]:
    """Yield tiles that cover the image, no side of them longer than `longest_px`."""
    lattice = corner_rays(camera)
    rays = band_rays(camera, slice(0, camera.height)) if lattice is None else lattice
    yield from _split(ImageTile(slice(0, camera.height), slice(0, camera.width), rays), camera.is_pinhole, longest_px)


def _split(tile: ImageTile, is_pinhole: bool, longest_px: int) -> Iterator[ImageTile]:
    """Yield a tile, or its halves where it is too large."""
    height, width = tile.rays.shape[0] - 1, tile.rays.shape[1] - 1
    if max(height, width) <= longest_px and (is_pinhole or max(height, width) == 1 or _is_narrow(tile.rays)):
        yield tile
    elif width >= height:
        x, half = tile.columns.start, width // 2
        yield from _split(ImageTile(tile.rows, slice(x, x + half), tile.rays[:, : half + 1]), is_pinhole, longest_px)
        yield from _split(ImageTile(tile.rows, slice(x + half, x + width), tile.rays[:, half:]), is_pinhole, longest_px)
    else:
        y, half = tile.rows.start, height // 2
        upper = ImageTile(slice(y, y + half), tile.columns, tile.rays[: half + 1])
        lower = ImageTile(slice(y + half, y + height), tile.columns, tile.rays[half:])
        yield from _split(upper, is_pinhole, longest_px)
        yield from _split(lower, is_pinhole, longest_px)


def _is_narrow(rays: Rays) -> bool:
    return bool((rays @ _middle(rays) >= LEAST_COSINE * np.linalg.norm(rays, axis=2)).all())


def _middle(rays: Rays) -> NDArray[np.float64]:
    """Return the unit direction in the middle of a tile."""
    middle = rays[len(rays) // 2, rays.shape[1] // 2]
    return np.asarray(middle / np.linalg.norm(middle))


def window_positions(rays: Rays, samples_from_camera: NDArray[np.float64]) -> Rays:
    """Return (…, 3) (column, row, 1) of directions in a window."""
    positions = rays @ samples_from_camera.T
    return np.asarray(positions / positions[:, :, 2:])


def window_of(tile: ImageTile, is_pinhole: bool, samples: int = SAMPLES) -> Window:
    """Return a window with `samples` × `samples` samples for each pixel of a tile, evenly spread over the window.

    For a pinhole, samples lie evenly in each pixel.
    """
    rotation = np.eye(3) if is_pinhole else swap_rotation(_middle(tile.rays))
    border = np.concatenate([tile.rays[0], tile.rays[-1], tile.rays[:, 0], tile.rays[:, -1]])
    in_window = border @ rotation
    flat = in_window[:, :2] / in_window[:, 2:]
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = samples * (np.array(tile.rays.shape[1::-1]) - 1)
    scale = size / (high - low)
    matrix = np.array([[scale[0], 0, -scale[0] * low[0]], [0, scale[1], -scale[1] * low[1]], [0, 0, 1]])
    reach = np.abs(np.stack([low, high])).max(axis=0)
    return Window(rotation, int(size[0]), int(size[1]), matrix, float(1 / np.sqrt(1 + reach @ reach)))


def swap_rotation(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (3, 3) rotation by 180° that swaps the third axis with a unit direction, which is not its opposite."""
    between = direction + np.array([0, 0, 1])
    return np.asarray(2 * np.outer(between, between) / (between @ between) - np.eye(3))
