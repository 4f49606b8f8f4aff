"""Points that nobody named are brought to known positions; and what cannot be."""

import numpy as np
import pytest
from peaksim.geometry.pose import rotation_about

from peakmark.errors import InputError
from peakmark.mapping.align_points import align_points

KNOWN = np.array([(0, 0, 0), (1, 0, 0.1), (0.2, 0.7, 0), (0.9, 0.5, 0.2), (0.4, 0.3, 0.4)])


def test_scale_rotation_and_shift_come_back_without_names() -> None:
    turn = rotation_about("x", 40)[:3, :3] @ rotation_about("z", 77)[:3, :3]
    rng = np.random.default_rng(0)
    order = rng.permutation(5)
    points = (KNOWN[order] - [3, 1, 2]) @ turn * 0.25
    points = np.concatenate([points, [[9.0, 9.0, 9.0]]])  # one that is none of them
    fit = align_points(points, KNOWN, within=0.01)
    assert fit.scale == pytest.approx(4)
    assert np.allclose(fit.rotation, turn)
    assert dict(fit.matches) == {k: int(order[k]) for k in range(5)}
    assert np.allclose(fit(points[:5]), KNOWN[order])
    assert fit.errors.max() < 1e-9


def test_a_mirror_image_does_not_fit() -> None:
    with pytest.raises(InputError, match="expected three of the known positions within 1e-06, got none that fit"):
        align_points(np.random.default_rng(1).random((4, 3)), KNOWN, within=1e-6)


@pytest.mark.parametrize(("points", "known"), [(KNOWN[:2], KNOWN), (KNOWN, KNOWN[:2]), (np.zeros((25, 3)), KNOWN)])
def test_too_few_or_too_many_are_refused(points: np.ndarray, known: np.ndarray) -> None:
    with pytest.raises(InputError, match="expected 3…24 positions"):
        align_points(points, known, within=0.1)
