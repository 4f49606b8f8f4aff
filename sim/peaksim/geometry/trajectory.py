"""Trajectories: a camera's pose over time, smooth between waypoints."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, compose, interpolate, rigid

_UNIT_TOLERANCE = 1e-3  # of quaternions: files have few decimals


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Waypoints in time; between them the pose is a cubic spline in position and in rotation.

    Raises
    ------
    SceneError
        If the times do not increase strictly, or a pose is not rigid.
    """

    times_s: NDArray[np.float64]
    """(n,) strictly increasing times, n ≥ 1, seconds."""
    world_from_camera: NDArray[np.float64]
    """(n, 4, 4) poses."""

    def __post_init__(self) -> None:
        times = np.atleast_1d(np.array(self.times_s, dtype=np.float64))
        poses = np.array(self.world_from_camera, dtype=np.float64)
        if times.ndim != 1 or len(times) == 0 or poses.shape != (len(times), 4, 4):
            raise SceneError(
                f"trajectory: expected n ≥ 1 times and (n, 4, 4) poses, got {times.shape} and {poses.shape}"
            )
        if not np.isfinite(times).all() or not (np.diff(times) > 0).all():
            raise SceneError(f"trajectory: times_s: expected strictly increasing times, got {_fault(times)}")
        for i, pose in enumerate(poses):
            rigid(pose, f"trajectory: pose {i}")
        object.__setattr__(self, "times_s", times)
        object.__setattr__(self, "world_from_camera", poses)

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last waypoint, seconds."""
        return float(self.times_s[-1] - self.times_s[0])

    def at(self, time_s: float) -> Pose:
        """Return the (4, 4) `world_from_camera` at a time; before the start and after the end it stands still."""
        return np.asarray(self.poses_at([time_s])[0])

    def poses_at(self, times_s: ArrayLike) -> NDArray[np.float64]:
        """Return the (n, 4, 4) `world_from_camera` at (n,) times, as `at` does."""
        times = np.clip(np.asarray(times_s, dtype=np.float64), self.times_s[0], self.times_s[-1])
        if len(self) == 1:
            return np.repeat(self.world_from_camera, len(times), axis=0)
        if len(self) == 2:
            fractions = (times - self.times_s[0]) / self.duration_s
            return interpolate(self.world_from_camera[0], self.world_from_camera[1], fractions)
        position, rotation = self._splines
        poses = np.tile(np.eye(4), (len(times), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = rotation(times).as_matrix(), position(times)
        return poses

    def frame_times_s(self, frames_per_second: float) -> NDArray[np.float64]:
        """Return the (n,) times of all frames from the start to the end, both included where they fall on a frame.

        Raises
        ------
        SceneError
            If the frame rate is not positive and finite.
        """
        if not 0 < frames_per_second < np.inf:
            raise SceneError(f"trajectory: expected a positive frame rate, got {frames_per_second}")
        count = int(np.floor(self.duration_s * frames_per_second + 1e-9)) + 1
        return np.asarray(self.times_s[0] + np.arange(count) / frames_per_second)

    @cached_property
    def _splines(self) -> tuple[Any, Any]:
        rotations = scipy.spatial.transform.Rotation.from_matrix(self.world_from_camera[:, :3, :3])
        return (
            scipy.interpolate.CubicSpline(self.times_s, self.world_from_camera[:, :3, 3]),
            scipy.spatial.transform.RotationSpline(self.times_s, rotations),
        )


def _fault(times: NDArray[np.float64]) -> str:
    if not np.isfinite(times).all():
        return "nan or inf"
    i = int(np.flatnonzero(np.diff(times) <= 0)[0])
    return f"{times[i]:.9g} followed by {times[i + 1]:.9g}"


def from_quaternions(times_s: ArrayLike, positions_m: ArrayLike, quaternions_xyzw: ArrayLike) -> Trajectory:
    """Return a trajectory of (n,) times, (n, 3) positions and (n, 4) unit quaternions (x, y, z, w).

    Raises
    ------
    SceneError
        If a quaternion's length differs from 1 by more than 10⁻³.
    """
    quaternions = np.asarray(quaternions_xyzw, dtype=np.float64).reshape(-1, 4)
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(~(np.abs(lengths - 1) <= _UNIT_TOLERANCE))
    if len(wrong):
        raise SceneError(f"pose {wrong[0]}: expected a unit quaternion, got one of length {lengths[wrong[0]]:.6g}")
    rotations = scipy.spatial.transform.Rotation.from_quat(quaternions).as_matrix()
    positions = np.asarray(positions_m, dtype=np.float64).reshape(-1, 3)
    return Trajectory(np.asarray(times_s), np.stack([compose(r, p) for r, p in zip(rotations, positions, strict=True)]))


def quaternions_xyzw(trajectory: Trajectory) -> NDArray[np.float64]:
    """Return (n, 4) unit quaternions (x, y, z, w) with w ≥ 0."""
    rotations = scipy.spatial.transform.Rotation.from_matrix(trajectory.world_from_camera[:, :3, :3])
    return np.asarray(rotations.as_quat(canonical=True))
