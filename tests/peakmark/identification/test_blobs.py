"""Sums are those of a loop over pixels; a blob is a maximum of filters that are correlated with the image itself."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.identification.blobs import (
    DIAGONAL,
    ROUND,
    WIDE,
    Thirds,
    _tilted_sums,
    _upright_sums,
    best_response,
    blob_rows,
    box_filters,
    octave_count,
)
from peakmark.markers.optimum import quadratic_optimum
from peakmark.markers.patterns import DXY_WEIGHT, surf_filters, surf_form
from peakmark.parallel import threads

Levels = NDArray[np.float64]


def soft_noise(height: int, width: int, seed: int) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).normal(0, 60, (height, width)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 2.5)
    return np.clip(128 + 40 * soft / soft.std(), 0, 255).astype(np.uint8)


def painted(levels: Levels, is_tilted: bool) -> Levels:
    """Return a filter's cells (b, a) as pixels: tilted ones are two pixels each, one below the other, else 0."""
    if not is_tilted:
        return levels
    across, along = levels.shape
    pixels = np.zeros((across + along, across + along - 1))
    for (b, a), level in np.ndenumerate(levels):
        pixels[a + b : a + b + 2, a - b + across - 1] = level
    return pixels


def responses(gray: NDArray[np.uint8], thirds: Thirds, is_tilted: bool) -> tuple[Levels, Levels, Levels]:
    """Return the determinant at every whole position of a filter, and the x and y of its middle there."""
    cell = 2 if is_tilted else 1
    filters = [painted(each, is_tilted) / cell for each in box_filters(*thirds)]
    height, width = filters[0].shape
    xx, yy, xy = (
        cv2.filter2D(gray.astype(np.float64), -1, each, anchor=(0, 0))[: -height + 1, : -width + 1] for each in filters
    )
    rows, columns = np.indices(xx.shape)
    middle_x, middle_y = middle_of(thirds, is_tilted)
    return xx * yy - DXY_WEIGHT * xy**2, columns + middle_x, rows + middle_y


def middle_of(thirds: Thirds, is_tilted: bool) -> tuple[float, float]:
    """Return x and y of a filter's middle from its upper left pixel, see `painted`."""
    along, across = (3 * third for third in thirds)
    return ((along + across) / 2 - 1, (along + across) / 2 - 0.5) if is_tilted else ((along - 1) / 2, (across - 1) / 2)


def turned(family: tuple[Thirds, ...]) -> tuple[Thirds, ...]:
    return tuple((across, along) for along, across in family)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (6, 1), (2, 2), (13, 9), (8, 21)])
def test_sums_are_those_of_boxes_and_cones(height: int, width: int) -> None:
    gray = np.random.default_rng(height).integers(0, 256, (height, width), dtype=np.uint8)
    upright, tilted = np.empty((2, height + 1, width + 1), np.uint32), np.empty((2, height + 1, width + 1), np.uint32)
    _upright_sums(gray, *upright)
    _tilted_sums(gray, *tilted)
    y, x = np.indices(gray.shape)
    for row in range(height + 1):
        for column in range(width + 1):
            above = gray[:row, :column].astype(np.int64)
            assert upright[:, row, column].tolist() == [above.sum(), (above**2).sum()]
            cone = gray[(y < row) & (abs(x - column) <= row - 1 - y)].astype(np.int64)
            assert tilted[:, row, column].tolist() == [cone.sum(), (cone**2).sum()]


@pytest.mark.parametrize(("thirds", "is_tilted"), [(ROUND[1], False), (WIDE[2], False), (DIAGONAL[2], True)])
@pytest.mark.parametrize("is_turned", [False, True])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_filters_own_pattern_is_a_blob_of_quotient_one(
    thirds: Thirds, is_tilted: bool, is_turned: bool, sign: int
) -> None:
    own = thirds[::-1] if is_turned else thirds
    filters = box_filters(*own)
    pattern = quadratic_optimum(filters, surf_form(), "energy").x
    pattern = pattern * (sign * np.sign((filters[:2] * pattern).sum()) * 100 / np.abs(pattern).max())
    xx, yy, xy = (filters * pattern).sum(axis=(1, 2))
    canvas = np.zeros((120, 140))
    pixels = painted(pattern, is_tilted)
    canvas[40 : 40 + pixels.shape[0], 50 : 50 + pixels.shape[1]] = pixels
    rows = blob_rows(np.rint(128 + canvas).astype(np.uint8), 300.0, 0.1)
    best = rows[np.argmax(rows[:, 5])]
    x, y = middle_of(own, is_tilted)
    assert np.hypot(best[0] - 50 - x, best[1] - 40 - y) < 0.3
    assert best[2] == pytest.approx(3 * np.sqrt(own[0] * own[1] * (1 + is_tilted)), rel=0.12)
    assert best[3] == pytest.approx(xx * yy - DXY_WEIGHT * xy**2, rel=0.03)
    assert best[4] == sign
    assert 0.8 < best[5] < 1.1


