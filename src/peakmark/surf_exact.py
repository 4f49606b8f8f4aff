"""Kernels that settle a candidate key point in OpenCV's own arithmetic: response, maximum, mask and Newton step.

The fast responses of `surf_hessian` rest on exact integer sums and differ from OpenCV's in the last bits, because
OpenCV rounds every box mean to single precision. Here the same roundings are made in the same order.
"""

import numpy as np
from numba import njit

from peakmark.surf_layers import DXY_WEIGHT

_DXY = np.float32(DXY_WEIGHT)


@njit(cache=True, nogil=True, inline="always")
def box_sum(integral, y0, x0, y1, x1):  # type: ignore[no-untyped-def]
    """Sum over the half-open box, from an integral image modulo 2^32."""
    return np.int32(integral[y0, x0] + integral[y1, x1] - integral[y0, x1] - integral[y1, x0])


@njit(cache=True, nogil=True)
def exact_derivatives(integral, y, x, side):  # type: ignore[no-untyped-def]
    """Dxx, Dyy and Dxy of the filter with its corner at (x, y), in OpenCV's arithmetic and order."""
    third = side // 3
    low = (4 * side + 9) // 18
    high = side - low
    mean = np.float32(1.0) / np.float32(third * (high - low))
    dxx = np.float64(0.0)
    dyy = np.float64(0.0)
    for k in range(3):
        weight = np.float32(-2.0) * mean if k == 1 else mean
        a, b = k * third, (k + 1) * third
        dxx += np.float32(box_sum(integral, y + low, x + a, y + high, x + b)) * weight
        dyy += np.float32(box_sum(integral, y + a, x + low, y + b, x + high)) * weight
    near = (2 * side + 9) // 18
    far = side - near - third
    mean = np.float32(1.0) / np.float32(third * third)
    dxy = np.float64(0.0)
    for a in (near, far):
        for b in (near, far):
            weight = mean if a == b else -mean
            dxy += np.float32(box_sum(integral, y + a, x + b, y + a + third, x + b + third)) * weight
    return np.float32(dxx), np.float32(dyy), np.float32(dxy)


@njit(cache=True, nogil=True)
def exact_response(integral, y, x, side):  # type: ignore[no-untyped-def]
    """Determinant of the Hessian, of the filter with its corner at (x, y)."""
    dxx, dyy, dxy = exact_derivatives(integral, y, x, side)
    return dxx * dyy - _DXY * dxy * dxy


@njit(cache=True, nogil=True)
def fill_exact_layer(integral, octave, index, i, j, values):  # type: ignore[no-untyped-def]
    """Responses of a layer at the 3×3 grid places around (i, j)."""
    step = 1 << octave
    offset, side = 4 + 3 * index, (9 + 6 * index) << octave
    for di in range(3):
        for dj in range(3):
            y, x = (i + di - 1 - offset) * step, (j + dj - 1 - offset) * step
            values[di, dj] = exact_response(integral, y, x, side)


@njit(cache=True, nogil=True)
def strongest_neighbour(cube):  # type: ignore[no-untyped-def]
    """Largest of the 26 values around the middle of a (3, 3, 3) cube."""
    strongest = np.float32(-np.inf)
    for s in range(3):
        for i in range(3):
            for j in range(3):
                if not s == i == j == 1:
                    strongest = max(strongest, cube[s, i, j])
    return strongest


@njit(cache=True, nogil=True)
def mask_accepts(mask, y, x, side):  # type: ignore[no-untyped-def]
    """OpenCV's rule: at least half of the filter square is inside the mask."""
    covered = np.float32(box_sum(mask, y, x, y + side, x + side))
    return covered * (np.float32(1.0) / np.float32(side * side)) >= np.float32(0.5)


@njit(cache=True, nogil=True)
def newton_offset(cube):  # type: ignore[no-untyped-def]
    """Step (ok, dx, dy, ds) to the maximum near the middle of a (3, 3, 3) cube over layer, row and column.

    Not ok where the step is exactly zero or longer than 1 along an axis. Cramer's rule, rounded as OpenCV's.
    """
    below, here, above = cube[0], cube[1], cube[2]
    two, half, quarter = np.float32(2.0), np.float32(0.5), np.float32(0.25)
    v = here[1, 1]
    bx = (here[1, 0] - here[1, 2]) * half
    by = (here[0, 1] - here[2, 1]) * half
    bs = (below[1, 1] - above[1, 1]) * half
    xx = here[1, 0] - two * v + here[1, 2]
    yy = here[0, 1] - two * v + here[2, 1]
    ss = below[1, 1] - two * v + above[1, 1]
    xy = (here[2, 2] - here[2, 0] - here[0, 2] + here[0, 0]) * quarter
    xs = (above[1, 2] - above[1, 0] - below[1, 2] + below[1, 0]) * quarter
    ys = (above[2, 1] - above[0, 1] - below[2, 1] + below[0, 1]) * quarter
    determinant = np.float64(xx * (yy * ss - ys * ys) - xy * (xy * ss - ys * xs) + xs * (xy * ys - yy * xs))
    if determinant == 0.0:
        return False, np.float32(0), np.float32(0), np.float32(0)
    d = np.float32(1.0 / determinant)
    dx = d * (bx * (yy * ss - ys * ys) - xy * (by * ss - ys * bs) + xs * (by * ys - yy * bs))
    dy = d * (xx * (by * ss - ys * bs) - bx * (xy * ss - ys * xs) + xs * (xy * bs - by * xs))
    ds = d * (xx * (yy * bs - by * ys) - xy * (xy * bs - by * xs) + bx * (xy * ys - yy * xs))
    one = np.float32(1.0)
    moves = dx != 0 or dy != 0 or ds != 0
    return moves and abs(dx) <= one and abs(dy) <= one and abs(ds) <= one, dx, dy, ds
