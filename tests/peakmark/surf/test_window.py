"""Windows and patches against the plain operators and against cv2.resize."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.parallel import threads
from peakmark.surf.window import PATCH_SIDE, average_window, cut_window, interleave_rows
from tests.peakmark.surf import reference
from tests.samples import speckled

GRAY = speckled(90, 120, 2)


@pytest.mark.parametrize("count", [1, 3])
def test_interleaved_rows(count: int) -> None:
    with threads(count):
        pairs = interleave_rows(GRAY)
    _, width = GRAY.shape
    np.testing.assert_array_equal(pairs[:, :width] & 255, GRAY)
    np.testing.assert_array_equal(pairs[:-1, :width] >> 8, GRAY[1:])
    np.testing.assert_array_equal(pairs[-1, :width] >> 8, GRAY[-1])


def off_ties(low: float, high: float, step: float) -> st.SearchStrategy[float]:
    """Return numbers apart from multiples of a step, where windows have positions half-way between two pixels."""
    return st.floats(low, high, width=32).filter(lambda value: abs(value / step - round(value / step)) > 0.01)


@settings(max_examples=100)
@given(x=off_ties(-20, 140, 0.25), y=off_ties(-20, 110, 0.25), angle=off_ties(0, 360, 15), side=st.integers(1, 150))
def test_rotated_windows_agree_with_the_plain_operator(x: float, y: float, angle: float, side: int) -> None:
    apart = np.abs(cut_window(GRAY, x, y, angle, side) - reference.rotated_window(GRAY, x, y, side, angle))
    # a position rounded to 2^-23 px flips the rounding of one sample in a million
    assert apart.max() <= 1
    assert (apart > 0).sum() <= 2


def test_a_window_far_outside_repeats_the_nearest_corner() -> None:
    assert (cut_window(GRAY, -1e5, 1e5, 33.0, 40) == GRAY[-1, 0]).all()


@given(x=st.floats(-20, 140, width=32), y=st.floats(-20, 110, width=32), side=st.integers(1, 60))
def test_upright_windows_are_rotated_by_270_degrees(x: float, y: float, side: int) -> None:
    window = cut_window(GRAY, x, y, 0.0, side, upright=True)
    columns = np.clip(np.rint(np.float32(x) - np.float32(side - 1) / 2) + np.arange(side), 0, 119).astype(int)
    rows = np.clip(np.rint(np.float32(y) + np.float32(side - 1) / 2) - np.arange(side), 0, 89).astype(int)
    np.testing.assert_array_equal(window, GRAY[np.ix_(rows, columns)].T)


@pytest.mark.parametrize("levels", [2, 256])
@pytest.mark.parametrize("side", [*range(1, 100), 105, 126, 150, 301, 640])
def test_averaging_is_opencvs_resize(side: int, levels: int) -> None:
    """Two levels make sums that end on half a grey level all the time."""
    window = (np.random.default_rng(side).integers(0, levels, (side, side)) * (255 // (levels - 1))).astype(np.uint8)
    expected = cv2.resize(window, (PATCH_SIDE, PATCH_SIDE), interpolation=cv2.INTER_AREA)
    found = average_window(window)
    if side >= PATCH_SIDE:
        np.testing.assert_array_equal(found, expected)
    else:  # OpenCV enlarges with weights of 11 bits
        np.testing.assert_allclose(found, expected, atol=1)


@pytest.mark.parametrize("side", [257, 258, 2901, 3000, 4200])
def test_sums_of_bright_large_windows_do_not_overflow(side: int) -> None:
    rng = np.random.default_rng(side)
    window = cv2.resize(rng.integers(200, 256, (50, 50)).astype(np.uint8), (side, side))
    expected = cv2.resize(window, (PATCH_SIDE, PATCH_SIDE), interpolation=cv2.INTER_AREA)
    np.testing.assert_array_equal(average_window(window), expected)


@given(side=st.integers(PATCH_SIDE, 90), seed=st.integers(0, 999))
def test_averaging_agrees_with_the_plain_operator(side: int, seed: int) -> None:
    window = np.random.default_rng(seed).integers(0, 256, (side, side)).astype(np.uint8)
    shares = reference.area_shares(side, PATCH_SIDE)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_allclose(average_window(window), shares @ window @ shares.T, atol=0.501)
    np.testing.assert_allclose(average_window(window), reference.averaged(window.astype(float), PATCH_SIDE), atol=1)
