"""Tags: found with their numbers at their corners, more precisely than without refinement; unknown ones are refused."""

import cv2
import numpy as np
import pytest

from peakmark.detectors.tags import Tag, crossing, tag_detector, tag_dictionary
from peakmark.errors import InputError

DICTIONARIES = ("DICT_4X4_50", "DICT_6X6_250", "DICT_APRILTAG_36h11")


@pytest.mark.parametrize("dictionary", DICTIONARIES)
@pytest.mark.parametrize("number", [0, 17, 49])
def test_a_tag_is_found_with_its_number_at_its_corners(dictionary: str, number: int) -> None:
    pattern = cv2.aruco.generateImageMarker(tag_dictionary(dictionary), number, 80)
    image = np.full((240, 320), 255, np.uint8)
    image[60:140, 100:180] = pattern
    (tag,) = tag_detector(dictionary)(cv2.GaussianBlur(image, None, 0.6))
    assert tag.id == number
    left, top, right, bottom = 99.5, 59.5, 179.5, 139.5
    np.testing.assert_allclose(tag.corners_xy, [[left, top], [right, top], [right, bottom], [left, bottom]], atol=0.2)
    np.testing.assert_allclose(tag.center_xy, [139.5, 99.5], atol=0.05)
    assert tag.side_px == pytest.approx(80, abs=0.4)


def test_an_image_without_tags_has_none() -> None:
    assert tag_detector("DICT_4X4_50")(np.full((100, 100), 255, np.uint8)) == []


def test_the_sub_pixel_corners_are_better_than_whole_pixels() -> None:
    """A tag of 40 px at random sub-pixel positions, drawn by supersampling."""
    pattern = cv2.aruco.generateImageMarker(tag_dictionary("DICT_APRILTAG_36h11"), 3, 640)
    rng, errors, plain_errors = np.random.default_rng(0), [], []
    for _ in range(10):
        shift = rng.integers(0, 16, 2)
        fine = np.full((1600, 1600), 255, np.uint8)
        fine[480 + shift[1] : 1120 + shift[1], 480 + shift[0] : 1120 + shift[0]] = pattern
        image = cv2.resize(fine, (100, 100), interpolation=cv2.INTER_AREA)
        truth = (np.array([[0, 0], [640, 0], [640, 640], [0, 640]]) + 480 + shift) / 16 - 0.5
        (tag,) = tag_detector("DICT_APRILTAG_36h11")(image)
        quads, _, _ = cv2.aruco.ArucoDetector(tag_dictionary("DICT_APRILTAG_36h11")).detectMarkers(image)
        errors.append(np.linalg.norm(tag.corners_xy - truth, axis=1))
        plain_errors.append(np.linalg.norm(quads[0].reshape(4, 2) - truth, axis=1))
    assert np.median(errors) < 0.15
    assert np.median(errors) < np.median(plain_errors) / 2


def test_diagonals_cross_at_the_centre_of_a_square_in_perspective() -> None:
    square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1], [0, 0, 1.0]])
    seen = square @ np.array([[30, 4, 100], [-3, 25, 80], [0.1, 0.2, 1.0]]).T
    seen = seen[:, :2] / seen[:, 2:]
    assert np.allclose(crossing(seen[:4]), seen[4])
    assert np.allclose(Tag(0, seen[:4]).center_xy, seen[4])


@pytest.mark.parametrize("name", ["4X4_50", "DICT_NONE", "ArucoDetector"])
def test_an_unknown_dictionary_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"expected a dictionary of cv2.aruco such as DICT_4X4_50, got '{name}'"):
        tag_detector(name)
