import numpy as np

from peakmark.detectors.outcome import run_detector
from peakmark.keypoints.keypoints import Keypoints

PICTURE = np.zeros((9, 9), np.uint8)


def points(xy, response=1.0, size=1.0):
    n = len(xy)
    ones, zeros = np.ones(n), np.zeros(n)
    return Keypoints(xy, ones * size, zeros, ones * response, zeros, zeros, ones)


def test_key_points_outside_or_not_finite_are_counted_and_left_out():
    outcome = run_detector(
        lambda gray: points([[1, 1], [np.nan, 1], [8.5, -0.5], [8.6, 1], [-0.6, 1], [np.inf, 0]]), PICTURE
    )
    np.testing.assert_array_equal(outcome.keypoints.xy, [[1, 1], [8.5, -0.5]])
    assert (outcome.not_finite, outcome.outside, outcome.failure) == (2, 2, "")


def test_a_response_or_size_that_is_no_number_counts_as_not_finite():
    assert run_detector(lambda gray: points([[1, 1]], response=np.nan), PICTURE).not_finite == 1
    assert run_detector(lambda gray: points([[1, 1]], size=np.inf), PICTURE).not_finite == 1


def test_the_strongest_comes_first_whatever_its_sign():
    outcome = run_detector(lambda gray: points([[1, 1], [2, 2], [3, 3]], response=np.array([1.0, -5.0, 3.0])), PICTURE)
    np.testing.assert_array_equal(outcome.keypoints.response, [-5, 3, 1])


def test_a_detector_that_raises_is_named():
    def fail(gray):
        raise ZeroDivisionError("no light")

    outcome = run_detector(fail, PICTURE)
    assert outcome.failure == "ZeroDivisionError: no light"
    assert len(outcome.keypoints) == 0
