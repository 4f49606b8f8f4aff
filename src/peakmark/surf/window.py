"""Kernels that cut SURF's window out of an image and average it down to the 21×21 patch that is described."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.kernel import contracting_part, kernel, part

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.integral import padded_length

PATCH_SIDE = 21
"""Side of the patch, px."""
PATCH_PITCH = 32
"""Distance of the patch's columns in memory: PATCH_SIDE rounded up to whole vectors."""

U = np.uint64
_CHUNK = 4096
"""Samples that are located, loaded and interpolated together: they stay in the first cache."""
_NEAR_HALF = np.float32(2.0**-11)
"""Averages this close to half a grey level are computed again in OpenCV's arithmetic, which decides the rounding."""


class Buffers(NamedTuple):
    """Memory that one thread uses for one window after the other."""

    starts: NDArray[np.float32]
    """x, then y of the first sample of each row of the window."""
    quads: NDArray[np.int32]
    """Indices of a few rows of samples in the image, later the four pixels there."""
    window: NDArray[np.uint8]
    """The window, rows `pitch_of(side)` apart."""
    rows: NDArray[np.int32]
    """Sum of the window's rows that fall into one row of the patch."""
    columns: NDArray[np.int32]
    """Those sums, column by column."""
    patch: NDArray[np.int32]
    """The patch, column by column."""


@part
def pitch_of(side):
    """Distance of the rows of a window in memory: its side rounded up to whole vectors."""
    return (side + 15) // 16 * 16


@part
def make_buffers(largest_side):
    """Buffers for windows up to this side, px."""
    pitch = pitch_of(max(largest_side, PATCH_SIDE))
    return Buffers(
        np.empty(2 * pitch, dtype=np.float32),
        np.empty(_CHUNK + pitch, dtype=np.int32),
        np.empty(pitch * pitch, dtype=np.uint8),
        np.empty(pitch, dtype=np.int32),
        np.zeros(pitch * PATCH_PITCH, dtype=np.int32),
        np.zeros((PATCH_SIDE + 1) * PATCH_PITCH, dtype=np.int32),
    )


