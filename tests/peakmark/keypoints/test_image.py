"""Images of every accepted kind, and those that are refused."""

import cv2
import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray

RNG = np.random.default_rng(3)
GRAY = RNG.integers(0, 256, (7, 9), dtype=np.uint8)
RGB = RNG.integers(0, 256, (7, 9, 3), dtype=np.uint8)


def test_grey_passes_through() -> None:
    np.testing.assert_array_equal(as_gray(GRAY), GRAY)
    np.testing.assert_array_equal(as_gray(GRAY[..., None]), GRAY)
    np.testing.assert_array_equal(as_gray(GRAY[::-1, ::2]), GRAY[::-1, ::2])
    assert as_gray(GRAY.T).flags.c_contiguous


def test_colour_is_rgb_as_opencv_weighs_it() -> None:
    expected = cv2.cvtColor(RGB, cv2.COLOR_RGB2GRAY)
    np.testing.assert_array_equal(as_gray(RGB), expected)
    np.testing.assert_array_equal(as_gray(np.dstack([RGB, GRAY])), expected)
    red = np.zeros((1, 1, 3), np.uint8)
    red[..., 0] = 255
    assert as_gray(red) == 76  # 0.299 · 255, not the 29 that BGR would give


def test_sixteen_bits_and_floats_span_the_same_range() -> None:
    np.testing.assert_array_equal(as_gray(GRAY.astype(np.uint16) * 257), GRAY)
    np.testing.assert_array_equal(as_gray(GRAY.astype(np.float64) / 255), GRAY)
    np.testing.assert_array_equal(as_gray(RGB.astype(np.float32) / 255), as_gray(RGB))
    assert as_gray(np.array([[128, 129, 65535]], np.uint16)).tolist() == [[0, 1, 255]]
    assert as_gray(np.array([[0.0, 0.5 / 255, 1.0]])).tolist() == [[0, 0, 255]]


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((3,), np.uint8), ["shape", "(3,)"]),
        (np.zeros((3, 4, 2), np.uint8), ["shape", "(3, 4, 2)"]),
        (np.zeros((2, 3, 4, 3), np.uint8), ["shape", "(2, 3, 4, 3)"]),
        (np.zeros((0, 5), np.uint8), ["at least 1", "(0, 5)"]),
        (np.zeros((3, 4), np.int32), ["dtype", "int32"]),
        (np.zeros((3, 4), np.bool_), ["dtype", "bool"]),
        (np.zeros((3, 4), np.complex64), ["dtype", "complex64"]),
        (np.full((3, 4), np.nan), ["0…1", "nan"]),
        (np.full((3, 4), np.inf), ["0…1", "inf"]),
        (np.full((3, 4), -0.1), ["0…1", "-0.1"]),
        (np.full((3, 4), 200.0), ["0…1", "200"]),
        ("gravel.png", ["shape"]),
    ],
)
def test_others_are_one_line_that_says_what_was_expected(image: object, words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        as_gray(image)  # type: ignore[arg-type]
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in ["expected", *words])
