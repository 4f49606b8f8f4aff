import numpy as np
import pytest

from peakmark.detectors.outcome import Outcome
from peakmark.experiments.detectability.conditions import MarkerImage
from peakmark.experiments.detectability.trials import (
    ReferenceResponse,
    reference_response,
    score_image,
    summarise_trials,
)
from peakmark.keypoints.keypoints import Keypoints

VIEW = MarkerImage(np.zeros((200, 200), np.uint8), np.array([100.0, 100.0]), np.array([101.0, 100.0]), 50.0)
REFERENCE = ReferenceResponse(response=10.0, size_per_side=1.0)


def outcome(*rows):
    """Return an outcome of (x, y, size, response) rows, strongest first."""
    table = np.array(rows, float).reshape(-1, 4)
    n = np.zeros(len(table))
    return Outcome(Keypoints(table[:, :2], table[:, 2], n, table[:, 3], n, n, table[:, 2]))


def test_a_key_point_near_the_centre_and_of_the_right_size_is_the_marker():
    trial = score_image(VIEW, outcome((102, 100, 45, 8), (10, 10, 45, 5)), REFERENCE)
    assert trial.detected
    assert trial.detected_in_sides
    assert trial.unique
    np.testing.assert_allclose(trial.error_px, [2, 0])
    np.testing.assert_allclose(trial.blob_error_px, [1, 0])
    assert trial.size_per_side == pytest.approx(0.9)


def test_a_stronger_key_point_elsewhere_takes_uniqueness_away():
    trial = score_image(VIEW, outcome((10, 10, 45, 9), (100, 101, 45, 8)), REFERENCE)
    assert trial.detected
    assert not trial.unique


@pytest.mark.parametrize("size", [20.0, 110.0])
def test_a_key_point_of_another_size_is_not_the_marker(size):
    assert not score_image(VIEW, outcome((100, 100, size, 9)), REFERENCE).detected
    assert score_image(VIEW, outcome((100, 100, size, 9)), None).detected


def test_between_3_px_and_a_tenth_of_a_side_only_the_wider_limit_counts():
    trial = score_image(VIEW, outcome((104, 100, 50, 9)), REFERENCE)
    assert (trial.detected, trial.detected_in_sides, trial.unique) == (False, True, False)


def test_nothing_near_is_a_miss():
    for found in (outcome(), outcome((150, 100, 50, 9))):
        trial = score_image(VIEW, found, REFERENCE)
        assert not trial.detected
        assert np.isnan(trial.response)


def test_summary_counts_and_averages_what_was_found():
    found = [outcome((100 + dx, 100, 50, 8)) for dx in (1, -1, 1, 1)] + [Outcome(outcome().keypoints, 1, 2, "E: x")]
    trials = [score_image(VIEW, one, REFERENCE) for one in found]
    row = summarise_trials(trials, found, REFERENCE)
    assert row.detected.value == 0.8
    assert row.detected.low < 0.8 < row.detected.high
    assert row.response_ratio == pytest.approx(0.8)
    assert row.error.bias_xy == pytest.approx((0.5, 0))
    assert row.error.rms == pytest.approx(1)
    assert row.blob_error.bias_xy == pytest.approx((-0.5, 0))
    assert (row.failures, row.not_finite, row.outside, row.first_failure) == (1, 1, 2, "E: x")


def test_a_key_point_beyond_3_px_counts_for_the_near_response_alone():
    found = [outcome((106, 100, 50, 6)), outcome((100, 100, 50, 8))]
    row = summarise_trials([score_image(VIEW, one, REFERENCE) for one in found], found, REFERENCE)
    assert (row.response_ratio, row.near_response_ratio) == pytest.approx((0.8, 0.7))


def test_summary_of_misses_has_no_figures():
    row = summarise_trials([score_image(VIEW, outcome(), REFERENCE)], [outcome()], REFERENCE)
    assert row.detected.value == 0
    assert row.response.median is row.error.rms is row.response_ratio is row.near_response_ratio is None


def test_reference_is_the_median_of_what_was_detected():
    trials = [score_image(VIEW, outcome((100, 100, size, r)), None) for size, r in ((50, 8), (60, 10), (70, 30))]
    found = reference_response([*trials, score_image(VIEW, outcome(), None)])
    assert (found.response, found.size_per_side) == pytest.approx((10.0, 1.2))
    assert reference_response([score_image(VIEW, outcome(), None)]) is None
