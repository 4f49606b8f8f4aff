"""A study of poses: what poses are computed from, and figures whose answer is known."""

import numpy as np
import pytest
from peaksim.geometry.pose import rotation_about

from peakmark.experiments.comparison.measure import CHI2_95
from peakmark.experiments.poses.figures import HEAD, figure_row, pose_figures
from peakmark.experiments.poses.study import PoseError, PoseStudyConfig, joined, measured, step_between
from peakmark.localise.pose import moved
from peakmark.maps.marker_map import MappedArray, MarkerMap


def test_one_frame_gives_poses_near_the_truth() -> None:
    poses = measured(PoseStudyConfig(clean=2, warped=0, traced=0, seed=0), 0)
    assert {"one array", "several arrays"} <= {each.source for each in poses}
    certain = [each for each in poses if each.is_told and each.is_certain]
    assert certain
    assert max(each.position for each in certain) < 0.05


def test_figures_of_errors_that_are_as_stated() -> None:
    rng = np.random.default_rng(0)
    nees = rng.chisquare(6, 4000)
    right = [("clean", PoseError("one array", True, True, 0.001, 0.1, float(each), None, 30.0)) for each in nees]
    others = [("clean", PoseError("one array", True, k < 3, 0.4, 9.0, 1e6, 2.0, 30.0)) for k in range(10)]
    rows = pose_figures([*right, *others, ("clean", PoseError("one array", False))])
    assert [row.set for row in rows] == ["clean", "all"]
    row = rows[0]
    assert (row.told, row.wrong) == (4010, 3)
    assert row.uncertain == pytest.approx(7 / 4010)
    assert row.nees == pytest.approx(6, abs=0.2)
    assert row.nees_low is not None
    assert row.nees_high is not None
    assert row.nees_low < 6 < row.nees_high
    assert row.inside == pytest.approx((nees <= CHI2_95).mean())
    assert len(figure_row(row)) == len(HEAD)


def test_the_step_leads_to_the_truth() -> None:
    pose, step = np.eye(4), np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3])
    pose[:3, :3] = rotation_about("y", 30.0)
    assert step_between(pose, moved(pose, step)) == pytest.approx(step)


def test_joined_maps_keep_their_arrays() -> None:
    axes = np.broadcast_to(np.eye(3)[:, :2], (3, 3, 2))
    one = MarkerMap(np.zeros((3, 3)), axes, np.full(3, 0.1), (None,) * 3, (MappedArray(5, (0, 1, 2)),))
    both = joined(one, one)
    assert len(both) == 6
    assert [array.rows for array in both.arrays] == [(0, 1, 2), (3, 4, 5)]
