"""The camera's pose from markers whose positions in the world are known: OpenCV's PnP, then the reprojection error."""

from dataclasses import dataclass

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, pose_distance, rigid, transform

from peakmark.localise.distance import Values
from peakmark.localise.residuals import Correspondences, Residuals, pixels_per_slope, projected

CERTAIN = 8.0
"""Log-likelihood by which a pose must beat its rival: odds of 3000 to 1 if errors were independent. Kass and Raftery
(1995, doi:10.1080/01621459.1995.10476572) call 5 very strong; a frame's markers err alike, which asks for more."""

SAME_M, SAME_DEG = 1e-3, 0.057
"""Up to these distances two fits are one minimum: far more than where a fit ends, far less than a mirrored pose."""

STEP = 1e-6
"""Of numerical derivatives, radians and metres: far above rounding, far below the curvature."""


@dataclass(frozen=True)
class PoseFit:
    """A camera pose that minimises the reprojection error."""

    world_from_camera: Pose
    """(4, 4)."""
    errors_px: NDArray[np.float64]
    """(n, 2) seen minus projected centres."""
    cost: float
    """Half the sum of squared whitened errors, shapes included: a negative log-likelihood."""


@dataclass(frozen=True)
class PoseEstimate:
    """The best pose, and what else would explain what is seen."""

    fit: PoseFit
    """The pose of least cost."""
    rival: PoseFit | None
    """The best of the other poses, such as the mirrored one of a flat target, which the fit itself reaches where the
    target is seen nearly squarely; None if there is none."""

    @property
    def margin(self) -> float:
        """Log-likelihood by which the pose beats its rival; inf without one."""
        return np.inf if self.rival is None else self.rival.cost - self.fit.cost

    @property
    def is_certain(self) -> bool:
        """Whether no other pose comes within `CERTAIN`."""
        return self.margin >= CERTAIN


def estimate_pose(
    camera: Camera, seen: Correspondences, xy: NDArray[np.float64], points_m: NDArray[np.float64]
) -> PoseEstimate | None:
    """Return the pose that explains markers best, and its rival; None where OpenCV finds none.

    The search starts from the points (k, 2) px and (k, 3) world, k ≥ 4 and not on a line.
    """
    fits = [refine_pose(camera, start, seen) for start in candidate_poses(camera, xy, points_m)]
    ranked = sorted(fits, key=lambda fit: fit.cost)
    if not ranked:
        return None
    others = [fit for fit in ranked[1:] if is_other(ranked[0], fit)]
    if not others and is_flat(points_m):
        mirrored = mirrored_pose(ranked[0].world_from_camera, points_m)
        others = [fit for fit in [fit_at(camera, mirrored, seen)] if is_other(ranked[0], fit)]
    return PoseEstimate(ranked[0], others[0] if others else None)


def refine_pose(camera: Camera, world_from_camera: Pose, seen: Correspondences) -> PoseFit:
    """Return the pose near `world_from_camera` that minimises the errors of centres and shapes (SciPy's MINPACK)."""
    world_from_camera = rigid(world_from_camera, "world_from_camera")
    residuals = Residuals.of(camera, seen)
    steps = np.concatenate([np.zeros((1, 6)), STEP * np.eye(6)])

    def errors(step: Values) -> Values:
        return np.asarray(residuals.at(moved(world_from_camera, step)[None])[0])

    def slopes(step: Values) -> Values:
        values = residuals.at(np.stack([moved(world_from_camera, step + small) for small in steps]))
        return np.asarray((values[1:] - values[0]).T / STEP)

    fit = scipy.optimize.least_squares(errors, np.zeros(6), slopes, method="lm", xtol=1e-7, ftol=1e-7, gtol=1e-7)
    return fit_at(camera, moved(world_from_camera, fit.x), seen)


def fit_at(camera: Camera, world_from_camera: Pose, seen: Correspondences) -> PoseFit:
    """Return how well a pose explains markers, as it is."""
    errors = Residuals.of(camera, seen).at(world_from_camera[None])[0]
    gaps = seen.xy - camera.project(transform(invert(world_from_camera), seen.centers_m))
    return PoseFit(world_from_camera, gaps, float(errors @ errors / 2))


