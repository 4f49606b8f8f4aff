"""What stages say of fits, and who is asked whether they go on."""

import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.identification.alignment import align_candidates, noise_sigma_of
from peakmark.identification.stages import STAGE_COLUMNS, STAGES, stage_columns
from peakmark.markers.patterns import Variant
from tests.peakmark.identification.test_general import CENTER, as_image, view

IMAGE = as_image(view(), 1.0)
AWAY = np.array([60.0, 60.0])  # plain ground


def test_the_columns_are_those_of_the_fit() -> None:
    theta = np.zeros((1, 18))
    theta[0, :12] = [13, 14, 0, 40, -10, 0, 0.03, 0.04, 100, 20, 2, 0.3]
    theta[0, 15] = 0.35
    fits = np.array([[25.0, 0.1, 0.002, 0.7, 1.0, np.inf]])
    said = stage_columns(np.array([[10.0, 10.0]]), np.array([10.0]), 2.5, theta, fits)
    columns = dict(zip(STAGE_COLUMNS, said[0], strict=True))
    assert np.exp(columns["left"]) == pytest.approx(25 / 100**2)
    assert np.exp(columns["noise"]) == pytest.approx(25 / 2.5**2)
    assert np.exp(columns["gain_to_noise"]) == pytest.approx(40)
    assert (columns["cut"], columns["ramp"], columns["step"]) == (0.7, 1.0, -1.0)
    assert np.exp(columns["size_ratio"]) == pytest.approx(2)
    assert columns["moved"] == pytest.approx(0.5)
    assert columns["anisotropy"] == pytest.approx(4 + 1 / 4)
    assert columns["perspective"] == pytest.approx(0.05)
    assert columns["gain_slope"] == pytest.approx(0.3)
    assert columns["blur"] == pytest.approx(2 / 400)


@pytest.mark.parametrize("last", range(len(STAGES)))
def test_what_is_not_worth_another_stage_is_left_out(last: int) -> None:
    asked: list[tuple[int, list[int], tuple[int, ...]]] = []

    def is_worth(stage: int, rows: NDArray[np.intp], said: NDArray[np.float64]) -> NDArray[np.bool_]:
        asked.append((stage, rows.tolist(), said.shape))
        return np.where(stage == last, rows == 0, True)

    xy, sides, variant = np.array([CENTER, AWAY]), np.array([34.0, 34.0]), Variant("dark")
    whole = align_candidates(IMAGE, xy, sides, variant, noise_sigma_of(IMAGE))
    found = align_candidates(IMAGE, xy, sides, variant, noise_sigma_of(IMAGE), is_worth)
    assert found.rows.tolist() == [0]
    assert np.array_equal(found.theta[0], whole.theta[0])
    assert asked[0] == (0, [0, 1], (2, 1, len(STAGE_COLUMNS)))
    if last == 0:
        assert asked[1] == (1, [0], (1, 2, len(STAGE_COLUMNS)))
    assert np.isfinite(found.said[0, :2]).all()
    assert np.isnan(found.said[0, 2]).all()  # the first look explains all
