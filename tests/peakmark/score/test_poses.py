"""Errors of poses and trajectories, against errors put in by hand."""

import numpy as np
import pytest
from peaksim.geometry.pose import compose, rotation_about

from peakmark.errors import InputError
from peakmark.score.poses import WRONG_DEG, WRONG_M, is_wrong, pose_error, trajectory_errors


def test_a_pose_is_as_wrong_as_it_was_made() -> None:
    truth = compose(rotation_about("x", 40), [1.0, -2.0, 0.5])
    error = pose_error(truth @ compose(rotation_about("y", 3), [0.003, 0, 0.004]), truth)
    assert error == (pytest.approx(5.0), pytest.approx(3.0))
    assert pose_error(truth, truth) == (0.0, pytest.approx(0.0, abs=1e-6))
    assert pose_error(None, truth) is None


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (None, False),
        ((1000 * WRONG_M, WRONG_DEG), False),
        ((1000 * WRONG_M + 0.1, 0.0), True),
        ((0.0, WRONG_DEG + 0.1), True),
    ],
)
def test_a_pose_is_wrong_beyond_either_limit(error: tuple[float, float] | None, expected: bool) -> None:
    assert is_wrong(error) == expected


def test_evo_agrees_with_errors_put_in_by_hand() -> None:
    pytest.importorskip("evo")
    poses = [compose(np.eye(3), [k, 0, 0]) for k in range(5)]
    shifted = [compose(np.eye(3), [k, 0.003, 0]) for k in range(5)]
    errors = trajectory_errors(np.arange(5.0), poses, [*shifted[:4], None], is_aligned=False)
    assert errors is not None
    assert errors.ate_rmse_mm == pytest.approx(3.0)
    assert errors.ate_max_mm == pytest.approx(3.0)
    assert errors.rpe_rmse_mm == pytest.approx(0.0, abs=1e-9)
    assert errors.rpe_rmse_deg == pytest.approx(0.0, abs=1e-9)
    aligned = trajectory_errors(np.arange(5.0), poses, shifted, is_aligned=True)
    assert aligned is not None
    assert aligned.ate_rmse_mm == pytest.approx(0.0, abs=1e-6)
    assert trajectory_errors(np.arange(5.0), poses, [None] * 5, is_aligned=False) is None


def test_a_mirrored_pose_has_no_error() -> None:
    mirrored, truth = np.diag([1.0, 1.0, -1.0, 1.0]), [compose(np.eye(3), [k, 0, 0]) for k in range(3)]
    with pytest.raises(InputError, match="got a mirrored one"):
        pose_error(mirrored, truth[0])
    pytest.importorskip("evo")
    with pytest.raises(InputError, match=r"estimate\[1\]: expected a rigid transform .* got a mirrored one"):
        trajectory_errors(np.arange(3.0), truth, [truth[0], mirrored, truth[2]], is_aligned=False)
