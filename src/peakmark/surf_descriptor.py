"""Kernels for SURF's descriptor: gradients of a turned window, summed in 4×4 cells."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf_orientation import gaussian
from peakmark.surf_window import PATCH_SIDE, average_areas, interleave_rows, sample_turned, sample_upright

GRADIENTS = PATCH_SIDE - 1
"""Gradients a side: differences of neighbouring patch pixels."""
CELL_SIGMA = 3.3

U = np.uint64
_WEIGHTS = np.outer(gaussian(GRADIENTS, CELL_SIGMA), gaussian(GRADIENTS, CELL_SIGMA))


def window_side(size: NDArray[np.float32]) -> NDArray[np.int32]:
    """Side of the described window, px: trunc(21 s) with s = 1.2 size / 9, in single precision."""
    s = size.astype(np.float32) * np.float32(1.2) / np.float32(9.0)
    return (np.float32(PATCH_SIDE) * s).astype(np.int32)


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
    pairs = interleave_rows(gray)
    rows = np.argsort(xy[:, 1])  # neighbours in the image share its cache lines

    def describe(cut: tuple[int, int]) -> None:
        part = rows[slice(*cut)]
        _describe(pairs, gray.shape, part, xy, window_side(size), angle, extended, upright, _WEIGHTS, descriptors)

    map_parallel(describe, bands(len(size), 8 * thread_count()))
    return descriptors


@njit(cache=True, nogil=True)
def _describe(pairs, shape, rows, xy, sides, angle, extended, upright, weights, descriptors):  # type: ignore[no-untyped-def]
    largest = 1
    for k in rows:
        largest = max(largest, sides[k])
    pitch = (largest + 31) // 32 * 32
    window = np.empty(largest * pitch, dtype=np.uint8)
    patch = np.empty((PATCH_SIDE, PATCH_SIDE), dtype=np.int32)
    sums = np.empty((8, GRADIENTS), dtype=np.float32)
    for k in rows:
        side = sides[k]
        pitch = (side + 31) // 32 * 32
        if upright:
            sample_upright(pairs, shape, xy[k, 0], xy[k, 1], side, pitch, window)
        else:
            sample_turned(pairs, shape, xy[k, 0], xy[k, 1], angle[k], side, pitch, window)
        average_areas(window, side, pitch, patch)
        if extended:
            _sum_by_sign(patch, weights, sums, descriptors[k])
        else:
            _sum_gradients(patch, weights, sums, descriptors[k])
        _normalise(descriptors[k])


@njit(cache=True, nogil=True)
def _gradient(patch, weights, i, j):  # type: ignore[no-untyped-def]
    """Weighted 2×2 gradient between patch pixels (i, j) and (i + 1, j + 1)."""
    a, b, c, d = patch[i, j], patch[i, j + 1], patch[i + 1, j], patch[i + 1, j + 1]
    return np.float32(b - a + d - c) * weights[i, j], np.float32(c - a + d - b) * weights[i, j]


@njit(cache=True, nogil=True)
def _sum_gradients(patch, weights, sums, descriptor):  # type: ignore[no-untyped-def]
    """Σdx, Σdy, Σ|dx|, Σ|dy| of each cell."""
    for row in range(4):
        sums[:4] = 0
        for i in range(5 * row, 5 * row + 5):
            for j in range(GRADIENTS):
                dx, dy = _gradient(patch, weights, i, j)
                sums[0, j] += dx
                sums[1, j] += dy
                sums[2, j] += abs(dx)
                sums[3, j] += abs(dy)
        _fold(sums, 4, descriptor[16 * row : 16 * row + 16])


@njit(cache=True, nogil=True)
def _sum_by_sign(patch, weights, sums, descriptor):  # type: ignore[no-untyped-def]
    """Σdx and Σ|dx| where dy ≥ 0, then where dy < 0; Σdy and Σ|dy| where dx ≥ 0, then where dx < 0; of each cell."""
    zero = np.float32(0.0)
    for row in range(4):
        sums[:] = 0
        for i in range(5 * row, 5 * row + 5):
            for j in range(GRADIENTS):
                dx, dy = _gradient(patch, weights, i, j)
                down, right = dy >= 0, dx >= 0
                sums[0, j] += dx if down else zero
                sums[1, j] += abs(dx) if down else zero
                sums[2, j] += zero if down else dx
                sums[3, j] += zero if down else abs(dx)
                sums[4, j] += dy if right else zero
                sums[5, j] += abs(dy) if right else zero
                sums[6, j] += zero if right else dy
                sums[7, j] += zero if right else abs(dy)
        _fold(sums, 8, descriptor[32 * row : 32 * row + 32])


@njit(cache=True, nogil=True)
def _fold(sums, entries, descriptor):  # type: ignore[no-untyped-def]
    """Add the five columns of each of a row's four cells."""
    for cell in range(4):
        for entry in range(entries):
            total = np.float32(0.0)
            for j in range(5 * cell, 5 * cell + 5):
                total += sums[entry, j]
            descriptor[cell * entries + entry] = total


@njit(cache=True, nogil=True)
def _normalise(descriptor):  # type: ignore[no-untyped-def]
    """Scale to unit length; zeros stay."""
    energy = np.float64(0.0)
    for value in descriptor:
        energy += value * value
    scale = np.float32(1.0 / (np.sqrt(energy) + np.float64(np.float32(1.1920929e-07))))
    for k in range(descriptor.size):
        descriptor[k] *= scale
