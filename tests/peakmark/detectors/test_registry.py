import sys
import types

import cv2
import numpy as np
import pytest

from peakmark import marker, surf
from peakmark.detectors.registry import NAMES, find_detector, has_opencv_surf, settings_of
from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints
from tests.helpers import marker_view
from tests.peakmark.surf.parity import compare
from tests.samples import speckled


def sift_image():
    """Return a dark SIFT marker of σ 6 exactly in the middle, (80, 80), of a image."""
    return cv2.copyMakeBorder(marker.sift_marker(6.0, 73), 44, 44, 44, 44, cv2.BORDER_REPLICATE)


@pytest.mark.parametrize("name", ["surf", "surf-paper"])
def test_our_surf_is_found_by_name(name):
    image = marker_view(60)
    preset = surf.PAPER if name == "surf-paper" else surf.OPENCV
    expected = surf.detect_and_describe(image, **preset)
    for describe in (True, False):
        found = find_detector(name, describe)(image)
        np.testing.assert_array_equal(found.xy, expected.xy)
        np.testing.assert_array_equal(found.response, expected.response)
        assert (found.descriptors is None) == (not describe)


def test_opencvs_surf_is_there_or_the_message_says_what_to_take():
    if has_opencv_surf():
        np.testing.assert_array_equal(
            find_detector("surf-opencv")(marker_view(60)).xy, find_detector("surf")(marker_view(60)).xy
        )
    else:
        with pytest.raises(InputError, match="built without SURF; surf gives the same"):
            find_detector("surf-opencv")


@pytest.mark.skipif(not has_opencv_surf(), reason="this OpenCV was built without SURF")
@pytest.mark.parametrize(
    "parameters", [{}, {"extended": True, "upright": True}, {"strongest": 20}, {"mask": speckled(200, 260, 5) > 120}]
)
def test_opencvs_surf_takes_our_parameters_and_gives_the_same(parameters):
    gray = speckled(200, 260, 5)
    theirs, ours = (find_detector(name)(gray, **parameters) for name in ("surf-opencv", "surf"))
    parity = compare(theirs, ours)
    assert parity.theirs == parity.ours == len(parity.pairs) > 10


def test_opencvs_sift_is_a_quarter_of_a_pixel_off_as_it_comes():
    biased, centred = (find_detector(name)(sift_image())[0] for name in ("sift-opencv", "sift"))
    np.testing.assert_allclose(biased.xy[0] - 80, 0.25, atol=0.02)
    np.testing.assert_allclose(centred.xy[0] - 80, 0, atol=0.02)


UNDESCRIBED = ("cv2:FastFeatureDetector", "cv2:xfeatures2d.StarDetector")


@pytest.mark.parametrize("name", ["sift", "sift-opencv", "cv2:ORB", "cv2:AKAZE", "cv2:BRISK", *UNDESCRIBED])
def test_opencvs_detectors_are_found_by_name_and_give_the_strongest_first(name):
    image = marker_view(60)
    plain, described = (find_detector(name, describe)(image) for describe in (False, True))
    assert len(plain) > 0
    assert (np.diff(np.abs(plain.response)) <= 0).all()
    assert plain.descriptors is None
    assert (described.descriptors is None) == (name in UNDESCRIBED)


@pytest.mark.parametrize("name", ["surf", "sift", "cv2:ORB", "vlfeat"])
def test_nothing_to_see_gives_no_key_points(name):
    if name == "vlfeat":
        pytest.importorskip("pycolmap")
    assert len(find_detector(name)(np.full((64, 64), 90, np.uint8))) == 0


def test_parameters_reach_opencvs_detectors():
    by_name = find_detector("cv2:ORB")(marker_view(60), nlevels=2)
    asked = cv2.ORB_create(nlevels=2).detect(marker_view(60), None)
    assert sorted(map(tuple, by_name.xy)) == sorted(point.pt for point in asked)
    with pytest.raises(InputError, match="expected its parameters"):
        find_detector("cv2:ORB")(marker_view(60), luck=3)


