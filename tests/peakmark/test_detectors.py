import sys
import types

import cv2
import numpy as np
import pytest
from helpers import marker_view

from peakmark import marker, surf
from peakmark.detectors import detector, dog_response, run
from peakmark.errors import InputError
from peakmark.keypoints import Keypoints


def sift_picture():
    """Return a dark SIFT marker of σ 6 exactly in the middle, (80, 80), of a picture."""
    return cv2.copyMakeBorder(marker.sift_marker(6.0, 73), 44, 44, 44, 44, cv2.BORDER_REPLICATE)


def strongest(name, picture):
    found = run(detector(name), picture).keypoints
    assert len(found)
    return found[0]


@pytest.mark.parametrize("name", ["surf", "surf-paper"])
def test_our_surf_is_found_by_name(name):
    picture = marker_view(60)
    preset = surf.PAPER if name == "surf-paper" else surf.OPENCV
    expected = surf.detect(picture, threshold=100.0, **preset)
    found = run(detector(name), picture).keypoints
    np.testing.assert_array_equal(found.xy, expected.xy)
    np.testing.assert_array_equal(found.response, expected.response)


def test_opencvs_sift_is_a_quarter_of_a_pixel_off_unless_precise():
    offset = strongest("sift", sift_picture()).xy[0] - 80
    np.testing.assert_allclose(offset, 0.25, atol=0.02)
    np.testing.assert_allclose(strongest("sift-precise", sift_picture()).xy[0], 80, atol=0.02)


def test_vlfeat_is_centred_and_its_response_is_signed():
    pytest.importorskip("pycolmap")
    for picture, sign in ((sift_picture(), 1), (255 - sift_picture(), -1)):
        best = strongest("vlfeat", picture)
        np.testing.assert_allclose(best.xy[0], 80, atol=0.02)
        assert best.laplacian[0] == sign
        assert best.size[0] / 2 == pytest.approx(6 / np.sqrt(2), rel=0.1)


def test_dog_response_is_the_difference_of_blurred_pictures():
    picture = sift_picture()
    wide, narrow = (
        cv2.GaussianBlur(picture / 255.0, (0, 0), s, borderType=cv2.BORDER_REPLICATE) for s in (4 * 2 ** (1 / 3), 4)
    )
    for x, y in ((80, 80), (75, 90)):
        assert dog_response(picture, np.array([x, y]), 4.0) == pytest.approx(wide[y, x] - narrow[y, x], abs=2e-4)


@pytest.mark.parametrize("name", ["cv2:ORB", "cv2:AKAZE", "cv2:BRISK"])
def test_any_opencv_detector_is_found_by_name(name):
    found = run(detector(name), marker_view(60)).keypoints
    assert len(found) > 0
    assert (np.diff(np.abs(found.response)) <= 0).all()


@pytest.fixture
def own(monkeypatch):
    """Return a module "own" to put a detector in."""
    module = types.ModuleType("own")
    monkeypatch.setitem(sys.modules, "own", module)
    return module


def points(xy, response=1.0):
    n = len(xy)
    return Keypoints(xy, np.ones(n), np.zeros(n), np.full(n, response), np.zeros(n), np.zeros(n), np.ones(n))


def test_a_users_function_may_return_our_key_points_or_opencvs(own):
    own.ours = lambda gray: points([[3, 4]])
    own.theirs = lambda gray: [cv2.KeyPoint(3.0, 4.0, 2.0)]
    for name in ("own:ours", "own:theirs"):
        np.testing.assert_array_equal(run(detector(name), np.zeros((9, 9), np.uint8)).keypoints.xy, [[3, 4]])


def test_key_points_that_are_none_are_counted_and_left_out(own):
    own.bad = lambda gray: points([[1, 1], [np.nan, 1], [8.5, 1], [8.6, 1], [-0.6, 1], [np.inf, 0]])
    outcome = run(detector("own:bad"), np.zeros((9, 9), np.uint8))
    assert (len(outcome.keypoints), outcome.not_finite, outcome.outside) == (2, 2, 2)


def test_a_detector_that_raises_is_named(own):
    def fail(gray):
        raise ZeroDivisionError("no light")

    own.fail = fail
    outcome = run(detector("own:fail"), np.zeros((9, 9), np.uint8))
    assert outcome.failure == "ZeroDivisionError: no light"
    assert len(outcome.keypoints) == 0


@pytest.mark.parametrize(
    "name", ["", "surfing", "cv2:Nothing", "cv2:BFMatcher", "no_such_module:f", "numpy:no_such", "numpy:pi", ":f"]
)
def test_unknown_detectors_are_refused(name):
    with pytest.raises(InputError, match=r"expected .* got "):
        detector(name)
