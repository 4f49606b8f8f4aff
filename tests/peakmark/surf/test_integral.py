"""Integral images against cumulative sums and brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.parallel import threads
from peakmark.surf.integral import integral_image, padded_integral, padded_length
from tests.peakmark.surf import reference


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_kernel_agrees_with_the_plain_operator(height: int, width: int, count: int, seed: int) -> None:
    gray = np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
    with threads(count):
        np.testing.assert_array_equal(integral_image(gray), reference.integral_image(gray))


@given(st.data())
def test_any_box_is_four_corners(data: st.DataObject) -> None:
    gray = np.random.default_rng(data.draw(st.integers(0, 99))).integers(0, 256, (23, 31), dtype=np.uint8)
    y0, y1 = sorted((data.draw(st.integers(0, 23)), data.draw(st.integers(0, 23))))
    x0, x1 = sorted((data.draw(st.integers(0, 31)), data.draw(st.integers(0, 31))))
    sums = integral_image(gray)
    assert sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0] == gray[y0:y1, x0:x1].sum()


def test_views_of_any_strides() -> None:
    gray = np.random.default_rng(0).integers(0, 256, (40, 60), dtype=np.uint8)
    for view in (gray[::2, ::3], gray[::-1], gray.T, gray[5:6, 7:8]):
        np.testing.assert_array_equal(integral_image(view), reference.integral_image(view))


def test_boxes_are_exact_where_the_sums_wrap() -> None:
    gray = np.full((3000, 3000), 255, dtype=np.uint8)  # sums to 2.3e9 > 2^31
    sums = integral_image(gray)
    assert sums[-1, -1] < 0
    box = sums[2990:, 2950:] - sums[2900:-90, 2950:] - sums[2990:, 2900:-50] + sums[2900:-90, 2900:-50]
    np.testing.assert_array_equal(box, 90 * 50 * 255)


@pytest.mark.parametrize("itemsize", [2, 4])
@given(length=st.integers(1, 5000))
def test_padded_rows_are_an_odd_number_of_cache_lines(itemsize: int, length: int) -> None:
    padded = padded_length(length, itemsize)
    assert padded >= length
    assert padded * itemsize % 128 == 64
    assert padded - length < 128 // itemsize


def test_padding_lies_behind_the_rows() -> None:
    gray = np.random.default_rng(0).integers(0, 256, (5, 64), dtype=np.uint8)
    padded = padded_integral(gray)
    assert padded.flags.c_contiguous
    assert padded.shape == (6, padded_length(65, 4))
    np.testing.assert_array_equal(padded[:, :65], integral_image(gray))
