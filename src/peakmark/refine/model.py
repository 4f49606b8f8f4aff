"""What a camera shows of a known pattern, as an analytic function of where it lies: plain NumPy and Numba.

A pattern point u (sides; the pattern covers |u| ≤ ½, x right and y down) is seen at ``c + A u / (1 + g·u)`` px.
Its grey levels lie on a grid whose lines are the same along both axes. A pixel sees the pattern through its own
square and a Gaussian blur of variance b. Carried back to u, and each axis taken for itself, the square becomes
the sum of two boxes: the wider one is kept, the other's variance joins the Gaussian's, so every grid line is a
step smoothed by a box and a Gaussian. For upright squares that is exact.

Parameters, in this order: cx, cy [px], a11, a12, a21, a22 [px per side], g1, g2 [per side], gain, offset [grey
levels], b [px²].
"""

from dataclasses import dataclass
from math import exp, floor, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray
from peaksim.kernel import kernel
from scipy.special import ndtr

PARAMETERS = 11
"""Number of parameters."""

PIXEL_VARIANCE = 1 / 12
"""Variance of the position within a pixel, px² along each axis."""

_REACH = 3.5
"""Standard deviations at which the Gaussian is cut off: 5e-4 of a step is left out."""

_MIN_DEPTH = 0.05
"""Least 1 + g·u at which a pattern point counts as before the horizon."""

_DENSITY = 1 / sqrt(2 * np.pi)
"""Of the normal distribution at its middle."""


@dataclass(frozen=True)
class Pattern:
    """A piecewise constant pattern on a grid of lines, seen only where |u| and |v| ≤ `extent`."""

    lines: NDArray[np.float64]
    """(k,) rising positions along both axes, sides."""
    levels: NDArray[np.float64]
    """(k + 1, k + 1) levels 0…1, row by row; the first and last row and column reach to infinity."""
    extent: float
    """Half the side of what is compared with the image, in sides; beyond it anything may be."""


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
        return np.asarray(z * ndtr(z) + _DENSITY * np.exp(-(z**2) / 2))

    return (antiderivative((t + width / 2) / sigma) - antiderivative((t - width / 2) / sigma)) * sigma / width


