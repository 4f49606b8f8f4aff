"""Kernel for SURF's orientation: the strongest 60° window of Haar responses around a key point."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peakmark.parallel import bands, map_parallel, thread_count

RADIUS = 6
"""Radius of the circle of samples, in units of the key point's s = 1.2 size / 9."""
WEIGHT_SIGMA = 2.5
UPRIGHT_DEG = 270.0
"""Angle of upright key points, as OpenCV writes it."""
NO_SAMPLE = -1.0
"""Angle of a key point without a single sample inside the image."""


def gaussian(length: int, sigma: float) -> NDArray[np.float32]:
    """Gaussian window of sum 1, as `cv2.getGaussianKernel` has it: an even length gets 1 for both middle weights."""
    offsets = np.arange(length) - (length - 1) / 2
    weights = np.exp(-0.5 * (offsets / sigma) ** 2)
    weights[np.abs(offsets) < 1] = 1  # even lengths: not exp(−1 / 8 σ²)
    normalised: NDArray[np.float32] = (weights * (1 / weights.sum())).astype(np.float32)
    return normalised


def circle_samples() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Sample offsets (113, 2) as x, y in units of s, and their weights (113,)."""
    line = gaussian(2 * RADIUS + 1, WEIGHT_SIGMA)
    span = range(-RADIUS, RADIUS + 1)
    inside = [(x, y) for x in span for y in span if x * x + y * y <= RADIUS * RADIUS]
    weights = [line[x + RADIUS] * line[y + RADIUS] for x, y in inside]
    return np.array(inside, dtype=np.float32), np.array(weights, dtype=np.float32)


_OFFSETS, _WEIGHTS = circle_samples()


def measure_angles(
    integral: NDArray[np.int32], xy: NDArray[np.float32], size: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Angle of each key point, degrees in 0…360; `NO_SAMPLE` where no Haar filter fits into the image.

    Parameters
    ----------
    integral : (H + 1, W + 1) int32 array.
    xy : (n, 2) float32 positions, px.
    size : (n,) float32 sizes, px.
    """
    angles = np.empty(len(size), dtype=np.float32)
    cuts = bands(len(size), 4 * thread_count())
    map_parallel(
        lambda cut: _measure_angles(integral, xy[slice(*cut)], size[slice(*cut)], _OFFSETS, _WEIGHTS, angles[slice(*cut)]),
        cuts,
    )
    return angles


@njit(cache=True, nogil=True)
def _measure_angles(integral, xy, size, offsets, weights, angles):  # type: ignore[no-untyped-def]
    dx = np.empty(len(weights), dtype=np.float32)
    dy = np.empty(len(weights), dtype=np.float32)
    degrees = np.empty(len(weights), dtype=np.int32)
    for k in range(len(size)):
        count = _haar_samples(integral, xy[k, 0], xy[k, 1], size[k], offsets, weights, dx, dy)
        if count == 0:
            angles[k] = NO_SAMPLE
            continue
        for j in range(count):
            degrees[j] = np.int32(np.rint(fast_atan2(dy[j], dx[j])))
        sum_x, sum_y = _strongest_window(degrees[:count], dx[:count], dy[:count])
        angles[k] = fast_atan2(-sum_y, sum_x)


@njit(cache=True, nogil=True)
def _haar_samples(integral, x, y, size, offsets, weights, dx, dy):  # type: ignore[no-untyped-def]
    """Weighted Haar responses of the samples inside the image, in order; returns their number."""
    s = size * np.float32(1.2) / np.float32(9.0)
    half = np.int32(np.rint(np.float32(2.0) * s))
    side = 2 * half
    rows, columns = integral.shape[0] - side, integral.shape[1] - side
    corner = np.float32(side - 1) / np.float32(2.0)
    mean = np.float32(1.0) / np.float32(half * side)
    count = 0
    for k in range(len(weights)):
        left = np.int64(np.rint(x + offsets[k, 0] * s - corner))
        top = np.int64(np.rint(y + offsets[k, 1] * s - corner))
        if top < 0 or top >= rows or left < 0 or left >= columns:
            continue
        above, middle, below = integral[top], integral[top + half], integral[top + side]
        a0, a1, a2 = above[left], above[left + half], above[left + side]
        m0, m2 = middle[left], middle[left + side]
        b0, b1, b2 = below[left], below[left + half], below[left + side]
        west, east = _mean(b1 - b0 - a1 + a0, mean), _mean(b2 - b1 - a2 + a1, mean)
        north, south = _mean(m2 - m0 - a2 + a0, mean), _mean(b2 - b0 - m2 + m0, mean)
        dx[count] = (east - west) * weights[k]
        dy[count] = (north - south) * weights[k]
        count += 1
    return count


@njit(cache=True, nogil=True, inline="always")
def _mean(box_sum, one_by_area):  # type: ignore[no-untyped-def]
    return np.float32(np.int32(box_sum)) * one_by_area


@njit(cache=True, nogil=True)
def _strongest_window(degrees, dx, dy):  # type: ignore[no-untyped-def]
    """Sum of the vectors in the 60° window, tried every 5°, where that sum is longest."""
    best = best_x = best_y = np.float32(0.0)
    for center in range(0, 360, 5):
        sum_x = sum_y = np.float32(0.0)
        for j in range(degrees.size):
            apart = abs(degrees[j] - center)
            if apart < 30 or apart > 330:
                sum_x += dx[j]
                sum_y += dy[j]
        strength = sum_x * sum_x + sum_y * sum_y
        if strength > best:
            best, best_x, best_y = strength, sum_x, sum_y
    return best_x, best_y


@njit(cache=True, nogil=True)
def fast_atan2(y, x):  # type: ignore[no-untyped-def]
    """Angle of (x, y) in degrees, 0…360: OpenCV's polynomial of order 7, good to 0.01°."""
    p1, p3 = np.float32(57.283627), np.float32(-18.667446)
    p5, p7 = np.float32(8.9140005), np.float32(-2.5397246)
    tiny = np.float32(2.220446049250313e-16)
    ax, ay = abs(x), abs(y)
    c = min(ax, ay) / (max(ax, ay) + tiny)
    c2 = c * c
    angle = (((p7 * c2 + p5) * c2 + p3) * c2 + p1) * c
    if ay > ax:
        angle = np.float32(90.0) - angle
    if x < 0:
        angle = np.float32(180.0) - angle
    if y < 0:
        angle = np.float32(360.0) - angle
    return angle
