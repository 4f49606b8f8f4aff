"""What a camera shows of a known pattern, as an analytic function of where it lies: plain NumPy, and C.

A pattern point u (sides; the pattern covers |u| ≤ ½, x right and y down) is seen at ``c + A u / (1 + g·u)`` px.
Its grey levels lie on a grid whose lines are the same along both axes. A pixel sees the pattern through its own
square and a Gaussian blur of variance b. Carried back to u, and each axis taken for itself, the square becomes
the sum of two boxes: the wider one is kept, the other's variance joins the Gaussian's, so every grid line is a
step smoothed by a box and a Gaussian. For upright squares that is exact.

Parameters, in this order: cx, cy [px], a11, a12, a21, a22 [px per side], g1, g2 [per side], gain, offset [grey
levels], b [px²].
"""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

PARAMETERS = 11
"""Number of parameters."""

_DENSITY = 1 / sqrt(2 * np.pi)
"""Of the normal distribution at its middle."""

_bounded_area = function("i8 bounded_area(const f8[11] theta, f8 extent, i8 height, i8 width)")
_normal_distribution = function("void normal_distribution(const f8[n] z, f8[n] values)")
_select_pixels = function(
    "i8 select_pixels(const f8[11] theta, const f8[line_count] lines, f8 extent, i8 height, i8 width, i8 stride, "
    "i4[room,2] xy, b1[room] near)"
)
_residuals = function(
    "status residuals(const f4[n] seen, const i4[n,2] xy, const f8[11] theta, const f8[line_count] lines, "
    "const f8[rows,intervals] levels, f8[n] r, f8[11,n] jacobian)"
)


@dataclass(frozen=True)
class Pattern:
    """A piecewise constant pattern on a grid of lines, seen only where |u| and |v| ≤ `extent`.

    A round one has levels (1, k) at its k lines, which are radii, is linear between them, and is seen up to the radius
    `extent`.
    """

    lines: NDArray[np.float64]
    """(k,) rising positions along both axes, sides."""
    levels: NDArray[np.float64]
    """(k + 1, k + 1) levels 0…1, row by row; the first and last row and column reach to infinity."""
    extent: float
    """Half the side of what is compared with the image, in sides; beyond it anything may be."""

    @property
    def is_round(self) -> bool:
        """Whether the lines are radii."""
        return len(self.levels) == 1


def predict(parameters: NDArray[np.float64], xy: NDArray[np.float64], pattern: Pattern) -> NDArray[np.float64]:
    """Return the grey levels (n,) that pixels at xy (n, 2) show, whether inside the extent or not."""
    u, u_by_px = pattern_points(parameters, xy)
    widths = np.sort(np.abs(u_by_px), axis=2)
    variance = widths[:, :, 0] ** 2 / 12 + parameters[10] * (widths**2).sum(axis=2)
    step = smooth_step(u[:, :, None] - pattern.lines, widths[:, :, 1:], np.sqrt(variance)[:, :, None])
    ones, zeros = np.ones_like(step[:, :, :1]), np.zeros_like(step[:, :, :1])
    share = -np.diff(np.concatenate([ones, step, zeros], axis=2), axis=2)
    seen = np.einsum("nj,ni,ij->n", share[:, 0], share[:, 1], pattern.levels)
    return np.asarray(parameters[9] + parameters[8] * seen)


def smooth_step(t: NDArray[np.float64], width: NDArray[np.float64], sigma: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the step function seen through a box of `width` and a Gaussian of `sigma`, at distance t from it."""

    def antiderivative(z: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(z * normal_distribution(z) + _DENSITY * np.exp(-(z**2) / 2))

    return (antiderivative((t + width / 2) / sigma) - antiderivative((t - width / 2) / sigma)) * sigma / width


def normal_distribution(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard normal distribution at z of any shape, within 1e-15."""
    values = np.empty(z.size)
    _normal_distribution(z.reshape(-1), values)
    return values.reshape(z.shape)


def pattern_points(
    parameters: NDArray[np.float64], xy: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pattern points u (n, 2) that are seen at xy (n, 2), and ∂u/∂(x, y) as (n, 2, 2)."""
    center, A, g = parameters[:2], parameters[2:6].reshape(2, 2), parameters[6:8]
    d = xy - center
    inverse = np.linalg.inv(A - d[:, :, None] * g)
    u = np.einsum("nij,nj->ni", inverse, d)
    return u, (1 + u @ g)[:, None, None] * inverse


def select_pixels(
    parameters: NDArray[np.float64], lines: NDArray[np.float64], extent: float, width: int, height: int, stride: int
) -> NDArray[np.int32]:
    """Return the pixels (n, 2), as x and y, that lie inside the extent and are worth comparing.

    Pixels within reach of a line are taken where (x + y) is divisible by `stride`; the others, which only tell
    gain and offset, on a grid four times as wide.
    """
    room = _bounded_area(parameters, extent, height, width)
    found = np.empty((room, 2), np.int32)
    count = _select_pixels(parameters, lines, extent, height, width, stride, found, np.empty(room, np.bool_))
    return found[:count]


def residuals(
    gray: NDArray[Any],
    pixels: NDArray[np.int32],
    parameters: NDArray[np.float64],
    lines: NDArray[np.float64],
    levels: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return image − prediction (n,) at pixels (n, 2) and the prediction's derivatives (11, n).

    The derivatives leave out how A and g change the blur. Beyond the pattern's horizon the residual is 255.
    """
    difference, jacobian = np.empty(len(pixels)), np.empty((PARAMETERS, len(pixels)))
    _residuals(levels_at(gray, pixels), pixels, parameters, lines, levels, difference, jacobian)
    return difference, jacobian


def levels_at(gray: NDArray[Any], pixels: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return the levels (n,) of an image at pixels (n, 2)."""
    return np.asarray(gray[pixels[:, 1], pixels[:, 0]], dtype=np.float32)
