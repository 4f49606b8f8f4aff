"""Windows and patches against the plain operators and against cv2.resize."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.parallel import threads
from peakmark.surf import window as surf_window
from peakmark.surf.window import PATCH_PITCH, PATCH_SIDE, interleave_rows
from tests.compiled import callable_part
from tests.peakmark.surf import reference
from tests.samples import speckled

make_buffers = callable_part(surf_window.make_buffers)
pitch_of = surf_window.pitch_of.py_func
sample_rotated = callable_part(surf_window.sample_rotated)
sample_upright = callable_part(surf_window.sample_upright)
average_areas = callable_part(surf_window.average_areas)
lies_inside = callable_part(surf_window.lies_inside)

GRAY = speckled(90, 120, 2)


def rotated(gray: np.ndarray, x: float, y: float, angle: float, side: int) -> np.ndarray:
    pairs, buffers = interleave_rows(gray), make_buffers(side)
    x, y, angle = np.float32(x), np.float32(y), np.float32(angle)
    sample_rotated(pairs.reshape(-1), pairs.shape[1], gray.shape, x, y, angle, side, buffers)
    return buffers.window[: side * pitch_of(side)].reshape(side, -1)[:, :side].copy()


def averaged(window: np.ndarray) -> np.ndarray:
    side = len(window)
    buffers = make_buffers(side)
    buffers.window[: side * pitch_of(side)].reshape(side, -1)[:, :side] = window
    average_areas(side, np.uint64(PATCH_PITCH), buffers)
    return buffers.patch.reshape(-1, PATCH_PITCH)[:PATCH_SIDE, :PATCH_SIDE].T.copy()


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
    apart = np.abs(rotated(GRAY, x, y, angle, side) - reference.rotated_window(GRAY, x, y, side, angle))
    # single precision flips a rounding now and then, or the nearest pixel of a position half-way between two outside
    assert (apart > 1).sum() <= max(1, 0.01 * apart.size)
    assert (apart > 0).sum() <= max(1, 0.03 * apart.size)


def test_a_window_far_outside_repeats_the_nearest_corner() -> None:
    assert (rotated(GRAY, -1e5, 1e5, 33.0, 40) == GRAY[-1, 0]).all()


@given(x=st.floats(-20, 140, width=32), y=st.floats(-20, 110, width=32), side=st.integers(1, 60))
def test_upright_windows_are_rotated_by_270_degrees(x: float, y: float, side: int) -> None:
    pairs, buffers = interleave_rows(GRAY), make_buffers(side)
    sample_upright(pairs.reshape(-1), pairs.shape[1], GRAY.shape, np.float32(x), np.float32(y), side, buffers)
    window = buffers.window[: side * pitch_of(side)].reshape(side, -1)[:, :side]
    columns = np.clip(np.rint(np.float32(x) - np.float32(side - 1) / 2) + np.arange(side), 0, 119).astype(int)
    rows = np.clip(np.rint(np.float32(y) + np.float32(side - 1) / 2) - np.arange(side), 0, 89).astype(int)
    np.testing.assert_array_equal(window, GRAY[np.ix_(rows, columns)].T)


@pytest.mark.parametrize("levels", [2, 256])
@pytest.mark.parametrize("side", [*range(1, 100), 105, 126, 150, 301, 640])
def test_averaging_is_opencvs_resize(side: int, levels: int) -> None:
    """Two levels make sums that end on half a grey level all the time."""
    window = (np.random.default_rng(side).integers(0, levels, (side, side)) * (255 // (levels - 1))).astype(np.uint8)
    expected = cv2.resize(window, (PATCH_SIDE, PATCH_SIDE), interpolation=cv2.INTER_AREA)
    found = averaged(window)
    if side >= PATCH_SIDE:
        np.testing.assert_array_equal(found, expected)
    else:  # OpenCV enlarges with weights of 11 bits
        np.testing.assert_allclose(found, expected, atol=1)


@given(side=st.integers(PATCH_SIDE, 90), seed=st.integers(0, 999))
def test_averaging_agrees_with_the_plain_operator(side: int, seed: int) -> None:
    window = np.random.default_rng(seed).integers(0, 256, (side, side)).astype(np.uint8)
    shares = reference.area_shares(side, PATCH_SIDE)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_allclose(averaged(window), shares @ window @ shares.T, atol=0.501)
    np.testing.assert_allclose(averaged(window), reference.averaged(window.astype(float), PATCH_SIDE), atol=1)


@given(
    x=st.floats(0, 200, width=32),
    y=st.floats(0, 150, width=32),
    side=st.integers(1, 70),
    rotation_deg=st.floats(0, 360, width=32),
)
def test_every_lane_of_a_window_inside_reads_the_image(x: float, y: float, side: int, rotation_deg: float) -> None:
    sine, cosine = -np.sin(np.radians(rotation_deg)), np.cos(np.radians(rotation_deg))
    if lies_inside(*map(np.float32, (x, y, sine, cosine)), side, (150, 200)):
        row, lane = (np.arange(n)[:, None] - (side - 1) / 2 for n in (side, pitch_of(side)))
        columns = x + lane.T * cosine + row * sine
        lines = y - lane.T * sine + row * cosine
        assert columns.min() >= 1
        assert lines.min() >= 1
        assert columns.max() < 198
        assert lines.max() < 148
    else:
        assert min(x, y, 200 - x, 150 - y) < 1.5 * (side + 18)
