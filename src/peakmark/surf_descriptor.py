"""Kernel for SURF's descriptor: gradients of a turned window, summed in 4×4 cells."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf_orientation import gaussian

PATCH = 20
"""The window is averaged down to PATCH + 1 pixels a side, which gives PATCH gradients a side."""
CELL_SIGMA = 3.3

_GRADIENT_WEIGHTS = np.outer(gaussian(PATCH, CELL_SIGMA), gaussian(PATCH, CELL_SIGMA))


def window_side(size: NDArray[np.float32]) -> NDArray[np.int32]:
    """Side of the described window, px: trunc(21 s) with s = 1.2 size / 9, in single precision."""
    s = size.astype(np.float32) * np.float32(1.2) / np.float32(9.0)
    return (np.float32(PATCH + 1) * s).astype(np.int32)


def describe_windows(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float32],
    size: NDArray[np.float32],
    angle: NDArray[np.float32],
    extended: bool,
    upright: bool,
) -> NDArray[np.float32]:
    """Descriptors (n, 64 or 128), each of unit length or all zero.

    Parameters
    ----------
    gray : (H, W) contiguous uint8 image.
    xy, size, angle : (n, 2), (n,), (n,) float32; px, px, degrees.
    extended : 128 entries, split by the gradients' signs.
    upright : do not turn the window, whatever the angle.
    """
    descriptors = np.empty((len(size), 128 if extended else 64), dtype=np.float32)
    cuts = bands(len(size), 4 * thread_count())

    def describe(cut: tuple[int, int]) -> None:
        part = slice(*cut)
        _describe(
            gray, xy[part], size[part], angle[part], window_side(size[part]), extended, upright, _GRADIENT_WEIGHTS,
            descriptors[part],
        )  # fmt: skip

    map_parallel(describe, cuts)
    return descriptors


@njit(cache=True, nogil=True)
def _describe(gray, xy, size, angle, sides, extended, upright, weights, descriptors):  # type: ignore[no-untyped-def]
    largest = 1
    for side in sides:
        largest = max(largest, side)
    window = np.empty(largest * largest, dtype=np.uint8)
    sums = np.empty(largest, dtype=np.int64)
    patch = np.empty((PATCH + 1, PATCH + 1), dtype=np.int32)
    for k in range(len(size)):
        side = sides[k]
        pixels = window[: side * side].reshape(side, side)
        if upright:
            _upright_window(gray, xy[k, 0], xy[k, 1], pixels)
        else:
            _turned_window(gray, xy[k, 0], xy[k, 1], angle[k], pixels)
        if side < PATCH + 1:
            _enlarge(pixels, patch)
        else:
            _average_areas(pixels, sums, patch)
        _sum_gradients(patch, weights, extended, descriptors[k])


@njit(cache=True, nogil=True)
def _turned_window(gray, x, y, angle_deg, window):  # type: ignore[no-untyped-def]
    """Sample a window turned by the angle, bilinearly, rounded to 8 bits; nearest border pixel outside the image."""
    side = len(window)
    angle = angle_deg * np.float32(np.pi / 180)
    sine, cosine = np.float32(-np.sin(angle)), np.float32(np.cos(angle))
    reach = -np.float32(side - 1) / np.float32(2.0)
    start_x = x + reach * cosine + reach * sine
    start_y = y - reach * sine + reach * cosine
    last_column, last_row = gray.shape[1] - 1, gray.shape[0] - 1
    for i in range(side):
        column, row = np.float64(start_x), np.float64(start_y)
        for j in range(side):
            left, top = np.int64(np.floor(column)), np.int64(np.floor(row))
            if 0 <= left < last_column and 0 <= top < last_row:
                a, b = np.float32(column - left), np.float32(row - top)
                one = np.float32(1.0)
                value = (
                    gray[top, left] * (one - a) * (one - b)
                    + gray[top, left + 1] * a * (one - b)
                    + gray[top + 1, left] * (one - a) * b
                    + gray[top + 1, left + 1] * a * b
                )
                window[i, j] = np.uint8(np.rint(value))
            else:
                nearest_column = min(max(np.int64(np.rint(column)), 0), last_column)
                nearest_row = min(max(np.int64(np.rint(row)), 0), last_row)
                window[i, j] = gray[nearest_row, nearest_column]
            column += cosine
            row -= sine
        start_x += sine
        start_y += cosine


@njit(cache=True, nogil=True)
def _upright_window(gray, x, y, window):  # type: ignore[no-untyped-def]
    """Copy a window turned by 270°, to whole pixels; nearest border pixel outside the image."""
    side = len(window)
    reach = -np.float32(side - 1) / np.float32(2.0)
    first_column = np.int64(np.rint(x + reach))
    last_row = np.int64(np.rint(y - reach))
    for i in range(side):
        column = min(max(first_column + i, 0), gray.shape[1] - 1)
        for j in range(side):
            row = min(max(last_row - j, 0), gray.shape[0] - 1)
            window[i, j] = gray[row, column]


@njit(cache=True, nogil=True)
def _average_areas(window, sums, patch):  # type: ignore[no-untyped-def]
    """Average the window's pixels by area onto the patch, rounded: OpenCV's INTER_AREA, in exact integers.

    Lengths are counted in 1 / n of a pixel, so that pixels are n units and patch cells `side` units wide.
    """
    side, n = len(window), len(patch)
    area = side * side
    for i in range(n):
        first_row, row_end = i * side // n, ((i + 1) * side + n - 1) // n
        sums[:side] = 0
        for y in range(first_row, row_end):
            weight = min((i + 1) * side, (y + 1) * n) - max(i * side, y * n)
            for x in range(side):
                sums[x] += weight * window[y, x]
        for j in range(n):
            total = np.int64(0)
            for x in range(j * side // n, ((j + 1) * side + n - 1) // n):
                total += sums[x] * (min((j + 1) * side, (x + 1) * n) - max(j * side, x * n))
            patch[i, j] = np.int32((total + 2 * 441) // (4 * 441)) if side == 2 * n else np.int32(np.rint(total / area))


@njit(cache=True, nogil=True)
def _enlarge(window, patch):  # type: ignore[no-untyped-def]
    """OpenCV's INTER_AREA where the window is smaller than the patch: linear between neighbouring pixels."""
    side, n = len(window), len(patch)
    for i in range(n):
        y, b = _source_of(i, side, n)
        for j in range(n):
            x, a = _source_of(j, side, n)
            top = (1 - a) * window[y, x] + a * window[y, min(x + 1, side - 1)]
            y1 = min(y + 1, side - 1)
            bottom = (1 - a) * window[y1, x] + a * window[y1, min(x + 1, side - 1)]
            patch[i, j] = np.int32(np.rint((1 - b) * top + b * bottom))


