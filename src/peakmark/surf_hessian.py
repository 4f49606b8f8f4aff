"""Kernel that finds SURF's interest points: responses, threshold and 3×3×3 maxima fused, row by row.

No response layer is stored. Three grid rows of each layer of an octave stay in cache, and each row is searched as
soon as the row below it is known. The fast responses come from exact integer differences and differ from OpenCV's in
the last bits; so every candidate is weighed again in OpenCV's own arithmetic, and its neighbours too where the
candidate is not a clear maximum. The key points and their order are then OpenCV's to the bit.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf_layers import DXY_WEIGHT, Layer

RECORD_FIELDS = ("x", "y", "scale", "size", "response", "octave", "laplacian")
"""Columns of the (n, 7) float32 records that the kernel returns."""

_BANDS_PER_THREAD = 4
_CLEAR = np.float32(1 + 2.0**-12)
"""Fast responses that differ by more than this factor are in the same order as OpenCV's."""
_DXY = np.float32(DXY_WEIGHT)


def find_interest_points(
    integral: NDArray[np.int32], threshold: float, octaves: int, layers: int, mask_integral: NDArray[np.int32] | None
) -> NDArray[np.float32]:
    """All interest points as (n, 7) records (`RECORD_FIELDS`), by octave, then row, layer and column.

    Parameters
    ----------
    integral : (H + 1, W + 1) int32 array.
    threshold : a response must be larger, (grey levels)².
    octaves, layers : as in `hessian_responses`.
    mask_integral : integral image of the mask as zeros and ones; None accepts every place.
    """
    no_mask = np.zeros((0, 0), dtype=np.int32)
    mask = no_mask if mask_integral is None else mask_integral
    tasks = [(octave, *band) for octave in range(octaves) for band in _grid_bands(integral, octave)]
    found = map_parallel(
        lambda task: _find_in_rows(integral, mask, np.float32(threshold), layers, *task), tasks
    )
    return np.concatenate(found) if found else np.zeros((0, len(RECORD_FIELDS)), dtype=np.float32)


def strongest_first(records: NDArray[np.float32]) -> NDArray[np.intp]:
    """Row order of OpenCV: response falling, then size falling, octave falling, y falling, x rising."""
    x, y, _, size, response, octave, _ = records.T
    order = np.argsort(-response, kind="stable")
    ranked = response[order]
    equal = np.zeros(len(ranked) + 1, dtype=bool)
    equal[1:-1] = ranked[1:] == ranked[:-1]
    tied = order[equal[:-1] | equal[1:]]
    order[equal[:-1] | equal[1:]] = tied[
        np.lexsort((x[tied], -y[tied], -octave[tied], -size[tied], -response[tied]))
    ]
    return order


def _grid_bands(integral: NDArray[np.int32], octave: int) -> list[tuple[int, int]]:
    """Grid rows of an octave that can hold maxima, cut for the threads: fewer cuts where the grid is coarser."""
    first = Layer(octave, 1).margin
    rows = ((integral.shape[0] - 1) >> octave) - 2 * first
    if rows <= 0:
        return []
    cuts = 1 if thread_count() == 1 else max(1, thread_count() * _BANDS_PER_THREAD >> octave)
    return [(first + start, first + stop) for start, stop in bands(rows, cuts)]


@njit(cache=True, nogil=True)
def _find_in_rows(integral, mask, threshold, layers, octave, first, last):  # type: ignore[no-untyped-def]
    """Records of the maxima in the grid rows first ≤ i < last of one octave."""
    step = 1 << octave
    rows = (integral.shape[0] - 1) >> octave
    columns = (integral.shape[1] - 1) >> octave
    ring = np.zeros((layers + 2, 3, columns), dtype=np.float32)
    scratch = np.empty((8, integral.shape[1]), dtype=np.int32)
    records = np.empty((256, 7), dtype=np.float32)
    count = 0
    for i in range(first - 1, last + 1):
        for index in range(layers + 2):
            offset = 4 + 3 * index
            if offset <= i < rows - offset and columns > 2 * offset:
                positions = ring[index, i % 3, offset : columns - offset]
                _response_row(integral, (i - offset) * step, (9 + 6 * index) * step, step, scratch, positions)
        if i > first:
            records, count = _search_row(integral, mask, threshold, ring, octave, i - 1, rows, records, count)
    return records[:count].copy()