@pytest.mark.parametrize("seed", [1, 2])
def test_blobs_are_maxima_of_filters_correlated_with_the_image(seed: int) -> None:
    gray, reach = soft_noise(90, 120, seed), 24
    rows = blob_rows(gray, 100.0, 0.05, (0,))
    rows = rows[((rows[:, :2] > reach) & (rows[:, :2] < np.array(gray.shape[::-1]) - reach)).all(axis=1)]
    is_peak = np.zeros(len(rows), bool)
    for family in (ROUND, WIDE, turned(WIDE), DIAGONAL, turned(DIAGONAL)):
        is_tilted = family in (DIAGONAL, turned(DIAGONAL))
        for thirds in family[1:-1]:
            values, x, y = responses(gray, thirds, is_tilted)
            peaks = values == cv2.dilate(values, np.ones((3, 3)))
            at = np.column_stack([x[peaks], y[peaks]])
            is_near = np.abs(at[:, None] - rows[:, :2]).max(axis=2) < 0.501
            is_peak |= (is_near & np.isclose(values[peaks][:, None], rows[:, 3], rtol=1e-5)).any(axis=0)
    assert len(rows) > 60
    assert is_peak.all()


def dotted(side: float, phases: NDArray[np.float64]) -> tuple[NDArray[np.uint8], Levels]:
    """Return an image of SURF's own pattern of a side, one for each phase (k, 2), and where their middles are."""
    pitch = round(1.6 * side)
    middles = np.column_stack([pitch * np.arange(1, len(phases) + 1), np.full(len(phases), pitch)]) + phases
    pattern = quadratic_optimum(surf_filters(27), surf_form(), "energy").x
    pattern = (128 + 100 * pattern / np.abs(pattern).max()).astype(np.float32)
    canvas = np.full((2 * pitch, (len(phases) + 1) * pitch), 128, np.float32)
    for x, y in middles:
        scale, from_px = side / len(pattern), -0.5 + 0.5 * side / len(pattern)
        matrix = np.array([[scale, 0, x - side / 2 + from_px], [0, scale, y - side / 2 + from_px]])
        cv2.warpAffine(pattern, matrix, canvas.shape[::-1], canvas, cv2.INTER_AREA, cv2.BORDER_TRANSPARENT)
    return np.rint(canvas).astype(np.uint8), middles


@pytest.mark.parametrize(
    "side", [14.5, 17, 20, 23.5, 26, 28, 29.5, 31, 32.5, 36, 42, 47.5, 54, 58, 61, 64, 72, 95.5, 118]
)
def test_no_size_falls_between_two_octaves(side: float) -> None:
    phases = np.random.default_rng(int(side)).uniform(-4, 4, (12, 2))
    gray, middles = dotted(side, phases)
    rows = blob_rows(gray, 300.0, 0.6)
    gaps = np.linalg.norm(middles[:, None] - rows[:, :2], axis=2)
    assert gaps.min(axis=1).max() < 0.1 * side


@pytest.mark.parametrize("thirds", [*ROUND, *WIDE, *DIAGONAL])
def test_filters_answer_neither_to_a_level_nor_to_a_slope(thirds: Thirds) -> None:
    filters = box_filters(*thirds)
    y, x = np.indices(filters[0].shape)
    for levels in (np.ones(x.shape), x, y):
        assert np.abs((filters * levels).sum(axis=(1, 2))).max() < 1e-9


def test_the_smallest_surf_filter_is_surfs() -> None:
    assert np.allclose(box_filters(3, 3), surf_filters(9))
    assert best_response(3, 3) == pytest.approx(19.08, abs=0.01)


def test_octaves_are_those_in_which_a_filter_fits() -> None:
    assert [octave_count((side, 999)) for side in (10, 15, 29, 30, 119, 120)] == [1, 1, 1, 2, 3, 4]


def test_blobs_do_not_depend_on_the_number_of_threads() -> None:
    gray = soft_noise(200, 160, 3)
    with threads(1):
        one = blob_rows(gray, 100.0, 0.1)
    with threads(3):
        assert np.array_equal(one, blob_rows(gray, 100.0, 0.1))


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (3, 3), (20, 20)])
def test_small_and_even_images_have_no_blobs(shape: tuple[int, int]) -> None:
    assert blob_rows(np.full(shape, 77, np.uint8), 100.0, 0.1).shape == (0, 6)


def test_more_blobs_than_room_are_all_returned() -> None:
    tile = cv2.GaussianBlur(np.pad(np.zeros((4, 4), np.float32), 4, constant_values=255), (0, 0), 1.5)
    gray = np.tile(tile, (12, 12)).astype(np.uint8)
    rows = blob_rows(gray, 100.0, 0.05)
    inner = [(12 * k + 5.5, 12 * m + 5.5) for k in range(1, 11) for m in range(1, 11)]
    gaps = np.linalg.norm(rows[rows[:, 4] > 0, None, :2] - inner, axis=2).min(axis=0)
    assert gaps.max() < 0.2
