"""Detectors by name, and what becomes of the user's own."""

from typing import Any

import cv2
import numpy as np
import pytest
from samples import assert_equal, speckled
from surf_parity import compare

from peakmark import surf
from peakmark.detectors import find_detector, has_opencv_surf, settings_of
from peakmark.errors import InputError

GRAY = speckled(200, 260, 5)

needs_opencv_surf = pytest.mark.skipif(not has_opencv_surf(), reason="this OpenCV was built without SURF")


def first_corner(image: np.ndarray, side: float = 9.0) -> list[cv2.KeyPoint]:
    return [cv2.KeyPoint(1.0, 2.0, side)]


def nonsense(image: np.ndarray) -> int:
    return 7


def test_surf_by_name_is_surf() -> None:
    assert_equal(find_detector("surf")(GRAY, threshold=50.0), surf.detect_and_describe(GRAY, threshold=50.0))
    assert_equal(find_detector("surf-paper")(GRAY), surf.detect_and_describe(GRAY, **surf.PAPER))


def test_sift_has_its_key_points_centred_and_strongest_first() -> None:
    y, x = np.mgrid[:129, :129]
    blob = np.uint8(255 * np.exp(-((x - 64) ** 2 + (y - 64) ** 2) / 128))
    found = find_detector("sift")(blob)
    np.testing.assert_allclose(found.xy[0], 64, atol=0.02)
    many = find_detector("sift")(GRAY, strongest=7)
    assert len(many) == 7
    assert (np.diff(many.response) <= 0).all()


@pytest.mark.skipif(has_opencv_surf(), reason="this OpenCV has SURF")
def test_without_opencvs_surf_one_line_says_so() -> None:
    with pytest.raises(InputError, match="built without SURF; surf gives the same key points"):
        find_detector("surf-opencv")


@needs_opencv_surf
@pytest.mark.parametrize(
    "parameters", [{}, {"extended": True, "upright": True}, {"strongest": 20}, {"mask": GRAY > 120}]
)
def test_opencvs_surf_takes_our_parameters_and_gives_the_same(parameters: dict[str, Any]) -> None:
    parity = compare(find_detector("surf-opencv")(GRAY, **parameters), surf.detect_and_describe(GRAY, **parameters))
    assert parity.theirs == parity.ours == len(parity.pairs)


def test_a_function_of_the_users_own() -> None:
    found = find_detector(f"{__name__}:first_corner")(GRAY, side=12.0)
    assert found.xy.tolist() == [[1, 2]]
    assert found.size.tolist() == [12]
    with pytest.raises(InputError, match=r"expected Keypoints, cv2\.KeyPoint objects.*got int"):
        find_detector(f"{__name__}:nonsense")(GRAY)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("surg", "expected one of surf, surf-paper, surf-opencv, sift or module:function, got 'surg'"),
        ("no_such_module:f", "cannot be imported"),
        ("math:pi", "expected a function, got float"),
    ],
)
def test_unknown_detectors_are_named(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        find_detector(name)


def test_settings_are_those_given_and_the_defaults() -> None:
    settings = settings_of("surf-paper", {"threshold": 7.0})
    assert (settings["threshold"], settings["octaves"], settings["layers"]) == (7.0, 4, 2)
    with pytest.raises(InputError, match=r"detector sift: .*octaves"):
        settings_of("sift", {"octaves": 3})