def pattern_points(
    parameters: NDArray[np.float64], xy: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pattern points u (n, 2) that are seen at xy (n, 2), and ∂u/∂(x, y) as (n, 2, 2)."""
    center, A, g = parameters[:2], parameters[2:6].reshape(2, 2), parameters[6:8]
    d = xy - center
    inverse = np.linalg.inv(A - d[:, :, None] * g)
    u = np.einsum("nij,nj->ni", inverse, d)
    return u, (1 + u @ g)[:, None, None] * inverse


@kernel
def select_pixels(parameters, lines, extent, width, height, stride):
    """Return the pixels (n, 2), as x and y, that lie inside the extent and are worth comparing.

    Pixels within reach of a line are taken where (x + y) is divisible by `stride`; the others, which only tell
    gain and offset, on a grid four times as wide.
    """
    left, top, right, bottom = _bounds(parameters, extent, width, height)
    found = np.empty((max(0, right - left) * max(0, bottom - top), 2), np.int32)
    count = 0
    reach = 2.5 * sqrt(PIXEL_VARIANCE + parameters[10])
    for y in range(top, bottom):
        for x in range(left, right):
            u, v, w, ux, uy, vx, vy = _pattern_point(parameters, x, y)
            reach_u, reach_v = reach * sqrt(ux * ux + uy * uy), reach * sqrt(vx * vx + vy * vy)
            if w <= _MIN_DEPTH or abs(u) > extent - reach_u or abs(v) > extent - reach_v:
                continue
            near = False
            for k in range(lines.size):
                near |= abs(u - lines[k]) < 1.4 * reach_u or abs(v - lines[k]) < 1.4 * reach_v
            if (x + y) % stride == 0 if near else x % (4 * stride) == 0 and y % (4 * stride) == 0:
                found[count, 0], found[count, 1] = x, y
                count += 1
    return found[:count]


@njit(cache=True, inline="always", error_model="numpy")
def _pattern_point(parameters, x, y):
    """Return u, v, w = 1 + g·u and ∂u/∂x, ∂u/∂y, ∂v/∂x, ∂v/∂y at a pixel; w = 0 beyond the horizon."""
    dx, dy = x - parameters[0], y - parameters[1]
    b11, b12 = parameters[2] - dx * parameters[6], parameters[3] - dx * parameters[7]
    b21, b22 = parameters[4] - dy * parameters[6], parameters[5] - dy * parameters[7]
    determinant = b11 * b22 - b12 * b21
    if determinant <= 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    u, v = (b22 * dx - b12 * dy) / determinant, (b11 * dy - b21 * dx) / determinant
    w = 1 + parameters[6] * u + parameters[7] * v
    scale = w / determinant
    return u, v, w, scale * b22, -scale * b12, -scale * b21, scale * b11


@kernel
def residuals(gray, pixels, parameters, lines, levels):
    """Return image − prediction (n,) at pixels (n, 2) and the prediction's derivatives (11, n).

    The derivatives leave out how A and g change the blur. Beyond the pattern's horizon the residual is 255.
    """
    difference, jacobian = np.full(len(pixels), 255.0), np.zeros((PARAMETERS, len(pixels)))
    gain, offset, blur = parameters[8], parameters[9], parameters[10]
    shares = np.empty((6, lines.size + 1))
    for i in range(len(pixels)):
        x, y = pixels[i, 0], pixels[i, 1]
        u, v, w, ux, uy, vx, vy = _pattern_point(parameters, x, y)
        if w <= _MIN_DEPTH:
            continue
        blur_u, blur_v = blur * (ux * ux + uy * uy), blur * (vx * vx + vy * vy)
        u_first, u_last = _steps(u, abs(ux), abs(uy), blur_u, lines, shares[0], shares[1], shares[2])
        v_first, v_last = _steps(v, abs(vx), abs(vy), blur_v, lines, shares[3], shares[4], shares[5])
        seen, du, dv, db = 0.0, 0.0, 0.0, 0.0
        for row in range(v_first, v_last + 1):
            across, slope, bend = 0.0, 0.0, 0.0
            for column in range(u_first, u_last + 1):
                level = levels[row, column]
                across += level * shares[0, column]
                slope += level * shares[1, column]
                bend += level * shares[2, column]
            seen += shares[3, row] * across
            du += shares[3, row] * slope
            dv += shares[4, row] * across
            db += shares[3, row] * bend * blur_u + shares[5, row] * across * blur_v
        # (px, py) is the prediction's gradient in the image; ∂prediction/∂θ = −(px, py)·∂x/∂θ at fixed u
        px, py = gain * (du * ux + dv * vx), gain * (du * uy + dv * vy)
        along = px * (x - parameters[0]) + py * (y - parameters[1])
        jacobian[0, i], jacobian[1, i] = -px, -py
        jacobian[2, i], jacobian[3, i] = -px * u / w, -px * v / w
        jacobian[4, i], jacobian[5, i] = -py * u / w, -py * v / w
        jacobian[6, i], jacobian[7, i] = along * u / w, along * v / w
        jacobian[8, i], jacobian[9, i], jacobian[10, i] = seen, 1.0, gain * db / (2 * blur)
        difference[i] = gray[y, x] - offset - gain * seen
    return difference, jacobian


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def gram(rows):
    """Return rows @ rowsᵀ of (k, n), in an order of summation that no thread count changes."""
    k, n = rows.shape
    result = np.empty((k, k))
    for a in range(k):
        for b in range(a + 1):
            total = 0.0
            for i in range(n):
                total += rows[a, i] * rows[b, i]
            result[a, b] = result[b, a] = total
    return result


@njit(cache=True, inline="always", error_model="numpy")
def _steps(u, width, other, blur, lines, value, slope, bend):
    """Fill each interval's share of what a pixel at u sees, with its first and second derivative by u.

    The pixel is a box of the greater of `width` and `other` and a Gaussian, see `smooth_step`. Returns the
    first and the last interval that it sees; interval k ends at line k.
    """
    if other > width:
        width, other = other, width
    sigma = sqrt(other * other / 12 + blur)
    reach = width / 2 + _REACH * sigma
    k = 0
    while k < lines.size and u - lines[k] > reach:
        k += 1
    first = k
    above, above_slope, above_bend = 1.0, 0.0, 0.0
    while k < lines.size and lines[k] - u < reach:
        high, low = (u - lines[k] + width / 2) / sigma, (u - lines[k] - width / 2) / sigma
        high_step, high_density = _normal(high)
        low_step, low_density = _normal(low)
        step = (high * high_step + high_density - low * low_step - low_density) * sigma / width
        step_slope, step_bend = (high_step - low_step) / width, (high_density - low_density) / (sigma * width)
        value[k], slope[k], bend[k] = above - step, above_slope - step_slope, above_bend - step_bend
        above, above_slope, above_bend = step, step_slope, step_bend
        k += 1
    value[k], slope[k], bend[k] = above, above_slope, above_bend
    return first, k


@njit(cache=True, inline="always", error_model="numpy")
def _normal(z):
    """Return the normal distribution and its density, within 1e-7 (Abramowitz & Stegun 26.2.17)."""
    density = _DENSITY * exp(-0.5 * z * z)
    t = 1 / (1 + 0.2316419 * abs(z))
    series = t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))))
    tail = density * series
    return (1 - tail if z > 0 else tail), density


@kernel
def _bounds(parameters, extent, width, height):
    """Return the pixels left, top, right end and bottom end around the pattern's extent, inside the image."""
    x_low, y_low, x_high, y_high = 1e9, 1e9, -1e9, -1e9
    for k in range(4):
        u = extent if k % 2 else -extent
        v = extent if k // 2 else -extent
        w = max(1 + parameters[6] * u + parameters[7] * v, _MIN_DEPTH)
        x = parameters[0] + (parameters[2] * u + parameters[3] * v) / w
        y = parameters[1] + (parameters[4] * u + parameters[5] * v) / w
        x_low, x_high = min(x_low, x), max(x_high, x)
        y_low, y_high = min(y_low, y), max(y_high, y)
    left, top = max(0.0, floor(x_low)), max(0.0, floor(y_low))
    right_end, bottom = min(float(width), floor(x_high) + 2), min(float(height), floor(y_high) + 2)
    return int(min(left, width)), int(min(top, height)), int(max(right_end, 0.0)), int(max(bottom, 0.0))
