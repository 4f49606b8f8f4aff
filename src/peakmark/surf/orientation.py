"""SURF's orientation: the strongest 60° window of Haar responses around a key point."""

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.parallel import bands, map_parallel, thread_count

RADIUS = 6
"""Radius of the circle of samples, in units of the key point's s = 1.2 size / 9."""
WEIGHT_SIGMA = 2.5
"""Standard deviation of the samples' Gaussian weights, in units of s; OpenCV's."""
UPRIGHT_DEG = 270.0
"""Angle of upright key points, as OpenCV writes it."""
NO_SAMPLE = -1.0
"""Angle of a key point without a single sample inside the image."""

_measure_angles = function(
    "void measure_angles(const i4[rows,stride] integral, i8 height, i8 width, const f4[n,2] xy, const f4[n] size, "
    "const i8[113,2] offsets, const f4[113] weights, f4[n] angles)"
)
_fast_atan2 = function("void fast_atan2(const f4[n] y, const f4[n] x, f4[n] degrees)")


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
        _measure_angles(integral, *shape, xy[rows], size[rows], _OFFSETS, _WEIGHTS, angles[rows])

    map_parallel(measure, bands(len(size), 4 * thread_count()))
    return angles


def fast_atan2(y: NDArray[np.float32], x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the angles of (n,) points (x, y) in degrees, 0…360: OpenCV's polynomial of order 7, good to 0.01°."""
    degrees = np.empty(len(y), dtype=np.float32)
    _fast_atan2(y, x, degrees)
    return degrees
