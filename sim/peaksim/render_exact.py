"""The area-exact renderer: every pixel is the integral of what it sees. No GL."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from peaksim.camera import Camera
from peaksim.faces import Textures, channels_of, distinct_textures, pack_textures, see_faces
from peaksim.scene import Scene
from peaksim.texture import Texture

BAND_ROWS = 16
"""Rows a thread takes at a time; fixed, so that bytes do not depend on the number of threads."""


def integrate(scene: Scene, camera: Camera, poses: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the (h, w, channels) linear grey levels of a scene from (1 or h, 4, 4) `world_from_camera` poses."""
    from peaksim.area_light import pack_lights
    from peaksim.area_raster import Seen, View, render_band
    from peaksim.rays import solids_of

    channels = channels_of(scene)
    distinct, index = distinct_textures(scene)
    faces = see_faces(scene, index, poses, channels)
    seen = Seen(
        faces, _packed(distinct), pack_lights(scene.lights), solids_of(scene, quads=False), float(scene.background)
    )
    view = View(
        corner_rays(camera), np.array([camera.fx, camera.fy, camera.cx, camera.cy]), camera.width, camera.height
    )
    out = np.empty((camera.height, camera.width, channels), dtype=np.float32)

    def band(first: int) -> None:
        render_band(view, poses, seen, first, min(first + BAND_ROWS, camera.height), out)

    _in_threads(band, range(0, camera.height, BAND_ROWS))
    return out


@lru_cache(maxsize=4)
def corner_rays(camera: Camera) -> NDArray[np.float64]:
    """Return (h + 1, w + 1, 3) directions of the pixel corners, or nothing for a pinhole, which needs no table."""
    if camera.is_pinhole:
        return np.empty((0, 0, 3))
    x, y = np.meshgrid(np.arange(camera.width + 1) - 0.5, np.arange(camera.height + 1) - 0.5)
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    return rays.reshape(camera.height + 1, camera.width + 1, 3)


@lru_cache(maxsize=1)
def _packed(distinct: tuple[Texture, ...]) -> Textures:
    return pack_textures(distinct)


def _in_threads(work: Callable[[int], None], items: range) -> None:
    with ThreadPoolExecutor(threads()) as pool:
        for _ in pool.map(work, items):
            pass


def threads() -> int:
    """Return how many threads render: PEAKSIM_THREADS, else the processors this process may use."""
    return max(1, int(os.environ.get("PEAKSIM_THREADS", 0)) or len(os.sched_getaffinity(0)))


def quantised(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return (h, w) or (h, w, 3) uint8 of (h, w, channels) linear grey levels, rounded once."""
    rounded = np.clip(np.rint(linear), 0, 255).astype(np.uint8)
    return rounded[:, :, 0] if rounded.shape[2] == 1 else rounded
