"""The one projection of images and truth, also when the camera moves: row by row, and over the exposure.

A still camera is on a trajectory of one waypoint. Row y is exposed around `time_s` + (y − (H − 1)/2)·`row_time_s`,
for `exposure_s`; a point appears in the row that is exposed while the point projects to it.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, rigid
from peaksim.geometry.trajectory import Trajectory
from peaksim.native import function

_STEPS = 100
"""Most fixed-point steps from a point's row to the pose of that row and back."""
_CONVERGED_PX = 1e-10

_points_in_camera = function("void points_in_camera(const f8[n,3] points, const f8[n_poses,4,4] poses, f8[n,3] out)")


@dataclass(frozen=True, eq=False)
class PosedCamera:
    """A camera on a trajectory, at the time of one image."""

    camera: Camera
    """Intrinsics, lens and shutter."""
    trajectory: Trajectory
    """Where the camera is, and when."""
    time_s: float = 0.0
    """Middle of the exposure of the middle row, seconds on the trajectory."""

    @cached_property
    def pose(self) -> Pose:
        """(4, 4) `world_from_camera` at mid-exposure of the middle row."""
        return self.trajectory.at(self.time_s)

    @property
    def is_rolling(self) -> bool:
        """Whether rows see the scene from different poses."""
        return self.camera.row_time_s > 0 and len(self.trajectory) > 1

    @property
    def is_blurred(self) -> bool:
        """Whether the camera moves while a row is exposed."""
        return self.camera.exposure_s > 0 and len(self.trajectory) > 1

    def row_poses(self, y: ArrayLike) -> NDArray[np.float64]:
        """Return the (n, 4, 4) poses at mid-exposure of (n,) rows, or (1, 4, 4) if all rows have the same.

        Rows farther from the image than its height get the pose at that distance.
        """
        if not self.is_rolling:
            return self.pose[None]
        height = self.camera.height
        rows = np.clip(np.asarray(y, dtype=np.float64), -height, 2 * height) + height
        below = np.minimum(rows.astype(np.int64), 3 * height - 1)
        share = (rows - below)[:, None, None]
        return np.asarray((1 - share) * self._pose_table[below] + share * self._pose_table[below + 1])

    @cached_property
    def _pose_table(self) -> NDArray[np.float64]:
        """(3·H + 1, 4, 4) poses of the rows −H…2·H; between two rows poses are linear to rounding error."""
        rows = np.arange(-self.camera.height, 2 * self.camera.height + 1) - (self.camera.height - 1) / 2
        return self.trajectory.poses_at(self.time_s + rows * self.camera.row_time_s)

    def project(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """Return (n, 2) px of (n, 3) world points at mid-exposure.

        nan behind the camera, and where the rolling shutter never catches the point: it outruns the rows.
        """
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
        xy = self._project_from(self.pose[None], points)
        if not self.is_rolling:
            return xy
        middle = (self.camera.height - 1) / 2
        before = np.full(len(points), np.inf)
        for _ in range(_STEPS):
            before = xy[:, 1]
            xy = self._project_from(self.row_poses(np.nan_to_num(before, nan=middle)), points)
            if not (np.abs(xy[:, 1] - before) > _CONVERGED_PX).any():
                break
        xy[np.abs(xy[:, 1] - before) > _CONVERGED_PX * 1e3] = np.nan
        return xy

    def _project_from(self, poses: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        in_camera = np.empty_like(points)
        _points_in_camera(points, poses, in_camera)
        return self.camera.project(in_camera)

    def rays(self, xy: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the viewing rays of (n, 2) px: (1 or n, 4, 4) poses, (n, 3) directions in camera and world frame."""
        xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        poses = self.row_poses(xy[:, 1])
        rays = self.camera.unproject(xy)
        return poses, rays, (poses[:, :3, :3] @ rays[:, :, None])[:, :, 0]

    def moments(self, count: int) -> tuple["PosedCamera", ...]:
        """Return posed cameras without blur at the middles of `count` equal parts of the exposure."""
        steps = ((np.arange(count) + 0.5) / count - 0.5) * self.camera.exposure_s
        sharp = replace(self.camera, exposure_s=0.0)
        return tuple(PosedCamera(sharp, self.trajectory, self.time_s + float(step)) for step in steps)


def still_camera(camera: Camera, world_from_camera: ArrayLike) -> PosedCamera:
    """Return a camera that stands still."""
    return PosedCamera(camera, Trajectory(np.zeros(1), rigid(world_from_camera, "world_from_camera")[None]))
