"""What is shown where no surface is: one level, or in baked light the image of the surroundings."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.scene.lamps import Environment
from peaksim.scene.material import LUMA, WHITE
from peaksim.scene.scene import Scene

_MOST_SAMPLES = 8
"""Most samples of the surroundings a pixel, along each axis: one for each of their texels up to this."""


class Sky(NamedTuple):
    """What is shown where nothing is."""

    level: float
    """Grey level where there is no image."""
    image: NDArray[np.float32] | None
    """(h, w, 1 or 3) grey levels over all directions, as `Environment.image`."""
    yaw_rad: float
    """Rotation of the image about z."""


def sky_of(scene: Scene, *, is_baked: bool) -> Sky:
    """Return what is shown where nothing is: the surroundings if their light is baked."""
    images = [
        (light, light.image) for light in scene.lights if isinstance(light, Environment) and light.image is not None
    ]
    if not is_baked or not images:
        return Sky(float(scene.background), None, 0.0)
    light, image = images[-1]
    return Sky(0.0, np.atleast_3d(image) * np.float32(WHITE * light.radiance), float(np.radians(light.yaw_deg)))


def sky_levels(
    sky: Sky, rays: NDArray[np.float64], rotations: NDArray[np.float64], channels: int
) -> NDArray[np.float64]:
    """Return the (h, w, channels) means of the sky over pixels.

    Parameters
    ----------
    sky
        What is shown.
    rays
        (h + 1, w + 1, 3) directions of the pixel corners, camera frame.
    rotations
        (1, 3, 3) or (h, 3, 3) from camera to world, of all rows or of each.
    channels
        1 or 3.
    """
    height, width = rays.shape[0] - 1, rays.shape[1] - 1
    if sky.image is None:
        return np.full((height, width, channels), sky.level)
    count = _samples_a_pixel(rays, sky.image.shape[0])
    steps = (np.arange(count) + 0.5) / count
    total = np.zeros((height, width, sky.image.shape[2]))
    for t in steps:
        rows = (1 - t) * rays[:-1] + t * rays[1:]
        for s in steps:
            directions = (1 - s) * rows[:, :-1] + s * rows[:, 1:]
            total += _at(sky, np.einsum("nij,nwj->nwi", np.broadcast_to(rotations, (height, 3, 3)), directions))
    return in_channels(total / count**2, channels)


def in_channels(levels: NDArray[np.float64], channels: int) -> NDArray[np.float64]:
    """Return (…, 1 or 3) levels in another number of channels (grey: Rec. 709 luma)."""
    if levels.shape[-1] == channels:
        return levels
    return np.repeat(levels, 3, axis=-1) if channels == 3 else levels @ LUMA


def _samples_a_pixel(rays: NDArray[np.float64], rows: int) -> int:
    """Return how many texels of the surroundings a pixel in the middle is wide."""
    y, x = rays.shape[0] // 2, rays.shape[1] // 2
    here, beside = (r / np.linalg.norm(r) for r in (rays[y, x - 1], rays[y, x]))
    angle = np.linalg.norm(here - beside)
    return int(np.clip(np.ceil(np.nan_to_num(angle) * rows / np.pi), 1, _MOST_SAMPLES))


def _at(sky: Sky, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (…, channels) levels in world directions, bilinear between the middles of texels."""
    image = sky.image
    assert image is not None
    height, width = image.shape[:2]
    x, y, z = np.moveaxis(np.nan_to_num(directions), -1, 0)
    column = (0.5 + (np.arctan2(x, y) + sky.yaw_rad) / (2 * np.pi)) * width - 0.5
    row = np.arctan2(np.hypot(x, y), z) / np.pi * height - 0.5
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    f, g = (column - left)[..., None], (row - top)[..., None]
    upper, lower = np.clip(top, 0, height - 1), np.clip(top + 1, 0, height - 1)
    first, second = left % width, (left + 1) % width
    above = (1 - f) * image[upper, first] + f * image[upper, second]
    below = (1 - f) * image[lower, first] + f * image[lower, second]
    return np.asarray((1 - g) * above + g * below)
