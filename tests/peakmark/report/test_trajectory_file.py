from pathlib import Path

import numpy as np
from peaksim.geometry.pose import compose
from peaksim.geometry.trajectory_file import load_trajectory

from peakmark.report.trajectory_file import write_known_poses


def test_frames_without_a_pose_are_left_out_with_their_times(tmp_path: Path) -> None:
    write_known_poses(tmp_path / "found.tum", [0.0, 0.5, 1.0], [np.eye(4), None, compose(np.eye(3), [2.5, 0, 0])])
    read = load_trajectory(tmp_path / "found.tum")
    assert read.times_s.tolist() == [0, 1]
    assert read.world_from_camera[:, 0, 3].tolist() == [0, 2.5]


def test_without_any_pose_there_is_no_file(tmp_path: Path) -> None:
    write_known_poses(tmp_path / "found.tum", [0.0], [None])
    assert not (tmp_path / "found.tum").exists()
