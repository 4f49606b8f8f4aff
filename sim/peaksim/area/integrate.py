"""The area integral: every pixel is the mean of what it shows, in bands of rows that threads share.

Interval arithmetic over tiles finds the faces that a pixel may show.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from peaksim.area.bands import BAND_ROWS, Levels, draw_split, pack_scene, run_in_threads
from peaksim.area.cells import Rays, cells_in_tiles
from peaksim.area.faces import channels_of, view_faces
from peaksim.area.light_map import LightMaps
from peaksim.camera.camera import Camera
from peaksim.native import function
from peaksim.scene.scene import Scene

_pinhole_rays = function("void pinhole_rays(i8 first, f8 fx, f8 fy, f8 cx, f8 cy, f8[rows,columns,3] rays)")


def integrate(scene: Scene, camera: Camera, poses: NDArray[np.float64], maps: LightMaps | None = None) -> Levels:
    """Return the (h, w, channels) linear grey levels of a scene.

    Parameters
    ----------
    scene, camera
        What is packed, and by what.
    poses
        (1, 4, 4) `world_from_camera`, or (h, 4, 4), one for each row.
    maps
        Light baked for the scene, if any.
    """
    packed = pack_scene(scene, maps)
    lattice = corner_rays(camera)
    still = view_faces(packed.faces, poses) if len(poses) == 1 else None
    out = np.empty((camera.height, camera.width, channels_of(scene)), dtype=np.float32)

    def band(first: int) -> None:
        rows = slice(first, min(first + BAND_ROWS, camera.height))
        rays = band_rays(camera, rows) if lattice is None else lattice[rows.start : rows.stop + 1]
        views = still or view_faces(packed.faces, poses[rows])
        draw_split(packed, views, rays, cells_in_tiles(views, rays), out[rows])

    run_in_threads(band, range(0, camera.height, BAND_ROWS))
    return out


@lru_cache(maxsize=2)
def corner_rays(camera: Camera) -> Rays | None:
    """Return (h + 1, w + 1, 3) directions of the pixel corners; None for a pinhole, which needs no table."""
    if camera.is_pinhole:
        return None
    x, y = np.meshgrid(np.arange(camera.width + 1) - 0.5, np.arange(camera.height + 1) - 0.5)
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    return rays.reshape(camera.height + 1, camera.width + 1, 3)


def band_rays(camera: Camera, rows: slice) -> Rays:
    """Return (h + 1, w + 1, 3) directions of the pixel corners of rows of a pinhole."""
    rays = np.empty((rows.stop - rows.start + 1, camera.width + 1, 3))
    _pinhole_rays(rows.start, camera.fx, camera.fy, camera.cx, camera.cy, rays)
    return rays