@njit(cache=True, nogil=True)
def _source_of(i, side, n):  # type: ignore[no-untyped-def]
    """First pixel under patch cell i, and the share of the next."""
    y = i * side // n
    share = (i + 1) - (y + 1) * n / side
    return y, max(share, 0.0)


@njit(cache=True, nogil=True)
def _sum_gradients(patch, weights, extended, descriptor):  # type: ignore[no-untyped-def]
    """Weighted 2×2 gradients of the patch, summed over 4×4 cells and scaled to unit length."""
    descriptor[:] = 0
    entries = 8 if extended else 4
    for i in range(PATCH):
        for j in range(PATCH):
            a, b, c, d = patch[i, j], patch[i, j + 1], patch[i + 1, j], patch[i + 1, j + 1]
            dx = np.float32(b - a + d - c) * weights[i, j]
            dy = np.float32(c - a + d - b) * weights[i, j]
            cell = (i // 5 * 4 + j // 5) * entries
            if extended:
                at = cell if dy >= 0 else cell + 2
                descriptor[at] += dx
                descriptor[at + 1] += abs(dx)
                at = cell + 4 if dx >= 0 else cell + 6
                descriptor[at] += dy
                descriptor[at + 1] += abs(dy)
            else:
                descriptor[cell] += dx
                descriptor[cell + 1] += dy
                descriptor[cell + 2] += abs(dx)
                descriptor[cell + 3] += abs(dy)
    energy = np.float64(0.0)
    for value in descriptor:
        energy += value * value
    scale = np.float32(1.0 / (np.sqrt(energy) + np.float64(np.float32(1.1920929e-07))))
    for k in range(descriptor.size):
        descriptor[k] *= scale
