"""Kernel for SURF's orientation: the strongest 60° window of Haar responses around a key point."""

import numpy as np
from numpy.typing import NDArray
from peaksim.kernel import kernel, part

from peakmark.parallel import bands, map_parallel, thread_count

RADIUS = 6
"""Radius of the circle of samples, in units of the key point's s = 1.2 size / 9."""
WEIGHT_SIGMA = 2.5
"""Standard deviation of the samples' Gaussian weights, in units of s; OpenCV's."""
UPRIGHT_DEG = 270.0
"""Angle of upright key points, as OpenCV writes it."""
NO_SAMPLE = -1.0
"""Angle of a key point without a single sample inside the image."""

U = np.uint64
_GROUPS = 72
"""Groups of 5° that make a full circle; a window spans twelve of them."""
_CIRCLE = _GROUPS + 12
_CLOSE = np.float32(1 - 2.0**-12)
"""Windows within this factor of the strongest are summed again, in OpenCV's order."""


def gaussian(length: int, sigma: float) -> NDArray[np.float32]:
    """Gaussian window of sum 1, as `cv2.getGaussianKernel` has it: of an even length, both middle weights are 1."""
    offsets = np.arange(length) - (length - 1) / 2
    weights = np.exp(-0.5 * (offsets / sigma) ** 2)
    weights[np.abs(offsets) < 1] = 1  # before scaling; an even length would ask for exp(−1 / 8σ²)
    normalised: NDArray[np.float32] = (weights * (1 / weights.sum())).astype(np.float32)
    return normalised


def circle_samples() -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Sample offsets (113, 2) as x, y in units of s, and their weights (113,)."""
    line = gaussian(2 * RADIUS + 1, WEIGHT_SIGMA)
    span = range(-RADIUS, RADIUS + 1)
    inside = [(x, y) for x in span for y in span if x * x + y * y <= RADIUS * RADIUS]
    weights = [line[x + RADIUS] * line[y + RADIUS] for x, y in inside]
    return np.array(inside), np.array(weights, dtype=np.float32)


_OFFSETS, _WEIGHTS = circle_samples()


def measure_angles(
    integral: NDArray[np.int32], shape: tuple[int, int], xy: NDArray[np.float32], size: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Angle of each key point, degrees in 0…360; `NO_SAMPLE` where no Haar filter fits into the image.

    Parameters
    ----------
    integral : (H + 1, at least W + 1) contiguous int32 array, see `padded_integral`.
    shape : (H, W) of the image, px.
    xy : (n, 2) float32 positions, px.
    size : (n,) float32 sizes, px.
    """
    angles = np.empty(len(size), dtype=np.float32)

    def measure(cut: tuple[int, int]) -> None:
        rows = slice(*cut)
        _measure_angles(integral, shape, xy[rows], size[rows], _OFFSETS, _WEIGHTS, angles[rows])

    map_parallel(measure, bands(len(size), 4 * thread_count()))
    return angles


@kernel
def _measure_angles(integral, shape, xy, size, offsets, weights, angles):
    samples = len(weights)
    sums = integral.reshape(-1)
    indices = np.empty((2, 2 * RADIUS + 1), dtype=np.int64)
    corners = np.empty(samples, dtype=np.int64)
    kept = np.empty(samples, dtype=np.float32)
    boxes = np.empty(4 * samples, dtype=np.int32)
    dx, dy = np.empty(samples, dtype=np.float32), np.empty(samples, dtype=np.float32)
    degrees = np.empty(samples, dtype=np.int32)
    work = np.empty(5 * _CIRCLE, dtype=np.float32)
    lengths = np.empty(_GROUPS, dtype=np.float32)
    for k in range(len(size)):
        s = size[k] * np.float32(1.2) / np.float32(9.0)
        half = np.int64(np.rint(np.float32(2.0) * s))
        _index_lines(xy[k, 0], s, half, shape[1], np.int64(1), indices[0])
        _index_lines(xy[k, 1], s, half, shape[0], integral.shape[1], indices[1])
        count = _index_samples(indices, offsets, weights, corners, kept)
        if count == 0:
            angles[k] = NO_SAMPLE
            continue
        _sum_boxes(sums, corners, count, half, half * integral.shape[1], boxes)
        _haar_responses(boxes, kept, U(count), np.float32(1.0) / np.float32(2 * half * half), dx, dy, degrees)
        _bin_directions(degrees, dx, dy, count, work)
        sum_x, sum_y = _strongest_window(degrees, dx, dy, count, work, lengths)
        angles[k] = fast_atan2(-sum_y, sum_x)


@part
def _index_lines(center, s, half, length, stride, indices):
    """First row or column, times the stride, of the Haar filters on each line of samples; −1 outside the image."""
    reach = np.float32(2 * half - 1) / np.float32(2.0)
    for k in range(2 * RADIUS + 1):
        first = np.int64(np.rint(center + np.float32(k - RADIUS) * s - reach))
        indices[k] = first * stride if 0 <= first <= length - 2 * half else -1


@part
def _index_samples(indices, offsets, weights, corners, kept):
    """Flat indices of the top-left corners of the Haar filters inside the image, and their weights; their number."""
    count = 0
    for k in range(len(weights)):
        column, row = indices[0, U(offsets[k, 0] + RADIUS)], indices[1, U(offsets[k, 1] + RADIUS)]
        corners[U(count)] = row + column
        kept[U(count)] = weights[k]
        count += (row | column) >= 0
    return count


