"""Kernel that finds SURF's interest points: responses, threshold and 3×3×3 maxima fused, row by row.

No response layer is stored. Of each searched layer of an octave three grid rows stay in cache, and a row is searched
as soon as the row below it is known. The lowest and the highest layer of an octave only serve as neighbours; they are
computed where a candidate asks for them. Every candidate is settled in OpenCV's own arithmetic (`exact`), so
that key points, responses and their order are OpenCV's.

Rows are named by their start in flat arrays, as unsigned integers: that spares the reference counts of slices and the
test for negative indices, and lets the inner loops use vectors.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.kernel import contracting_part, kernel, part

from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import DXY_WEIGHT
from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.exact import (
    exact_derivatives,
    fill_layer,
    mask_accepts,
    newton_offset,
    quick_response,
    strongest_neighbour,
    write_record,
)
from peakmark.surf.layers import Layer

RECORD_FIELDS = ("x", "y", "scale", "size", "response", "octave", "laplacian")
"""Columns of the (n, 7) float32 records that the kernel returns."""

U = np.uint64
_BANDS_PER_THREAD = 4
"""Bands of rows that a thread gets in the first octave, so that threads end together."""
BLOCK_COLUMNS = 1024
"""Columns of a block, so that a searched layer's three rows stay in the first cache (`benchmarks/stages.py`)."""
_DXY = np.float32(DXY_WEIGHT)
_SLACK = np.float32(2.0**-12)
"""Quick responses are off by less than this share of |Dxx Dyy| + Dxy²."""


class Block(NamedTuple):
    """Part of an octave's grid, half-open, in which one task looks for maxima."""

    octave: int
    layers: int
    rows: int
    """Rows of the whole grid."""
    columns: int
    """Columns of the whole grid."""
    top: int
    bottom: int
    left: int
    right: int


def find_interest_points(
    integral: NDArray[np.int32],
    shape: tuple[int, int],
    threshold: float,
    octaves: int,
    layers: int,
    mask_integral: NDArray[np.int32] | None,
) -> NDArray[np.float32]:
    """All interest points as (n, 7) records (`RECORD_FIELDS`), in no particular order.

    Parameters
    ----------
    integral : (H + 1, at least W + 1) contiguous int32 array, see `padded_integral`.
    shape : (H, W) of the image, px.
    threshold : a response must be larger, (grey levels)².
    octaves, layers : as in `stages.hessian_responses`.
    mask_integral : the same for the mask as zeros and ones; None accepts every position.
    """
    mask = np.zeros((0, 0), dtype=np.int32) if mask_integral is None else mask_integral
    blocks = [block for octave in range(octaves) for block in grid_blocks(shape, octave, layers)]
    found = map_parallel(lambda block: _find_in_block(integral, mask, np.float32(threshold), block), blocks)
    return np.concatenate([np.zeros((0, len(RECORD_FIELDS)), dtype=np.float32), *found])


def strongest_first(records: NDArray[np.float32]) -> NDArray[np.intp]:
    """Row order of OpenCV: response falling, then size falling, octave falling, y falling, x rising."""
    x, y, _, size, response, octave, _ = records.T
    order = np.argsort(-response)
    ranked = response[order]
    equal = np.zeros(len(ranked) + 1, dtype=bool)
    equal[1:-1] = ranked[1:] == ranked[:-1]
    ties = equal[:-1] | equal[1:]
    tied = order[ties]
    order[ties] = tied[np.lexsort((x[tied], -y[tied], -octave[tied], -size[tied], -response[tied]))]
    return order


def to_keypoints(records: NDArray[np.float32], angles: NDArray[np.float32] | np.float32) -> Keypoints:
    """Return records as key points of these angles, degrees."""
    return Keypoints(
        xy=records[:, :2].copy(),
        size=records[:, 3].copy(),
        angle=np.broadcast_to(angles, len(records)).copy(),
        response=records[:, 4].copy(),
        octave=records[:, 5].astype(np.int32),
        laplacian=records[:, 6].astype(np.int8),
        scale=records[:, 2].copy(),
    )


