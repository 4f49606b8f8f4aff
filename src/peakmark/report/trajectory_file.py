"""Writes the poses of frames, some of which may be unknown, as a TUM file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import save_trajectory


def write_known_poses(path: Path, times_s: ArrayLike, poses: Sequence[NDArray[np.float64] | None]) -> None:
    """Write a line for each frame whose (4, 4) world_from_camera is known; no file where none is."""
    known = [k for k, pose in enumerate(poses) if pose is not None]
    if known:
        chosen = np.stack([np.asarray(poses[k]) for k in known])
        save_trajectory(Trajectory(np.asarray(times_s, np.float64)[known], chosen), path)