def mirrored_pose(world_from_camera: Pose, points_m: NDArray[np.float64]) -> Pose:
    """Return the pose that sees flat points (k, 3) tilted as much the other way.

    Without perspective both give the same image: the points' normal is reflected at the line of sight to their middle.
    """
    frame, _ = _principal_frame(points_m)
    camera_from_points = invert(world_from_camera) @ frame
    normal, middle = camera_from_points[:3, 2], camera_from_points[:3, 3]
    sight = middle / np.linalg.norm(middle)
    axis = np.cross(normal, sight)
    angle = 2 * np.arctan2(np.linalg.norm(axis), normal @ sight)
    angle = angle - 2 * np.pi if angle > np.pi else angle  # the normal may point away from the camera
    turn = cv2.Rodrigues(angle * axis / max(float(np.linalg.norm(axis)), 1e-12))[0]
    mirrored = compose(turn @ camera_from_points[:3, :3], middle)
    return np.asarray(frame @ invert(mirrored))


def moved(pose: Pose, step: NDArray[np.float64]) -> Pose:
    """Return a pose after a (6,) step in its own frame: rotation vector in radians, translation in metres."""
    return np.asarray(pose @ compose(cv2.Rodrigues(step[:3])[0], step[3:]))


def level_tangents(side_m: float, count: int) -> Values:
    """Return the (count, 3, 2) tangents, see `Correspondences`, of markers on a level floor."""
    return np.broadcast_to(side_m * np.eye(3)[:, :2], (count, 3, 2))


def expected_shapes(
    camera: Camera, world_from_camera: Pose, centers_m: Values, tangents_m: Values
) -> tuple[Values, Values]:
    """Return (n, 2) px and (n, 2, 2) px per tangent at which markers should be seen; nan outside the image."""
    xy = camera.project(transform(invert(world_from_camera), centers_m))
    with np.errstate(invalid="ignore"):
        outside = ~camera.contains(xy)
    xy[outside] = np.nan
    shapes = np.full((len(xy), 2, 2), np.nan)
    _, slopes, _ = projected(world_from_camera[None], centers_m, tangents_m)
    shapes[~outside] = pixels_per_slope(camera, xy[~outside]) @ slopes[0, ~outside]
    return xy, shapes


def candidate_poses(camera: Camera, xy: NDArray[np.float64], points_m: NDArray[np.float64]) -> list[Pose]:
    """Return OpenCV's poses: both of a flat target, else SQPnP's."""
    flat_frame, _ = _principal_frame(points_m)
    flat = is_flat(points_m)
    target = transform(invert(flat_frame), points_m) * ([1, 1, 0] if flat else [1, 1, 1])
    rays = camera.unproject(xy)
    for flag in (cv2.SOLVEPNP_IPPE, cv2.SOLVEPNP_SQPNP) if flat else (cv2.SOLVEPNP_SQPNP,):
        solved = cv2.solvePnPGeneric(target, rays[:, :2] / rays[:, 2:], np.eye(3), None, flags=flag)
        count, rotations, shifts = solved[:3]
        poses = [
            compose(cv2.Rodrigues(r)[0], t.ravel()) for r, t in zip(rotations[:count], shifts[:count], strict=True)
        ]
        finite = [pose for pose in poses if np.isfinite(pose).all()]  # IPPE gives nan for a view exactly head-on
        if finite:
            return [flat_frame @ invert(pose) for pose in finite]
    return []


def is_flat(points_m: NDArray[np.float64]) -> bool:
    """Return whether points (k, 3) lie in a plane."""
    spread = _principal_frame(points_m)[1]
    return bool(spread[2] < 1e-6 * spread[0])


def _principal_frame(points_m: NDArray[np.float64]) -> tuple[Pose, Values]:
    """Return the (4, 4) pose whose z axis is the direction in which points vary least, and their (3,) spreads."""
    middle = points_m.mean(axis=0)
    _, spread, axes = np.linalg.svd(points_m - middle, full_matrices=True)
    axes[2] = np.cross(axes[0], axes[1])
    return compose(axes.T, middle), np.pad(spread, (0, 3 - len(spread)))


def is_other(a: PoseFit, b: PoseFit) -> bool:
    """Return whether two fits are different poses, not one minimum reached twice."""
    distance_m, angle_deg = pose_distance(a.world_from_camera, b.world_from_camera)
    return distance_m > SAME_M or angle_deg > SAME_DEG
