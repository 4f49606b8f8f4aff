"""Kernels that cut SURF's window out of an image and average it down to the 21×21 patch that is described."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

PATCH_SIDE = 21
"""Side of the patch, px."""

U = np.uint64
_LANES = 24
"""PATCH_SIDE rounded up to whole vectors."""
_NEAR_HALF = np.float32(2.0**-9)
"""Averages this close to half a grey level are computed again in OpenCV's arithmetic, which decides the rounding."""


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def interleave_rows(gray: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Each pixel with the one below it as (upper | lower << 8), row by row, the last row with itself.

    Two neighbouring entries are then the four pixels that bilinear sampling needs. (H · W + 1,), with a last zero.
    """
    height, width = gray.shape
    flat = gray.reshape(-1)
    pairs = np.empty(height * width + 1, dtype=np.uint16)
    pairs[height * width] = 0
    below = U(width)
    for at in range(U((height - 1) * width)):
        pairs[at] = np.uint16(flat[at]) | np.uint16(np.uint16(flat[at + below]) << np.uint16(8))
    for at in range((height - 1) * width, height * width):
        pairs[at] = np.uint16(flat[at]) * np.uint16(257)
    return pairs


@njit(cache=True, nogil=True)
def sample_turned(pairs, shape, x, y, angle_deg, side, pitch, window):  # type: ignore[no-untyped-def]
    """Sample a window turned by the angle: bilinear and rounded; outside the image the nearest pixel.

    Parameters
    ----------
    pairs : result of `interleave_rows` for an image of this shape.
    x, y, angle_deg : float32 centre, px, and direction, degrees.
    side, pitch : side of the window, px, and distance of its rows in `window`, a multiple of 32 that is not smaller.
    window : (≥ side · pitch,) uint8, written; entries beyond `side` in a row are left undefined.
    """
    angle = angle_deg * np.float32(np.pi / 180)
    sine, cosine = np.float32(-np.sin(angle)), np.float32(np.cos(angle))
    reach = -np.float32(side - 1) / np.float32(2.0)
    start_x = x + reach * cosine + reach * sine
    start_y = y - reach * sine + reach * cosine
    # Distances from a pixel near the window keep single precision fine: 1e-5 px and better.
    span = np.float32(side) * (abs(sine) + abs(cosine)) * np.float32(0.5) + np.float32(2.0)
    origin_x, origin_y = np.int64(np.floor(x - span)), np.int64(np.floor(y - span))
    start_x -= np.float32(origin_x)
    start_y -= np.float32(origin_y)
    places = np.empty(pitch, dtype=np.int32)
    ax = np.empty(pitch, dtype=np.float32)
    ay = np.empty(pitch, dtype=np.float32)
    quads = np.zeros(pitch, dtype=np.uint32)
    base = U(origin_y * shape[1] + origin_x)
    for i in range(side):
        _place_row(start_x, start_y, cosine, sine, origin_x, origin_y, shape, places, ax, ay, U(pitch))
        _load_quads(pairs, base, places, quads, U(side))
        _interpolate(quads, ax, ay, window, U(i * pitch), U(pitch))
        start_x += sine
        start_y += cosine


@njit(cache=True, nogil=True, fastmath={"contract"})
def _place_row(start_x, start_y, cosine, sine, origin_x, origin_y, shape, places, ax, ay, n):  # type: ignore[no-untyped-def]
    """Upper left pixels of a row of samples, relative to the origin's place, and the shares of their neighbours."""
    width = np.int32(shape[1])
    first_x, first_y = np.float32(-origin_x), np.float32(-origin_y)
    last_x, last_y = np.float32(shape[1] - 1 - origin_x), np.float32(shape[0] - 1 - origin_y)
    zero = np.float32(0.0)
    for j in range(n):
        x = start_x + np.float32(np.int32(j)) * cosine
        y = start_y - np.float32(np.int32(j)) * sine
        left, top = np.float32(np.int32(x)), np.float32(np.int32(y))
        inside = (left >= first_x) & (left < last_x) & (top >= first_y) & (top < last_y)
        nearest_x = min(max(np.rint(x), first_x), last_x)
        nearest_y = min(max(np.rint(y), first_y), last_y)
        ax[j] = x - left if inside else zero
        ay[j] = y - top if inside else zero
        column, row = left if inside else nearest_x, top if inside else nearest_y
        places[j] = np.int32(np.int32(row) * width + np.int32(column))


@njit(cache=True, nogil=True)
def _load_quads(pairs, base, places, quads, n):  # type: ignore[no-untyped-def]
    """The four pixels of each sample: upper left, lower left, upper right, lower right, from the lowest byte on."""
    one = U(1)
    for j in range(n):
        at = base + U(places[j])
        quads[j] = np.uint32(pairs[at]) | np.uint32(np.uint32(pairs[at + one]) << np.uint32(16))


@njit(cache=True, nogil=True, fastmath={"contract"})
def _interpolate(quads, ax, ay, window, place, n):  # type: ignore[no-untyped-def]
    byte = np.uint32(255)
    for j in range(n):
        quad = quads[j]
        upper_left = np.float32(np.int32(quad & byte))
        lower_left = np.float32(np.int32((quad >> np.uint32(8)) & byte))
        upper_right = np.float32(np.int32((quad >> np.uint32(16)) & byte))
        lower_right = np.float32(np.int32(quad >> np.uint32(24)))
        upper = upper_left + ax[j] * (upper_right - upper_left)
        lower = lower_left + ax[j] * (lower_right - lower_left)
        window[place + j] = np.uint8(np.int32(np.rint(upper + ay[j] * (lower - upper))))


@njit(cache=True, nogil=True)
def sample_upright(pairs, shape, x, y, side, pitch, window):  # type: ignore[no-untyped-def]
    """Copy a window turned by 270°, whole pixels, rows running up the image; outside the image the nearest pixel."""
    reach = -np.float32(side - 1) / np.float32(2.0)
    first_column = np.int64(np.rint(x + reach))
    last_row = np.int64(np.rint(y - reach))
    for i in range(side):
        column = min(max(first_column + i, 0), shape[1] - 1)
        for j in range(side):
            row = min(max(last_row - j, 0), shape[0] - 1)
            window[i * pitch + j] = np.uint8(pairs[U(row * shape[1] + column)] & np.uint16(255))


@njit(cache=True, nogil=True)
def average_areas(window, side, pitch, patch):  # type: ignore[no-untyped-def]
    """Average the window by area onto the patch, rounded to 8 bits: OpenCV's INTER_AREA.

    Lengths are counted in 1 / 21 px, so that pixels are 21 and patch cells `side` units wide: all sums are exact.
    """
    if side < PATCH_SIDE:
        _enlarge(window, side, pitch, patch)
        return
    rows = np.empty(pitch, dtype=np.int32)
    columns = np.empty(pitch * _LANES, dtype=np.int32)
    totals = np.zeros(PATCH_SIDE * _LANES, dtype=np.int32)
    for i in range(PATCH_SIDE):
        start, end = i * side, (i + 1) * side
        rows[:] = 0
        for y in range(start // PATCH_SIDE, (end + PATCH_SIDE - 1) // PATCH_SIDE):
            weight = min(end, (y + 1) * PATCH_SIDE) - max(start, y * PATCH_SIDE)
            _add_row(window, U(y * pitch), np.int32(weight), rows, U(0), U(pitch))
        for x in range(side):
            columns[U(x * _LANES + i)] = rows[x]
    for j in range(PATCH_SIDE):
        start, end = j * side, (j + 1) * side
        for x in range(start // PATCH_SIDE, (end + PATCH_SIDE - 1) // PATCH_SIDE):
            weight = min(end, (x + 1) * PATCH_SIDE) - max(start, x * PATCH_SIDE)
            _add_row(columns, U(x * _LANES), np.int32(weight), totals, U(j * _LANES), U(_LANES))
    _round_averages(window, side, pitch, totals, patch)


@njit(cache=True, nogil=True)
def _add_row(values, source, weight, sums, place, n):  # type: ignore[no-untyped-def]
    for x in range(n):
        sums[place + x] = np.int32(sums[place + x] + weight * np.int32(values[source + x]))


@njit(cache=True, nogil=True)
def _round_averages(window, side, pitch, totals, patch):  # type: ignore[no-untyped-def]
    """Round totals (column by column, in 1 / 21² px) to grey levels as OpenCV does, halves included."""
    one_by_area = np.float32(1.0) / np.float32(side * side)
    for j in range(PATCH_SIDE):
        for i in range(PATCH_SIDE):
            total = totals[j * _LANES + i]
            if side == 2 * PATCH_SIDE:
                patch[i, j] = (total // np.int32(441) + 2) >> 2
                continue
            average = np.float32(total) * one_by_area
            level = np.rint(average)
            if abs(abs(average - level) - np.float32(0.5)) < _NEAR_HALF:
                level = _average_like_opencv(window, side, pitch, i, j)
            patch[i, j] = np.int32(level)


@njit(cache=True, nogil=True)
def _average_like_opencv(window, side, pitch, i, j):  # type: ignore[no-untyped-def]
    """One patch pixel in single precision, the sums in OpenCV's order."""
    whole = side % PATCH_SIDE == 0
    total = np.float32(0.0)
    for y in range(i * side // PATCH_SIDE, ((i + 1) * side + PATCH_SIDE - 1) // PATCH_SIDE):
        row = np.float32(0.0)
        for x in range(j * side // PATCH_SIDE, ((j + 1) * side + PATCH_SIDE - 1) // PATCH_SIDE):
            row += np.float32(window[y * pitch + x]) * (np.float32(1.0) if whole else _share(x, j, side))
        total += row * (np.float32(1.0) if whole else _share(y, i, side))
    ratio = side // PATCH_SIDE
    return np.rint(total * (np.float32(1.0) / np.float32(ratio * ratio)) if whole else total)


@njit(cache=True, nogil=True)
def _share(x, cell, side):  # type: ignore[no-untyped-def]
    """Share of patch cell `cell` that pixel x covers."""
    covered = min((cell + 1) * side, (x + 1) * PATCH_SIDE) - max(cell * side, x * PATCH_SIDE)
    return np.float32(covered / side)


@njit(cache=True, nogil=True)
def _enlarge(window, side, pitch, patch):  # type: ignore[no-untyped-def]
    """OpenCV's INTER_AREA where the window is smaller than the patch: linear between neighbouring pixels."""
    for i in range(PATCH_SIDE):
        y, b = _source_of(i, side)
        y1 = min(y + 1, side - 1)
        for j in range(PATCH_SIDE):
            x, a = _source_of(j, side)
            x1 = min(x + 1, side - 1)
            upper = (1 - a) * window[y * pitch + x] + a * window[y * pitch + x1]
            lower = (1 - a) * window[y1 * pitch + x] + a * window[y1 * pitch + x1]
            patch[i, j] = np.int32(np.rint((1 - b) * upper + b * lower))


@njit(cache=True, nogil=True)
def _source_of(i, side):  # type: ignore[no-untyped-def]
    """First pixel under patch cell i, and the share of the next."""
    y = i * side // PATCH_SIDE
    return y, max((i + 1) - (y + 1) * PATCH_SIDE / side, 0.0)
