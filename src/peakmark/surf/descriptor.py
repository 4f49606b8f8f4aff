"""Kernels for SURF's descriptor: gradients of a rotated window, summed in 4×4 cells."""

import numpy as np
from numpy.typing import NDArray
from peaksim.kernel import kernel, part

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.orientation import gaussian
from peakmark.surf.window import (
    PATCH_PITCH,
    PATCH_SIDE,
    average_areas,
    interleave_rows,
    make_buffers,
    sample_rotated,
    sample_upright,
)

GRADIENTS = PATCH_SIDE - 1
"""Gradients a side: differences of neighbouring patch pixels."""
CELL_SIGMA = 3.3
"""Standard deviation of the Gaussian window over the patch, in gradients; OpenCV's."""

U = np.uint64
_WEIGHTS = np.zeros((GRADIENTS, PATCH_PITCH), dtype=np.float32)
_WEIGHTS[:, :GRADIENTS] = np.outer(gaussian(GRADIENTS, CELL_SIGMA), gaussian(GRADIENTS, CELL_SIGMA))


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
    upright : do not rotate the window, whatever the angle.
    """
    descriptors = np.empty((len(size), 128 if extended else 64), dtype=np.float32)
    pairs = interleave_rows(gray)
    rows = np.argsort(xy[:, 1])  # neighbours in the image share its cache lines

    def describe(cut: tuple[int, int]) -> None:
        chosen = rows[slice(*cut)]
        _describe(pairs, gray.shape, chosen, xy, window_side(size), angle, extended, upright, _WEIGHTS, descriptors)

    map_parallel(describe, bands(len(size), 8 * thread_count()))
    return descriptors


@kernel
def _describe(pairs, shape, rows, xy, sides, angle, extended, upright, weights, descriptors):
    largest = np.int64(1)
    for k in rows:
        largest = max(largest, sides[k])
    buffers = make_buffers(largest)
    lanes = U(weights.shape[1])
    flat_pairs, flat_weights = pairs.reshape(-1), weights.reshape(-1)
    sums = np.empty(8 * PATCH_PITCH, dtype=np.float32)
    entries = 8 if extended else 4
    for k in rows:
        if upright:
            sample_upright(flat_pairs, pairs.shape[1], shape, xy[k, 0], xy[k, 1], sides[k], buffers)
        else:
            sample_rotated(flat_pairs, pairs.shape[1], shape, xy[k, 0], xy[k, 1], angle[k], sides[k], buffers)
        average_areas(sides[k], lanes, buffers)
        for column in range(4):
            sums[:] = 0
            for j in range(5 * column, 5 * column + 5):
                if extended:
                    _add_by_sign(buffers.patch, U(j * PATCH_PITCH), flat_weights, sums, lanes)
                else:
                    _add_gradients(buffers.patch, U(j * PATCH_PITCH), flat_weights, sums, lanes)
            _fold(sums, entries, column, descriptors, k)
        _normalise(descriptors, k)


@part
def _gradient(patch, at, weight):
    """Weighted 2×2 gradient between a patch pixel and the one right of and below it."""
    below, right = at + U(1), at + U(PATCH_PITCH)
    a, b, c, d = patch[at], patch[right], patch[below], patch[right + U(1)]
    return np.float32(np.int32(b - a + d - c)) * weight, np.float32(np.int32(c - a + d - b)) * weight


@part
def _add_gradients(patch, first, weights, sums, n):
    """Add dx, dy, |dx| and |dy| of a patch column to the sums of its rows."""
    for i in range(n):
        dx, dy = _gradient(patch, first + i, weights[first + i])
        sums[i] += dx
        sums[i + U(PATCH_PITCH)] += dy
        sums[i + U(2 * PATCH_PITCH)] += abs(dx)
        sums[i + U(3 * PATCH_PITCH)] += abs(dy)


@part
def _add_by_sign(patch, first, weights, sums, n):
    """Add dx and |dx| where dy ≥ 0, then where dy < 0; dy and |dy| where dx ≥ 0, then where dx < 0."""
    zero = np.float32(0.0)
    for i in range(n):
        dx, dy = _gradient(patch, first + i, weights[first + i])
        down, right = dy >= 0, dx >= 0
        sums[i] += dx if down else zero
        sums[i + U(PATCH_PITCH)] += abs(dx) if down else zero
        sums[i + U(2 * PATCH_PITCH)] += zero if down else dx
        sums[i + U(3 * PATCH_PITCH)] += zero if down else abs(dx)
        sums[i + U(4 * PATCH_PITCH)] += dy if right else zero
        sums[i + U(5 * PATCH_PITCH)] += abs(dy) if right else zero
        sums[i + U(6 * PATCH_PITCH)] += zero if right else dy
        sums[i + U(7 * PATCH_PITCH)] += zero if right else abs(dy)


@part
def _fold(sums, entries, column, descriptors, k):
    """Add the five rows of each of a column's four cells; a descriptor has the cells row by row."""
    for row in range(4):
        for entry in range(entries):
            at = U(entry * PATCH_PITCH + 5 * row)
            total = sums[at] + sums[at + U(1)] + sums[at + U(2)] + sums[at + U(3)] + sums[at + U(4)]
            descriptors[k, (4 * row + column) * entries + entry] = total


@part
def _normalise(descriptors, k):
    """Scale descriptor k to unit length; zeros stay."""
    energy = np.float64(0.0)
    for entry in range(descriptors.shape[1]):
        energy += descriptors[k, entry] * descriptors[k, entry]
    scale = np.float32(1.0 / (np.sqrt(energy) + np.float64(np.float32(1.1920929e-07))))
    for entry in range(descriptors.shape[1]):
        descriptors[k, entry] *= scale
