"""Errors of estimated poses and trajectories against true ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.pose import Pose, pose_distance, rigid

from peakmark.errors import InputError

WRONG_M, WRONG_DEG = 0.1, 5.0
"""A pose that is farther off counts as wrong: a flip, or another part of the map. Chosen by hand, far above the
errors of measurement (docs/figures/driving.md) and below the distance between markers."""


def pose_error(estimate: Pose | None, truth: Pose) -> tuple[float, float] | None:
    """Return the distance in mm and the angle in degrees between two poses; None without an estimate."""
    if estimate is None:
        return None
    distance_m, angle_deg = pose_distance(truth, estimate)
    return 1000 * distance_m, angle_deg


def is_wrong(error: tuple[float, float] | None) -> bool:
    """Return whether an accepted pose is a flip or on another part of the map."""
    return error is not None and (error[0] > 1000 * WRONG_M or error[1] > WRONG_DEG)


@dataclass(frozen=True)
class TrajectoryErrors:
    """Errors of a trajectory, as evo defines them."""

    ate_rmse_mm: float
    ate_max_mm: float
    """Absolute errors of the positions, root mean square and largest."""
    rpe_rmse_mm: float
    rpe_rmse_deg: float
    """Relative errors from a pose to the next, of positions and rotations, root mean square."""


def trajectory_errors(
    times_s: NDArray[np.float64], truth: Sequence[Pose], estimate: Sequence[Pose | None], is_aligned: bool
) -> TrajectoryErrors | None:
    """Return evo's absolute and relative errors of the frames that have an estimate; None with fewer than three.

    `times_s` are those of n frames, `truth` and `estimate` their poses `world_from_camera`. With `is_aligned` the
    estimate is first moved as a whole to fit the truth best (Umeyama, without scale; a straight path, which leaves that
    open, is put on the first pose). Evo is an extra; an `InputError` says how to
    install it, or that a pose is not rigid.
    """
    try:
        from evo.core import metrics
        from evo.core.geometry import GeometryException
        from evo.core.trajectory import PoseTrajectory3D
    except ImportError as error:
        raise InputError("trajectory errors need evo: pip install 'peakmark[evo]'") from error
    known = {k: rigid(pose, f"estimate[{k}]") for k, pose in enumerate(estimate) if pose is not None}
    if len(known) < 3:
        return None
    reference, own = (
        PoseTrajectory3D(poses_se3=poses, timestamps=times_s[list(known)])
        for poses in ([rigid(truth[k], f"truth[{k}]") for k in known], list(known.values()))
    )
    if is_aligned:
        try:
            own.align(reference)
        except GeometryException:  # a straight path leaves its roll open
            own.align_origin(reference)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    rpe = metrics.RPE(metrics.PoseRelation.translation_part)
    rotation = metrics.RPE(metrics.PoseRelation.rotation_angle_deg)
    for metric in (ape, rpe, rotation):
        metric.process_data((reference, own))
    rmse = metrics.StatisticsType.rmse
    return TrajectoryErrors(
        ate_rmse_mm=1000 * ape.get_statistic(rmse),
        ate_max_mm=1000 * ape.get_statistic(metrics.StatisticsType.max),
        rpe_rmse_mm=1000 * rpe.get_statistic(rmse),
        rpe_rmse_deg=rotation.get_statistic(rmse),
    )