def interleave_rows(gray: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Each pixel of an (H, W) image with the one below it, as upper | lower << 8; below the last row, that row again.

    Two neighbouring entries are then the four pixels that bilinear sampling needs. (H, padded W + 1), see
    `padded_length`; entries beyond the image are undefined.
    """
    pairs = np.empty((gray.shape[0], padded_length(gray.shape[1] + 1, 2)), dtype=np.uint16)
    cuts = bands(gray.shape[0], thread_count())
    map_parallel(lambda cut: _interleave_rows(gray, pairs, *cut), cuts)
    return pairs


@kernel
def _interleave_rows(gray, pairs, first, end):
    for y in range(first, end):
        upper, lower, row = gray[y], gray[min(y + 1, len(gray) - 1)], pairs[y]
        for x in range(upper.size):
            row[x] = np.uint16(upper[x]) | np.uint16(np.uint16(lower[x]) << np.uint16(8))
        row[upper.size] = 0


@part
def sample_rotated(pairs, stride, shape, x, y, angle_deg, side, buffers):
    """Sample a window rotated by the angle: bilinear and rounded to 8 bits; outside the image the nearest pixel.

    Parameters
    ----------
    pairs, stride, shape : result of `interleave_rows`, flat; the length of its rows; (H, W) of the image.
    x, y, angle_deg : float32 centre, px, and direction, degrees.
    side : side of the window, px.
    buffers : its `window` is written; what lies between the rows is undefined.
    """
    angle = angle_deg * np.float32(np.pi / 180)
    sine, cosine = np.float32(-np.sin(angle)), np.float32(np.cos(angle))
    # Distances from a pixel close to the window keep single precision fine: 1e-5 px and better. Even coordinates, as
    # halves are rounded to even.
    span = np.float32(side) * (abs(sine) + abs(cosine)) * np.float32(0.5) + np.float32(2.0)
    left = min(max(np.int64(np.floor(x - span)), -np.int64(2 * span)), shape[1]) // 2 * 2
    top = min(max(np.int64(np.floor(y - span)), -np.int64(2 * span)), shape[0]) // 2 * 2
    inside = lies_inside(x, y, sine, cosine, side, shape)
    starts, quads, window = buffers.starts, buffers.quads, buffers.window
    _start_rows(x, y, sine, cosine, left, top, side, starts)
    borders = (np.float32(-left), np.float32(-top), np.float32(shape[1] - 1 - left), np.float32(shape[0] - 1 - top))
    stride32 = np.int32(stride)
    pitch = pitch_of(side)
    chunk = max(_CHUNK // pitch, 1)
    for first in range(0, side, chunk):
        end = min(first + chunk, side)
        if inside:
            _index_samples(starts, first, end, side, sine, cosine, stride32, quads)
        else:
            _index_border_samples(starts, first, end, side, sine, cosine, stride32, borders, quads)
        _load_quads(pairs, U(top * stride + left), quads, U((end - first) * pitch))
        if inside:
            _interpolate(starts, first, end, side, sine, cosine, quads, window)
        else:
            _interpolate_border(starts, first, end, side, sine, cosine, borders, quads, window)


@part
def lies_inside(x, y, sine, cosine, side, shape):
    """Whether a rotated window, with the lanes that fill its rows up to the pitch, stays two pixels inside."""
    reach = np.float32(pitch_of(side)) - np.float32(side) * np.float32(0.5)
    span = reach * (abs(sine) + abs(cosine)) + np.float32(2.0)
    return x - span >= 0 and y - span >= 0 and x + span < shape[1] and y + span < shape[0]


@part
def _start_rows(x, y, sine, cosine, left, top, side, starts):
    """First sample of each row, relative to (left, top); OpenCV steps from row to row in single precision."""
    reach = -np.float32(side - 1) / np.float32(2.0)
    start_x = x + reach * cosine + reach * sine
    start_y = y - reach * sine + reach * cosine
    for i in range(side):
        starts[i] = start_x - np.float32(left)
        starts[side + i] = start_y - np.float32(top)
        start_x += sine
        start_y += cosine


@contracting_part
def _index_samples(starts, first, end, side, sine, cosine, stride, indices):
    """Index in the image of the upper left pixel of each sample, relative to the start's origin."""
    pitch = U(pitch_of(side))
    for i in range(first, end):
        row = U(i - first) * pitch
        start_x, start_y = starts[i], starts[side + i]
        for j in range(pitch):
            column = np.int32(start_x + np.float32(np.int32(j)) * cosine)
            line = np.int32(start_y - np.float32(np.int32(j)) * sine)
            indices[row + j] = np.int32(line * stride + column)


@contracting_part
def _index_border_samples(starts, first, end, side, sine, cosine, stride, borders, indices):
    """`_index_samples` where the window may leave the image: samples without four pixels take the nearest."""
    first_x, first_y, last_x, last_y = borders
    pitch = U(pitch_of(side))
    for i in range(first, end):
        row = U(i - first) * pitch
        start_x, start_y = starts[i], starts[side + i]
        for j in range(pitch):
            x, y, column, line, inside = _sample(start_x, start_y, np.float32(np.int32(j)), cosine, sine, borders)
            column = column if inside else min(max(np.rint(x), first_x), last_x)
            line = line if inside else min(max(np.rint(y), first_y), last_y)
            indices[row + j] = np.int32(np.int32(line) * stride + np.int32(column))


@contracting_part
def _sample(start_x, start_y, j, cosine, sine, borders):
    """Position of the sample j steps along a row, its upper left pixel, and whether all four pixels exist."""
    first_x, first_y, last_x, last_y = borders
    x, y = start_x + j * cosine, start_y - j * sine
    column, line = np.float32(np.int32(x)), np.float32(np.int32(y))
    return x, y, column, line, (column >= first_x) & (column < last_x) & (line >= first_y) & (line < last_y)


@part
def _load_quads(pairs, base, quads, n):
    """Replace indices by pixels: upper left, lower left, upper right, lower right, from the lowest byte on."""
    one, sixteen = U(1), np.uint32(16)
    for j in range(n):
        at = base + U(quads[j])
        quads[j] = np.int32(np.uint32(pairs[at]) | (np.uint32(pairs[at + one]) << sixteen))


@contracting_part
def _interpolate(starts, first, end, side, sine, cosine, quads, window):
    """Bilinear interpolation of the samples in their quads."""
    pitch = U(pitch_of(side))
    for i in range(first, end):
        row = U(i - first) * pitch
        target = U(i) * pitch
        start_x, start_y = starts[i], starts[side + i]
        for j in range(pitch):
            x = start_x + np.float32(np.int32(j)) * cosine
            y = start_y - np.float32(np.int32(j)) * sine
            x_share, y_share = x - np.float32(np.int32(x)), y - np.float32(np.int32(y))
            window[target + j] = _bilinear(np.uint32(quads[row + j]), x_share, y_share)


@contracting_part
def _interpolate_border(starts, first, end, side, sine, cosine, borders, quads, window):
    """`_interpolate` where the window may leave the image."""
    zero = np.float32(0.0)
    pitch = U(pitch_of(side))
    for i in range(first, end):
        row = U(i - first) * pitch
        target = U(i) * pitch
        start_x, start_y = starts[i], starts[side + i]
        for j in range(pitch):
            x, y, column, line, inside = _sample(start_x, start_y, np.float32(np.int32(j)), cosine, sine, borders)
            x_share, y_share = x - column if inside else zero, y - line if inside else zero
            window[target + j] = _bilinear(np.uint32(quads[row + j]), x_share, y_share)


@contracting_part
def _bilinear(quad, x_share, y_share):
    byte = np.uint32(255)
    upper_left = np.float32(np.int32(quad & byte))
    lower_left = np.float32(np.int32((quad >> np.uint32(8)) & byte))
    upper_right = np.float32(np.int32((quad >> np.uint32(16)) & byte))
    lower_right = np.float32(np.int32(quad >> np.uint32(24)))
    upper = upper_left + x_share * (upper_right - upper_left)
    lower = lower_left + x_share * (lower_right - lower_left)
    return np.uint8(np.int32(np.rint(upper + y_share * (lower - upper))))


@part
def sample_upright(pairs, stride, shape, x, y, side, buffers):
    """Copy a window rotated by 270°, whole pixels, rows running up the image; outside the image the nearest pixel."""
    reach = -np.float32(side - 1) / np.float32(2.0)
    first_column = np.int64(np.rint(x + reach))
    last_row = np.int64(np.rint(y - reach))
    pitch = pitch_of(side)
    for j in range(side):
        row = min(max(last_row - j, 0), shape[0] - 1) * stride
        for i in range(side):
            column = min(max(first_column + i, 0), shape[1] - 1)
            buffers.window[U(i * pitch + j)] = np.uint8(pairs[U(row + column)] & np.uint16(255))


@part
def average_areas(side, lanes, buffers):
    """Average the window by area onto the patch, rounded to 8 bits: OpenCV's INTER_AREA.

    Lengths are counted in 1 / 21 px, so that pixels are 21 and patch pixels `side` units wide: all sums are exact.
    `lanes` is PATCH_PITCH, passed as a variable: loops of known length would be unrolled instead of vectorised.
    """
    window, columns, patch = buffers.window, buffers.columns, buffers.patch
    if side < PATCH_SIDE:
        _enlarge(window, side, patch)
        return
    _average_rows(window, side, buffers.rows, columns)
    _average_columns(columns, side, lanes, patch)
    if side == 2 * PATCH_SIDE:
        _round_quarters(patch)
        return
    one_by_area = np.float32(1.0) / np.float32(side * side)
    for j in range(PATCH_SIDE):
        if _has_near_halves(patch, U(j * PATCH_PITCH), one_by_area, lanes):
            _round_with_care(window, side, j, patch)
        else:
            _round(patch, U(j * PATCH_PITCH), one_by_area, lanes)


@part
def _average_rows(window, side, rows, columns):
    """Weighted sums of the window's rows, one for each row of the patch; written column by column."""
    pitch = U(pitch_of(side))
    for i in range(PATCH_SIDE):
        start, end = i * side, (i + 1) * side
        rows[:pitch] = 0
        for y in range(start // PATCH_SIDE, (end + PATCH_SIDE - 1) // PATCH_SIDE):
            weight = np.int32(min(end, (y + 1) * PATCH_SIDE) - max(start, y * PATCH_SIDE))
            _add_row(window, U(y) * pitch, weight, rows, U(0), pitch)
        for x in range(U(side)):
            columns[x * U(PATCH_PITCH) + U(i)] = rows[x]


@part
def _average_columns(columns, side, lanes, patch):
    """Weighted sums of those columns, one for each column of the patch."""
    patch[:] = 0
    for j in range(PATCH_SIDE):
        start, end = j * side, (j + 1) * side
        for x in range(start // PATCH_SIDE, (end + PATCH_SIDE - 1) // PATCH_SIDE):
            weight = np.int32(min(end, (x + 1) * PATCH_SIDE) - max(start, x * PATCH_SIDE))
            _add_row(columns, U(x * PATCH_PITCH), weight, patch, U(j * PATCH_PITCH), lanes)


@part
def _add_row(values, source, weight, sums, target, n):
    for x in range(n):
        sums[target + x] = np.int32(sums[target + x] + weight * np.int32(values[source + x]))


@part
def _round_quarters(patch):
    """Round means of 2×2 pixels, halves up, as OpenCV does in this case."""
    for k in range(patch.size):
        patch[k] = (patch[k] // np.int32(PATCH_SIDE * PATCH_SIDE) + np.int32(2)) >> np.int32(2)


@part
def _round(patch, first, one_by_area, n):
    for i in range(n):
        patch[first + i] = np.int32(np.rint(np.float32(patch[first + i]) * one_by_area))


@part
def _has_near_halves(patch, first, one_by_area, n):
    """Whether an average of a patch column is so close to half a level that its rounding is in doubt."""
    doubts = np.int32(0)
    for i in range(n):
        average = np.float32(patch[first + i]) * one_by_area
        doubts += np.int32(abs(average - np.floor(average) - np.float32(0.5)) < _NEAR_HALF)
    return doubts > 0


@part
def _round_with_care(window, side, j, patch):
    """Round a patch column, averages near half a level as OpenCV's own sums would be."""
    one_by_area = np.float32(1.0) / np.float32(side * side)
    for i in range(PATCH_SIDE):
        average = np.float32(patch[U(j * PATCH_PITCH + i)]) * one_by_area
        if abs(average - np.floor(average) - np.float32(0.5)) < _NEAR_HALF:
            average = _average_like_opencv(window, side, i, j)
        patch[U(j * PATCH_PITCH + i)] = np.int32(np.rint(average))


@part
def _average_like_opencv(window, side, i, j):
    """One patch pixel in single precision, the sums in OpenCV's order."""
    pitch = pitch_of(side)
    whole = side % PATCH_SIDE == 0
    one = np.float32(1.0)
    total = np.float32(0.0)
    for y in range(i * side // PATCH_SIDE, ((i + 1) * side + PATCH_SIDE - 1) // PATCH_SIDE):
        row = np.float32(0.0)
        for x in range(j * side // PATCH_SIDE, ((j + 1) * side + PATCH_SIDE - 1) // PATCH_SIDE):
            row += np.float32(window[y * pitch + x]) * (one if whole else _share(x, j, side))
        total += row * (one if whole else _share(y, i, side))
    ratio = side // PATCH_SIDE
    return total * (one / np.float32(ratio * ratio)) if whole else total


@part
def _share(x, cell, side):
    """Share of patch cell `cell` that pixel x covers."""
    covered = min((cell + 1) * side, (x + 1) * PATCH_SIDE) - max(cell * side, x * PATCH_SIDE)
    return np.float32(covered / side)


@part
def _enlarge(window, side, patch):
    """OpenCV's INTER_AREA where the window is smaller than the patch: linear between neighbouring pixels."""
    pitch = pitch_of(side)
    for i in range(PATCH_SIDE):
        y, b = _source_of(i, side)
        y1 = min(y + 1, side - 1)
        for j in range(PATCH_SIDE):
            x, a = _source_of(j, side)
            x1 = min(x + 1, side - 1)
            upper = (1 - a) * window[y * pitch + x] + a * window[y * pitch + x1]
            lower = (1 - a) * window[y1 * pitch + x] + a * window[y1 * pitch + x1]
            patch[j * PATCH_PITCH + i] = np.int32(np.rint((1 - b) * upper + b * lower))


@part
def _source_of(i, side):
    """First pixel under patch cell i, and the share of the next."""
    y = i * side // PATCH_SIDE
    return y, max((i + 1) - (y + 1) * PATCH_SIDE / side, 0.0)
