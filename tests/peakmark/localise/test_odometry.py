"""Motion without a map: the trajectory is the true one, in metres, up to a slow drift."""

import numpy as np
import pytest
from peaksim.geometry.pose import Pose, invert

from peakmark.localise.odometry import odometry
from tests.floor_views import CAMERA, SIDE_M, apart, winding_map
from tests.peakmark.localise.test_tracks import drive


def follow_poses(frames: list, true: list[Pose]) -> tuple[list[Pose | None], list[Pose]]:
    found = list(odometry(CAMERA, SIDE_M, [(s.names, s.xy, s.affinity) for s in frames], sigma_px=0.25))
    first = next(k for k, pose in enumerate(found) if pose is not None)
    return found, [found[first] @ invert(true[first]) @ pose for pose in true]


@pytest.mark.parametrize("seed", range(3))
def test_three_metres_are_driven_with_little_drift(seed: int) -> None:
    rng = np.random.default_rng(seed)
    taken = drive(winding_map(rng, 60), rng, 0.05, 60, nod_deg=0.5)
    found, expected = follow_poses([seen for _, seen in taken], [pose for pose, _ in taken])
    assert all(pose is not None for pose in found)
    errors = np.array([apart(a, b) for a, b in zip(found, expected, strict=True)])
    assert errors[:, 0].max() < 0.05
    assert errors[:, 1].max() < 1.0


def test_frames_that_show_too_little_are_none_and_the_trajectory_resumes() -> None:
    rng = np.random.default_rng(1)
    taken = drive(winding_map(rng, 30), rng, 0.03, 30)
    frames = [seen for _, seen in taken]
    blind = [k in (0, 10, 11) for k in range(30)]
    found, expected = follow_poses(
        [seen.rows(np.zeros(len(seen.xy), bool)) if b else seen for b, seen in zip(blind, frames, strict=True)],
        [pose for pose, _ in taken],
    )
    assert [pose is None for pose in found] == blind
    assert apart(found[-1], expected[-1])[0] < 0.05


def test_a_wrong_identity_is_left_out() -> None:
    rng = np.random.default_rng(2)
    taken = drive(winding_map(rng, 30), rng, 0.03, 12)
    frames = [seen for _, seen in taken]
    frames[8].names[1] = frames[8].names[2] + 0
    frames[8].names[2] = 999
    found, expected = follow_poses(frames, [pose for pose, _ in taken])
    assert apart(found[8], expected[8])[0] < 0.03
