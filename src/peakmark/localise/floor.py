"""The floor under the camera, without a map: height and normal from the size and shape that markers show."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, rigid

from peakmark.localise.distance import Values, ray_slopes, solid_angles, unit_rays

_STRAIGHT = 1e-3
"""Smallest singular value over the largest, of the rays, below which areas alone cannot tell the plane."""

_LOSS_SCALE = 0.1
"""Relative error of a marker's shape from which it counts as an outlier."""


@dataclass(frozen=True)
class Floor:
    """A plane, as the camera sees it."""

    normal: NDArray[np.float64]
    """(3,) unit normal towards the camera's side, camera frame."""
    height_m: float
    """Distance of the camera centre from the plane, metres."""

    @property
    def floor_from_camera(self) -> Pose:
        """(4, 4) pose: origin on the floor below the camera, z up, y where the camera looks, x to the right."""
        ahead = np.array([0.0, 0.0, 1.0]) if abs(self.normal[2]) < 0.999 else np.array([0.0, -1.0, 0.0])
        right = np.cross(ahead, self.normal)
        right /= np.linalg.norm(right)
        return compose(np.stack([right, np.cross(self.normal, right), self.normal]), [0.0, 0.0, self.height_m])


def floor_of_pose(world_from_camera: Pose) -> Floor:
    """Return the plane z = 0 of the world."""
    pose = rigid(world_from_camera, "world_from_camera")
    return Floor(pose[2, :3].copy(), float(pose[2, 3]))


def on_floor(floor: Floor, rays: NDArray[np.float64]) -> Values:
    """Return (n, 2) floor coordinates, m (`Floor.floor_from_camera`), where rays meet it; nan where they do not."""
    down = -(rays @ floor.normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(down > 1e-9, floor.height_m / down, np.nan)
    rotated = rays @ floor.floor_from_camera[:3, :3].T
    return np.asarray(rotated[:, :2] * reach[:, None])


def floor_from_areas(camera: Camera, xy: ArrayLike, side_px: ArrayLike, side_m: float) -> Floor | None:
    """Return the floor from where the markers are and how large, without their shapes; None if that cannot tell.

    A marker's solid angle is ω = s² |n·r|³ / h², so that (ω/s²)^⅓ = −(n / h^⅔)·r is linear in n / h^⅔. Needs three
    markers, at (n, 2) px, whose rays do not lie in a plane; `side_px` are the square roots of their image areas, such
    as SURF's scales.
    """
    rays = unit_rays(camera, xy)
    spread = np.linalg.svd(rays, compute_uv=False)
    if len(rays) < 3 or spread[2] < _STRAIGHT * spread[0]:
        return None
    roots = np.cbrt(solid_angles(camera, xy, side_px) / side_m**2)
    scaled, *_ = np.linalg.lstsq(-rays / roots[:, None], np.ones(len(rays)), rcond=None)
    length = float(np.linalg.norm(scaled))
    floor = Floor(np.asarray(scaled / length), length**-1.5)
    return floor if (rays @ floor.normal < 0).all() else None


def floor_from_shapes(camera: Camera, xy: ArrayLike, affinity: ArrayLike, side_m: float) -> Floor | None:
    """Return the floor that explains the shapes of refined markers best; None without markers.

    They lie at (n, 2) px and span (n, 2, 2) px per side, which is `side_m` long. Each marker alone allows two planes,
    mirrored at its ray; the markers together choose. Markers that lie elsewhere (on a wall) or have a wrong shape weigh
    little (Cauchy loss). A single marker's two planes are told apart only by the camera not being rolled by more than
    90°: the plane whose normal points up in the image is taken.
    """
    rays = unit_rays(camera, xy)
    if len(rays) == 0:
        return None
    bases = tangent_bases(rays)
    angles = ray_slopes(camera, xy) @ np.asarray(affinity, dtype=np.float64).reshape(-1, 2, 2)
    shapes = np.linalg.inv(np.linalg.cholesky(_gram(bases @ angles)))
    starts = _floors_of_each(rays, bases, angles, side_m)
    costs = [np.log1p((_shape_errors(start, rays, bases, shapes, side_m) / _LOSS_SCALE) ** 2).sum() for start in starts]
    best = starts[int(np.argmin(np.array(costs) + [1e-6 * start[1] for start in starts]))]
    fit = scipy.optimize.least_squares(
        _shape_errors, best, args=(rays, bases, shapes, side_m), loss="cauchy", f_scale=_LOSS_SCALE
    )
    height = float(np.linalg.norm(fit.x))
    return Floor(fit.x / height, height)


def tangent_bases(rays: NDArray[np.float64]) -> Values:
    """Return (n, 2, 3) orthonormal rows across each unit ray."""
    helper = np.where(np.abs(rays[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(rays, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(rays, first)], axis=1)


def _gram(matrices: NDArray[np.float64]) -> Values:
    return np.asarray(matrices @ np.swapaxes(matrices, 1, 2))


def _floors_of_each(
    rays: NDArray[np.float64], bases: NDArray[np.float64], angles: NDArray[np.float64], side_m: float
) -> list[Values]:
    """Return the two planes, as normal × height, that each marker's shape allows."""
    floors = []
    for ray, basis, angle in zip(rays, bases, angles, strict=True):
        axes, spans, _ = np.linalg.svd(basis @ angle)
        cosine = min(spans[1] / spans[0], 1.0)
        across = np.sqrt(1 - cosine**2) * (axes[:, 1] @ basis)
        distance = side_m / spans[0]
        for sign in (1, -1):
            normal = sign * across - cosine * ray
            floors.append(normal * distance * cosine)
    return floors


def _shape_errors(
    plane_m: NDArray[np.float64],
    rays: NDArray[np.float64],
    bases: NDArray[np.float64],
    shapes: NDArray[np.float64],
    side_m: float,
) -> Values:
    """Return (3n,) relative errors of the shapes on the plane `normal × height`.

    On the plane a marker spans (s/d)² (1 − (Pn)(Pn)ᵀ) across its ray, however it is rotated; measured in units of the
    seen shape that is the identity.
    """
    height = np.linalg.norm(plane_m)
    normal = plane_m / height
    down = np.maximum(-(rays @ normal), 1e-3)
    across = bases @ normal
    spans = np.eye(2) - across[:, :, None] * across[:, None, :]
    spans *= (side_m * down / height)[:, None, None] ** 2
    relative = shapes @ spans @ np.swapaxes(shapes, 1, 2) - np.eye(2)
    return np.asarray(
        np.stack([relative[:, 0, 0], relative[:, 1, 1], np.sqrt(2) * relative[:, 0, 1]], axis=1).ravel() / 2
    )