def test_settings_tell_defaults_and_refuse_others():
    assert settings_of("surf-paper", {"threshold": 7.0})["layers"] == 2
    assert settings_of("cv2:ORB", {"nfeatures": 3})["nfeatures"] == 3
    assert settings_of("sift", {})["threshold"] == 0.04
    with pytest.raises(InputError, match="luck"):
        settings_of("surf", {"luck": 1})


@pytest.fixture
def own(monkeypatch):
    """Return a module "own" to put a detector in."""
    module = types.ModuleType("own")
    monkeypatch.setitem(sys.modules, "own", module)
    return module


def test_a_users_function_may_return_our_key_points_or_opencvs(own):
    point, ones = cv2.KeyPoint(3.0, 4.0, 2.0), np.ones(1)
    own.ours = lambda gray: Keypoints([[3, 4]], ones, ones, ones, ones, ones, ones)
    own.theirs = lambda gray: [point]
    own.described = lambda gray: ([point], np.zeros((1, 5)))
    for name in ("own:ours", "own:theirs", "own:described"):
        found = find_detector(name)(np.zeros((9, 9), np.uint8))
        np.testing.assert_array_equal(found.xy, [[3, 4]])
        assert (found.descriptors is not None) == (name == "own:described")


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (7, "got int"),
        ("ab", "got str"),
        ([1, 2], "got list of int"),
        ([[1, 2], [3]], "got list of list"),
        (["ab", "cd"], "got list of str"),
        (np.zeros((4, 3)), r"got an array of float64 and shape \(4, 3\)"),
        (np.zeros((4, 2), complex), r"got an array of complex128 and shape \(4, 2\)"),
        ((np.zeros((2, 2)), np.zeros((2, 64))), "got tuple of ndarray"),
        (None, "got NoneType"),
    ],
)
def test_what_is_no_key_points_is_named(own, found, words):
    own.bad = lambda gray: found
    with pytest.raises(InputError, match=f"expected Keypoints, an .n, 2. array of points, .* {words}"):
        find_detector("own:bad")(np.zeros((9, 9), np.uint8))


@pytest.mark.parametrize("found", [((1, 2), (3, 4)), [[1, 2], [3, 4]], np.array([[1, 2], [3, 4]])])
def test_positions_alone_are_key_points(own, found):
    own.points = lambda gray: found
    keypoints = find_detector("own:points")(np.zeros((9, 9), np.uint8))
    np.testing.assert_array_equal(keypoints.xy, [[1, 2], [3, 4]])
    assert not keypoints.laplacian.any()
    assert (keypoints.angle == -1).all()


@pytest.mark.parametrize("name", ["cv2:SIFT", "cv2:ORB", "cv2:AKAZE"])
def test_class_ids_of_others_than_surf_are_no_polarity(name):
    found = find_detector(name)(marker_view(60))
    assert len(found) > 0
    assert not found.laplacian.any()


@pytest.mark.parametrize("name", ["", "surfing", "cv2:Nothing", "cv2:BFMatcher", "cv2:", "cv2:LDA", "numpy:pi"])
def test_unknown_detectors_are_refused(name):
    with pytest.raises(InputError, match=r"expected .* got "):
        find_detector(name)


@pytest.mark.parametrize("name", ["no_such_module:f", "numpy:no_such", ":f"])
def test_functions_that_cannot_be_imported_are_refused(name):
    with pytest.raises(InputError, match="cannot be imported"):
        find_detector(name)


def test_vlfeat_without_pycolmap_says_how_to_get_it(monkeypatch):
    assert "vlfeat" in NAMES
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    with pytest.raises(InputError, match=r"pip install 'peakmark\[vlfeat\]'"):
        find_detector("vlfeat")


def test_a_mistyped_parameter_gets_a_guess() -> None:
    with pytest.raises(
        InputError, match=r"surf: unknown parameter treshold \(did you mean 'threshold'\?\), expected some"
    ):
        settings_of("surf", {"treshold": 1.0})