def grid_blocks(shape: tuple[int, int], octave: int, layers: int) -> list[Block]:
    """Blocks that tile the searched positions of an octave, sized for the cache and cut for the threads."""
    rows, columns = (length >> octave for length in shape)
    margin = Layer(octave, 1).margin
    height, width = rows - 2 * margin, columns - 2 * margin
    if height <= 0 or width <= 0:
        return []
    row_cuts = max(1, (thread_count() * _BANDS_PER_THREAD) >> octave)
    return [
        Block(octave, layers, rows, columns, margin + top, margin + bottom, margin + left, margin + right)
        for top, bottom in bands(height, row_cuts)
        for left, right in bands(width, -(-width // BLOCK_COLUMNS))
    ]


@kernel
def _find_in_block(integral, mask_integral, threshold, block):
    """Records of the maxima in a block.

    Column k of the ring is grid column left − 1 + k; its rows are layer 1's last three grid rows, then layer 2's, …
    """
    sums, mask, stride = integral.reshape(-1), mask_integral.reshape(-1), integral.shape[1]
    width = block.right - block.left + 2
    ring = np.zeros(3 * block.layers * width, dtype=np.float32)
    highest = np.zeros((block.layers + 1) * width, dtype=np.float32)
    flags = np.zeros((width + 7) // 8 * 8, dtype=np.uint8)
    words = flags.view(np.uint64)
    scratch = np.zeros(8 * ((width + 6 * block.layers + 11) << block.octave), dtype=np.int32)
    cube = np.empty((3, 3, 3), dtype=np.float32)
    records, count = np.empty((256, 7), dtype=np.float32), np.int64(0)
    for i in range(block.top - 1, block.bottom + 1):
        _respond(sums, stride, block, i, scratch, ring, width)
        if i <= block.top:
            continue
        _raise_to_neighbours(ring, block.layers, width, highest)
        for index in range(1, block.layers + 1):
            first, n = _flag_row(ring, highest, block, index, i - 1, threshold, width, flags)
            for word in range((n + 7) // 8):
                if words[word] == 0:
                    continue
                for k in range(8 * word, min(8 * word + 8, n)):
                    if flags[k]:
                        if count == len(records):
                            records = _grown(records)
                        j = first + k
                        _cut_cube(ring, block, index, i - 1, j, width, cube)
                        count = _settle(sums, stride, mask, threshold, block, index, i - 1, j, cube, records, count)
    return records[:count].copy()


@part
def _respond(sums, stride, block, i, scratch, ring, width):
    """Compute grid row i of every searched layer that has one, with one column more on each side of the block."""
    for index in range(1, block.layers + 1):
        offset = 4 + 3 * index
        first, end = max(block.left - 1, offset), min(block.right + 1, block.columns - offset)
        if offset <= i < block.rows - offset and first < end:
            corner = ((i - offset) * stride + first - offset) << block.octave
            target = ((index - 1) * 3 + i % 3) * width + first - block.left + 1
            _response_row(sums, stride, corner, index, block.octave, scratch, ring, target, end - first)


@part
def _response_row(sums, stride, corner, index, octave, scratch, out, target, n):
    """Determinants of n filters of one layer, the first with its corner at sums[corner], a step apart."""
    step = 1 << octave
    side = (9 + 6 * index) << octave
    third, near, low = side // 3, (2 * side + 9) // 18, (4 * side + 9) // 18
    length = len(scratch) // 8
    _difference_rows(sums, stride, corner, side, U((n - 1) * step + side + 1), scratch, length)
    xx = 0
    yy_low = yy_high = length
    xy_near = xy_far = 2 * length
    if octave:
        m = n + side // step
        xx = _every(scratch, np.int64(0), step, 3 * length, m)
        yy_low, yy_high = _both_phases(scratch, length, low % step, step, 4 * length, length, m)
        xy_near, xy_far = _both_phases(scratch, 2 * length, near % step, step, 6 * length, length, m)
    mean, mixed_mean = 1.0 / (third * (side - 2 * low)), 1.0 / (third * third)
    _determinants(
        scratch,
        U(xx),
        U(xx + third // step),
        U(xx + 2 * third // step),
        U(xx + side // step),
        U(yy_low + low // step),
        U(yy_high + (side - low) // step),
        U(xy_near + near // step),
        U(xy_near + (near + third) // step),
        U(xy_far + (side - near - third) // step),
        U(xy_far + (side - near) // step),
        np.float32(mean * mean),
        np.float32(_DXY * mixed_mean * mixed_mean),
        out,
        U(target),
        U(n),
    )


@part
def _difference_rows(sums, stride, corner, side, n, scratch, length):
    """Differences down the filter's rows, for Dxx, Dyy and Dxy, into the first three rows of the scratch memory."""
    third, near, low = side // 3, (2 * side + 9) // 18, (4 * side + 9) // 18
    _difference(sums, U(corner + low * stride), U(corner + (side - low) * stride), scratch, U(0), n)
    _second_difference(
        sums,
        U(corner),
        U(corner + third * stride),
        U(corner + 2 * third * stride),
        U(corner + side * stride),
        scratch,
        U(length),
        n,
    )
    _mixed_difference(
        sums,
        U(corner + near * stride),
        U(corner + (near + third) * stride),
        U(corner + (side - near - third) * stride),
        U(corner + (side - near) * stride),
        scratch,
        U(2 * length),
        n,
    )


@part
def _difference(sums, r2, r7, out, target, n):
    """Sums over the middle five ninths of the rows, for Dxx."""
    for x in range(n):
        out[target + x] = np.int32(sums[r7 + x] - sums[r2 + x])


@part
def _second_difference(sums, r0, r3, r6, r9, out, target, n):
    """Top − 2 middle + bottom third, for Dyy: (r3 − r0) − 2 (r6 − r3) + (r9 − r6)."""
    for x in range(n):
        out[target + x] = np.int32((sums[r9 + x] - sums[r0 + x]) - 3 * (sums[r6 + x] - sums[r3 + x]))


@part
def _mixed_difference(sums, r1, r4, r5, r8, out, target, n):
    """Upper − lower boxes, for Dxy."""
    for x in range(n):
        out[target + x] = np.int32((sums[r4 + x] - sums[r1 + x]) - (sums[r8 + x] - sums[r5 + x]))


@part
def _every(scratch, source, step, target, n):
    """Copy every step-th element side by side, so that loops over positions can use vectors; returns the first."""
    for j in range(n):
        scratch[U(target + j)] = scratch[U(source + j * step)]
    return target


@part
def _both_phases(scratch, source, phase, step, target, length, n):
    """`_every` from phase and from −phase on: the boxes of Dyy and Dxy lie symmetrically in the filter."""
    mirrored = (step - phase) % step
    left = _every(scratch, source + phase, step, target, n)
    right = left if mirrored == phase else _every(scratch, source + mirrored, step, target + length, n)
    return left, right


@contracting_part
def _determinants(s, x0, x3, x6, x9, y2, y7, u1, u4, u5, u8, dxx_dyy, dxy_dxy, out, target, n):
    """Dxx Dyy − 0.81 Dxy² from row differences at the boxes' columns, named by ninths of the side."""
    for j in range(n):
        dxx = np.float32(np.int32((s[x9 + j] - s[x0 + j]) - 3 * (s[x6 + j] - s[x3 + j])))
        dyy = np.float32(np.int32(s[y7 + j] - s[y2 + j]))
        dxy = np.float32(np.int32((s[u4 + j] - s[u1 + j]) - (s[u8 + j] - s[u5 + j])))
        out[target + j] = dxx * dxx_dyy * dyy - dxy * dxy_dxy * dxy


@part
def _raise_to_neighbours(ring, layers, width, highest):
    """Largest of the 3×3 neighbours in each layer, for the middle row; undefined at the first and last column."""
    spare = layers * width
    for m in range(layers):
        row = 3 * m * width
        _max3(ring, U(row), U(row + width), U(row + 2 * width), highest, U(spare), U(width))
        _max3(highest, U(spare), U(spare + 1), U(spare + 2), highest, U(m * width + 1), U(width - 2))


@part
def _max3(values, a, b, c, out, target, n):
    for j in range(n):
        out[target + j] = max(max(values[a + j], values[b + j]), values[c + j])


@part
def _flag_row(ring, highest, block, index, i, threshold, width, flags):
    """Mark the candidates of a layer's grid row i; returns the first grid column and the number of columns searched."""
    margin = 8 + 3 * index
    first, end = max(block.left, margin), min(block.right, block.columns - margin)
    if not (margin <= i < block.rows - margin and first < end):
        return first, 0
    n, m = end - first, index - 1
    slack = min(threshold, np.float32(2.0**-8))
    k = first - block.left + 1
    flags[n : (n + 7) // 8 * 8] = 0
    _flag_peaks(
        ring,
        U((3 * m + i % 3) * width + k),
        highest,
        U(max(m - 1, 0) * width + k),
        U(m * width + k),
        U(min(m + 1, block.layers - 1) * width + k),
        threshold - threshold * _SLACK - slack,
        slack,
        flags,
        U(n),
    )
    return first, n


@part
def _flag_peaks(values, v, highest, below, here, above, loose, slack, flags, n):
    """Mark the values over the threshold that no neighbour clearly exceeds."""
    for j in range(n):
        value = values[v + j]
        rival = max(max(highest[below + j], highest[here + j]), highest[above + j])
        flags[j] = (value > loose) & (value + value * _SLACK + slack >= rival)


@part
def _cut_cube(ring, block, index, i, j, width, cube):
    """Copy the 3×3×3 neighbourhood of a candidate, as far as the ring holds its layers."""
    for s in range(3):
        m = index - 2 + s
        if 0 <= m < block.layers:
            for di in range(3):
                row = (m * 3 + (i + di - 1) % 3) * width + j - block.left
                for dj in range(3):
                    cube[s, di, dj] = ring[U(row + dj)]


@part
def _settle(sums, stride, mask, threshold, block, index, i, j, cube, records, count):
    """Write a candidate into records[count], if it is a maximum in OpenCV's arithmetic; returns the new count."""
    octave = block.octave
    offset, side = 4 + 3 * index, (9 + 6 * index) << octave
    corner = ((i - offset) * stride + j - offset) << octave
    dxx, dyy, dxy = exact_derivatives(sums, stride, corner, side)
    response = dxx * dyy - _DXY * dxy * dxy
    if not response > threshold or (mask.size and not mask_accepts(mask, stride, corner, side)):
        return count
    cube[1, 1, 1] = response
    doubt = _SLACK * (abs(dxx * dyy) + dxy * dxy)
    if not _is_maximum(sums, stride, block, index, i, j, cube, doubt):
        return count
    ok, dx, dy, ds = newton_offset(cube)
    write_record(records[count], octave, index, i, j, response, dxx + dyy, (dx, dy, ds))
    return count + ok


@part
def _is_maximum(sums, stride, block, index, i, j, cube, doubt):
    """Whether the middle of the cube exceeds its 26 neighbours; fills in layers that the ring does not hold.

    Where a neighbour comes within `doubt`, all of them are computed again in OpenCV's arithmetic.
    """
    response = cube[1, 1, 1]
    for outer in (index - 1, index + 1):
        if outer == 0 or outer == block.layers + 1:
            corner = ((i - 4 - 3 * outer) * stride + j - 4 - 3 * outer) << block.octave
            if quick_response(sums, stride, corner, (9 + 6 * outer) << block.octave) > response + doubt:
                return False
            fill_layer(sums, stride, block.octave, outer, i, j, np.bool_(False), cube[outer - index + 1])
    rival = strongest_neighbour(cube)
    if response - doubt <= rival <= response + doubt:
        for s in range(3):
            fill_layer(sums, stride, block.octave, index + s - 1, i, j, np.bool_(True), cube[s])
        rival = strongest_neighbour(cube)
    return response > rival


@part
def _grown(records):
    """Copy with twice the room."""
    more = np.empty((2 * len(records), records.shape[1]), dtype=records.dtype)
    for row in range(len(records)):  # a slice would do the same and take seconds to compile
        for column in range(records.shape[1]):
            more[row, column] = records[row, column]
    return more
