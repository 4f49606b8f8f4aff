"""The rays of an image: our own camera, row by row and over the exposure, as tables that kernels interpolate.

Directions are bilinear in a pixel between `unproject` of its corners, as they are for the exact renderer: exact for a
pinhole; a lens bends by less than a thousandth of a pixel within one. Poses are those of each row, at knots in time.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.area.integrate import band_rays, corner_rays
from peaksim.camera.shutter import PosedCamera
from peaksim.camera.thin_lens import ThinLens
from peaksim.traced.library import Tools

KNOTS = 16
"""Intervals of the exposure in which a pose is as good as straight: a rotation of 5° is then off by 4·10⁻⁶ rad."""


@dataclass(frozen=True)
class View:
    """Rows of an image, as seen."""

    corners: Any
    """(h + 1)·(w + 1)·3 floats: directions of the pixel corners, camera frame."""
    width: int
    """Pixels a row."""
    poses: Any
    """Twelve floats a pose: three columns of rotation, then position; a pose a knot, and knots row by row."""
    is_rolling: bool
    """Whether each row has poses of its own."""
    knots: int
    """Intervals of the exposure; 0 where the camera stands still."""
    thin_lens: ThinLens | None
    """Of the camera."""
    on_sphere: bool
    """Whether the thin lens is in focus on a sphere: for fisheyes, which see more than half a space."""


def view_of(tools: Tools, posed: PosedCamera, rows: slice) -> View:
    """Return some rows of an image as tables of Mitsuba's current variant."""
    camera, mi = posed.camera, tools.mi
    lattice = corner_rays(camera)
    corners = band_rays(camera, rows) if lattice is None else lattice[rows.start : rows.stop + 1]
    poses = _poses(posed, rows)
    return View(
        corners=mi.Float(np.ascontiguousarray(corners, dtype=np.float32).ravel()),
        width=camera.width,
        poses=mi.Float(np.swapaxes(poses[..., :3, :], -1, -2).astype(np.float32).ravel()),
        is_rolling=len(poses) > 1,
        knots=poses.shape[1] - 1,
        thin_lens=camera.thin_lens,
        on_sphere=camera.model == "fisheye",
    )


def _poses(posed: PosedCamera, rows: slice) -> NDArray[np.float64]:
    """Return the (rows or 1, knots + 1, 4, 4) poses of rows over their exposure."""
    camera = posed.camera
    knots = KNOTS if posed.is_blurred else 0
    late = np.arange(rows.start, rows.stop) - (camera.height - 1) / 2 if posed.is_rolling else np.zeros(1)
    within = (np.arange(knots + 1) / knots - 0.5) * camera.exposure_s if knots else np.zeros(1)
    times = posed.time_s + late[:, None] * camera.row_time_s + within
    return posed.trajectory.poses_at(times.ravel()).reshape(*times.shape, 4, 4)


def rays(tools: Tools, view: View, pixel: Any, position: Any, moment: Any, aperture: Any) -> tuple[Any, Any]:
    """Return world rays, and whether the lens sees anything there.

    Parameters
    ----------
    view
        Rows of an image.
    pixel
        Numbers of pixels in these rows, row by row.
    position, aperture
        Two numbers each, 0…1: where in the pixel, and where in the lens.
    moment
        Number 0…1: when in the exposure.
    """
    mi, dr = tools
    row = pixel // view.width
    direction = _direction(tools, view, pixel + row, position)
    seen = dr.isfinite(dr.squared_norm(direction))
    direction = dr.select(seen, direction, mi.Vector3f(0, 0, 1))
    x, y, z, eye = _pose(tools, view, row, moment)
    if view.thin_lens is not None:
        through = dr.normalize(direction) if view.on_sphere else direction
        at = mi.warp.square_to_uniform_disk_concentric(aperture) * (view.thin_lens.aperture_m / 2)
        direction = through * view.thin_lens.focus_m - mi.Vector3f(at.x, at.y, 0)
        eye += x * at.x + y * at.y
    world = dr.normalize(x * direction.x + y * direction.y + z * direction.z)
    return mi.RayDifferential3f(mi.Ray3f(mi.Point3f(eye), world)), seen


def _direction(tools: Tools, view: View, corner: Any, position: Any) -> Any:
    """Return directions at positions between a corner of the table, its right and its lower neighbours."""
    dr = tools.dr
    upper, lower = (
        dr.lerp(_vector(tools, view.corners, k), _vector(tools, view.corners, k + 1), position.x)
        for k in (corner, corner + view.width + 1)
    )
    return dr.lerp(upper, lower, position.y)


def _pose(tools: Tools, view: View, row: Any, moment: Any) -> list[Any]:
    """Return the columns of rotation and the position of rows at moments of their exposure."""
    mi, dr = tools
    first = row * (4 * (view.knots + 1)) if view.is_rolling else mi.UInt32(0)
    if not view.knots:
        return [_vector(tools, view.poses, first + k) for k in range(4)]
    knot = dr.minimum(mi.UInt32(moment * view.knots), view.knots - 1)
    share, first = moment * view.knots - knot, first + 4 * knot
    before, after = ([_vector(tools, view.poses, at + k) for k in range(4)] for at in (first, first + 4))
    return [dr.lerp(start, end, share) for start, end in zip(before, after, strict=True)]


def _vector(tools: Tools, table: Any, index: Any) -> Any:
    return tools.dr.gather(tools.mi.Vector3f, table, index)