@part
def _sum_boxes(sums, corners, count, half, half_rows, boxes):
    """Sums of the west, east, north and south halves of the Haar filters, one after the other."""
    for k in range(count):
        at = corners[k]
        a0, a1, a2 = sums[U(at)], sums[U(at + half)], sums[U(at + 2 * half)]
        at += half_rows
        m0, m2 = sums[U(at)], sums[U(at + 2 * half)]
        at += half_rows
        b0, b1, b2 = sums[U(at)], sums[U(at + half)], sums[U(at + 2 * half)]
        boxes[U(k)] = np.int32((b1 - b0) - (a1 - a0))
        boxes[U(k + count)] = np.int32((b2 - b1) - (a2 - a1))
        boxes[U(k + 2 * count)] = np.int32((m2 - m0) - (a2 - a0))
        boxes[U(k + 3 * count)] = np.int32((b2 - b0) - (m2 - m0))


@part
def _haar_responses(boxes, weights, count, mean, dx, dy, degrees):
    """Weighted Haar responses and their direction in whole degrees 0…359, each box mean rounded as OpenCV's."""
    east, north = count, count + count
    south = north + count
    for k in range(count):
        dx[k] = (np.float32(boxes[east + k]) * mean - np.float32(boxes[k]) * mean) * weights[k]
        dy[k] = (np.float32(boxes[north + k]) * mean - np.float32(boxes[south + k]) * mean) * weights[k]
    for k in range(count):
        degree = np.int32(np.rint(fast_atan2(dy[k], dx[k])))
        degrees[k] = degree if degree < np.int32(360) else np.int32(0)


@part
def _bin_directions(degrees, dx, dy, count, work):
    """Sum the vectors by direction: x and y of the exact multiples of 5°, then x and y of the whole groups of 5°.

    The circle begins six groups early and ends six late, so that windows need not wrap.
    """
    work[: 4 * _CIRCLE] = 0
    for k in range(count):
        group = degrees[k] // np.int32(5)
        rest = degrees[k] != 5 * group
        at = U(group + 6 + 2 * _CIRCLE * rest)
        work[at] += dx[k]
        work[at + U(_CIRCLE)] += dy[k]
    for first in range(0, 4 * _CIRCLE, _CIRCLE):
        for k in range(6):
            work[first + k] = work[first + _GROUPS + k]
            work[first + _GROUPS + 6 + k] = work[first + 6 + k]


@part
def _strongest_window(degrees, dx, dy, count, work, lengths):
    """Sum of the vectors in the 60° window, tried every 5°, where that sum is longest.

    Sums over groups tell which windows can win; only those are summed vector by vector, in OpenCV's order.
    """
    lengths[:] = 0
    _add_window_lengths(work, U(0), lengths)
    _add_window_lengths(work, U(_CIRCLE), lengths)
    highest = np.float32(0.0)
    for window in range(_GROUPS):
        highest = max(highest, lengths[window])
    best = best_x = best_y = np.float32(0.0)
    for window in range(_GROUPS):
        if lengths[window] >= highest * _CLOSE:
            sum_x, sum_y = _sum_window(degrees, dx, dy, count, np.int32(5 * window))
            length = sum_x * sum_x + sum_y * sum_y
            if length > best:
                best, best_x, best_y = length, sum_x, sum_y
    return best_x, best_y


@part
def _add_window_lengths(work, exact, lengths):
    """Add the squared sum over each window: twelve groups from six early on, without the first exact multiple of 5°."""
    rest, pairs = exact + U(2 * _CIRCLE), U(4 * _CIRCLE)
    for k in range(U(_CIRCLE)):
        work[rest + k] += work[exact + k]
    for k in range(U(_CIRCLE - 1)):
        work[pairs + k] = work[rest + k] + work[rest + k + U(1)]
    for k in range(U(_CIRCLE - 3)):
        work[pairs + k] += work[pairs + k + U(2)]
    for k in range(U(_GROUPS)):
        total = work[pairs + k] + work[pairs + k + U(4)] + work[pairs + k + U(8)] - work[exact + k]
        lengths[k] += total * total


@part
def _sum_window(degrees, dx, dy, count, center):
    """Sum of the vectors less than 30° from the centre, in order."""
    sum_x = sum_y = np.float32(0.0)
    for k in range(count):
        apart = abs(np.int32(degrees[k] - center))
        inside = (apart < 30) | (apart > 330)
        sum_x += dx[k] if inside else np.float32(0.0)
        sum_y += dy[k] if inside else np.float32(0.0)
    return sum_x, sum_y


@part
def fast_atan2(y, x):
    """Angle of (x, y) in degrees, 0…360: OpenCV's polynomial of order 7, good to 0.01°."""
    p1, p3 = np.float32(57.283627), np.float32(-18.667446)
    p5, p7 = np.float32(8.9140005), np.float32(-2.5397246)
    tiny = np.float32(2.220446049250313e-16)
    ax, ay = abs(x), abs(y)
    c = min(ax, ay) / (max(ax, ay) + tiny)
    c2 = c * c
    angle = (((p7 * c2 + p5) * c2 + p3) * c2 + p1) * c
    angle = np.float32(90.0) - angle if ay > ax else angle
    angle = np.float32(180.0) - angle if x < 0 else angle
    return np.float32(360.0) - angle if y < 0 else angle