@njit(cache=True, nogil=True)
def _response_row(integral, y, side, step, scratch, out):  # type: ignore[no-untyped-def]
    """Determinants of the filters whose corners are at row y and columns 0, step, 2 step, …"""
    third = side // 3
    ninth = (2 * side + 9) // 18
    two_ninths = (4 * side + 9) // 18
    xx, yy, xy = scratch[0], scratch[1], scratch[2]
    _subtract_rows(integral[y + side - two_ninths], integral[y + two_ninths], xx)
    _second_difference_of_rows(
        integral[y], integral[y + third], integral[y + 2 * third], integral[y + side], yy
    )
    _mixed_difference_of_rows(
        integral[y + ninth],
        integral[y + ninth + third],
        integral[y + side - ninth - third],
        integral[y + side - ninth],
        xy,
    )
    xx_at = _phase(xx, 0, step, scratch[3])
    yy_left = _phase(yy, two_ninths % step, step, scratch[4])
    yy_right = _phase(yy, (side - two_ninths) % step, step, scratch[5])
    xy_left = _phase(xy, ninth % step, step, scratch[6])
    xy_right = _phase(xy, (side - ninth) % step, step, scratch[7])
    n = out.size
    _determinants(
        _part(xx_at, 0, n),
        _part(xx_at, third // step, n),
        _part(xx_at, 2 * third // step, n),
        _part(xx_at, side // step, n),
        _part(yy_left, two_ninths // step, n),
        _part(yy_right, (side - two_ninths) // step, n),
        _part(xy_left, ninth // step, n),
        _part(xy_left, (ninth + third) // step, n),
        _part(xy_right, (side - ninth - third) // step, n),
        _part(xy_right, (side - ninth) // step, n),
        np.float32(1.0 / (third * (side - 2 * two_ninths))),
        np.float32(1.0 / (third * third)),
        out,
    )


@njit(cache=True, nogil=True, inline="always")
def _part(row, start, n):  # type: ignore[no-untyped-def]
    return row[start : start + n]


@njit(cache=True, nogil=True)
def _subtract_rows(below, above, out):  # type: ignore[no-untyped-def]
    """Sums over the middle five ninths of the rows, for Dxx."""
    for x in range(out.size):
        out[x] = np.int32(below[x] - above[x])


@njit(cache=True, nogil=True)
def _second_difference_of_rows(r0, r3, r6, r9, out):  # type: ignore[no-untyped-def]
    """Top − 2 middle + bottom third, for Dyy: (r3 − r0) − 2 (r6 − r3) + (r9 − r6)."""
    for x in range(out.size):
        out[x] = np.int32((r9[x] - r0[x]) - 3 * (r6[x] - r3[x]))


@njit(cache=True, nogil=True)
def _mixed_difference_of_rows(r1, r4, r5, r8, out):  # type: ignore[no-untyped-def]
    """Upper − lower boxes, for Dxy."""
    for x in range(out.size):
        out[x] = np.int32((r4[x] - r1[x]) - (r8[x] - r5[x]))


@njit(cache=True, nogil=True)
def _phase(row, phase, step, out):  # type: ignore[no-untyped-def]
    """Every step-th element from `phase` on, contiguous, so that the loop over positions can use vectors."""
    if step == 1:
        return row
    n = (row.size - phase + step - 1) // step
    for j in range(n):
        out[j] = row[phase + j * step]
    return out


@njit(cache=True, nogil=True)
def _determinants(x0, x3, x6, x9, y2, y7, u1, u4, u5, u8, dxx_weight, dxy_weight, out):  # type: ignore[no-untyped-def]
    """Dxx Dyy − 0.81 Dxy² from row differences at the boxes' columns (in ninths of the side)."""
    for j in range(out.size):
        dxx = np.float32(np.int32((x9[j] - x0[j]) - 3 * (x6[j] - x3[j]))) * dxx_weight
        dyy = np.float32(np.int32(y7[j] - y2[j])) * dxx_weight
        dxy = np.float32(np.int32((u4[j] - u1[j]) - (u8[j] - u5[j]))) * dxy_weight
        out[j] = dxx * dyy - _DXY * dxy * dxy


@njit(cache=True, nogil=True)
def _search_row(integral, mask, threshold, ring, octave, i, rows, records, count):  # type: ignore[no-untyped-def]
    """Append the maxima of grid row i of every searchable layer."""
    step = 1 << octave
    columns = ring.shape[2]
    loose = threshold / _CLEAR
    for index in range(1, ring.shape[0] - 1):
        margin = 8 + 3 * index
        if not margin <= i < rows - margin:
            continue
        side = (9 + 6 * index) * step
        offset = 4 + 3 * index
        row = ring[index, i % 3]
        for j in range(margin, columns - margin):
            value = row[j]
            if not value > loose:
                continue
            rival = _strongest_neighbour(ring, index, i, j)
            if value * _CLEAR < rival:
                continue
            y, x = (i - offset) * step, (j - offset) * step
            response, trace = exact_response(integral, y, x, side)
            if not response > threshold or (mask.size and not _mask_accepts(mask, y, x, side)):
                continue
            if value <= rival * _CLEAR and not _is_exact_maximum(integral, response, octave, index, i, j):
                continue
            moved, dx, dy, ds = _newton_step(ring, index, i, j)
            if moved:
                if count == len(records):
                    records = _grown(records)
                record = records[count]
                count += 1
                half = np.float32(side - 1) * np.float32(0.5)
                record[0] = np.float32(x) + half + dx * np.float32(step)
                record[1] = np.float32(y) + half + dy * np.float32(step)
                record[2] = np.float32(side) + ds * np.float32(6 * step)
                record[3] = np.rint(record[2])
                record[4] = response
                record[5] = octave
                record[6] = np.sign(trace)
    return records, count


@njit(cache=True, nogil=True)
def _strongest_neighbour(ring, index, i, j):  # type: ignore[no-untyped-def]
    """Largest of the 26 neighbours in row, column and layer."""
    strongest = np.float32(-np.inf)
    for layer in range(index - 1, index + 2):
        for row in range(i - 1, i + 2):
            values = ring[layer, row % 3]
            for column in range(j - 1, j + 2):
                if layer != index or row != i or column != j:
                    strongest = max(strongest, values[column])
    return strongest


@njit(cache=True, nogil=True)
def _is_exact_maximum(integral, response, octave, index, i, j):  # type: ignore[no-untyped-def]
    """Whether `response` exceeds its 26 neighbours in OpenCV's arithmetic."""
    step = 1 << octave
    for layer in range(index - 1, index + 2):
        offset, side = 4 + 3 * layer, (9 + 6 * layer) * step
        for row in range(i - 1, i + 2):
            for column in range(j - 1, j + 2):
                if layer == index and row == i and column == j:
                    continue
                rival, _ = exact_response(integral, (row - offset) * step, (column - offset) * step, side)
                if not response > rival:
                    return False
    return True


@njit(cache=True, nogil=True)
def exact_response(integral, y, x, side):  # type: ignore[no-untyped-def]
    """Determinant and trace of the filter with its corner at (x, y), in OpenCV's arithmetic and order."""
    third = side // 3
    ninth = (2 * side + 9) // 18
    two_ninths = (4 * side + 9) // 18
    low, high = two_ninths, side - two_ninths
    mean = np.float32(1.0) / np.float32(third * (high - low))
    minus_two_means = np.float32(-2.0) * mean
    dxx = np.float64(0.0)
    dyy = np.float64(0.0)
    for k in range(3):
        weight = minus_two_means if k == 1 else mean
        dxx += np.float32(_box_sum(integral, y + low, x + k * third, y + high, x + (k + 1) * third)) * weight
        dyy += np.float32(_box_sum(integral, y + k * third, x + low, y + (k + 1) * third, x + high)) * weight
    left, right = ninth, side - ninth - third
    mean = np.float32(1.0) / np.float32(third * third)
    dxy = np.float64(np.float32(_box_sum(integral, y + left, x + left, y + left + third, x + left + third)) * mean)
    dxy -= np.float32(_box_sum(integral, y + left, x + right, y + left + third, x + right + third)) * mean
    dxy -= np.float32(_box_sum(integral, y + right, x + left, y + right + third, x + left + third)) * mean
    dxy += np.float32(_box_sum(integral, y + right, x + right, y + right + third, x + right + third)) * mean
    dxx32, dyy32, dxy32 = np.float32(dxx), np.float32(dyy), np.float32(dxy)
    return dxx32 * dyy32 - _DXY * dxy32 * dxy32, dxx32 + dyy32


@njit(cache=True, nogil=True, inline="always")
def _box_sum(integral, y0, x0, y1, x1):  # type: ignore[no-untyped-def]
    return np.int32(integral[y0, x0] + integral[y1, x1] - integral[y0, x1] - integral[y1, x0])


@njit(cache=True, nogil=True)
def _mask_accepts(mask, y, x, side):  # type: ignore[no-untyped-def]
    """OpenCV's rule: at least half of the filter square is inside the mask."""
    covered = np.float32(_box_sum(mask, y, x, y + side, x + side))
    return covered * (np.float32(1.0) / np.float32(side * side)) >= np.float32(0.5)


@njit(cache=True, nogil=True)
def _newton_step(ring, index, i, j):  # type: ignore[no-untyped-def]
    """Offset of the maximum in steps of column, row and layer; not ok if it is exactly 0 or exceeds 1 somewhere."""
    below, here, above = ring[index - 1], ring[index], ring[index + 1]
    p, m, n = (i - 1) % 3, i % 3, (i + 1) % 3
    two, half, quarter = np.float32(2.0), np.float32(0.5), np.float32(0.25)
    v = here[m, j]
    bx = (here[m, j - 1] - here[m, j + 1]) * half
    by = (here[p, j] - here[n, j]) * half
    bs = (below[m, j] - above[m, j]) * half
    xx = here[m, j - 1] - two * v + here[m, j + 1]
    yy = here[p, j] - two * v + here[n, j]
    ss = below[m, j] - two * v + above[m, j]
    xy = (here[n, j + 1] - here[n, j - 1] - here[p, j + 1] + here[p, j - 1]) * quarter
    xs = (above[m, j + 1] - above[m, j - 1] - below[m, j + 1] + below[m, j - 1]) * quarter
    ys = (above[n, j] - above[p, j] - below[n, j] + below[p, j]) * quarter
    determinant = np.float64(
        xx * (yy * ss - ys * ys) - xy * (xy * ss - ys * xs) + xs * (xy * ys - yy * xs)
    )
    if determinant == 0.0:
        return False, np.float32(0), np.float32(0), np.float32(0)
    d = np.float32(1.0 / determinant)
    dx = d * (bx * (yy * ss - ys * ys) - xy * (by * ss - ys * bs) + xs * (by * ys - yy * bs))
    dy = d * (xx * (by * ss - ys * bs) - bx * (xy * ss - ys * xs) + xs * (xy * bs - by * xs))
    ds = d * (xx * (yy * bs - by * ys) - xy * (xy * bs - by * xs) + bx * (xy * ys - yy * xs))
    one = np.float32(1.0)
    stays = dx == 0 and dy == 0 and ds == 0
    return not stays and abs(dx) <= one and abs(dy) <= one and abs(ds) <= one, dx, dy, ds


@njit(cache=True, nogil=True)
def _grown(records):  # type: ignore[no-untyped-def]
    """Copy with twice the room."""
    more = np.empty((2 * len(records), records.shape[1]), dtype=records.dtype)
    more[: len(records)] = records
    return more
