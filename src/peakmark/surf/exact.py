"""Kernels that settle a candidate key point in OpenCV's own arithmetic: response, maximum, mask and Newton step.

The fast responses of `hessian` rest on exact integer sums and differ from OpenCV's in the last bits, because
OpenCV rounds every box mean to single precision. Here the same roundings are made in the same order.
"""

import numpy as np
from peaksim.kernel import part

from peakmark.markers.patterns import DXY_WEIGHT

U = np.uint64
_DXY = np.float32(DXY_WEIGHT)


@part
def exact_derivatives(sums, stride, corner, side):
    """Dxx, Dyy and Dxy of the filter with its corner at sums[corner], in OpenCV's arithmetic and order.

    Parameters
    ----------
    sums, stride : the integral image row by row, and the length of a row.
    corner : index in `sums` of the filter's top-left corner.
    side : side of the filter, px.
    """
    third = side // 3
    low = (4 * side + 9) // 18
    mean = np.float32(1.0) / np.float32(third * (side - 2 * low))
    dxx = _thirds(sums, corner + low * stride, (side - 2 * low) * stride, third, mean)
    dyy = _thirds(sums, corner + low, side - 2 * low, third * stride, mean)
    near = (2 * side + 9) // 18
    far = side - near - third
    mean = np.float32(1.0) / np.float32(third * third)
    rows = third * stride
    dxy = np.float64(0.0)
    dxy += _box_mean(sums, corner + near * stride + near, rows, third, mean)
    dxy -= _box_mean(sums, corner + near * stride + far, rows, third, mean)
    dxy -= _box_mean(sums, corner + far * stride + near, rows, third, mean)
    dxy += _box_mean(sums, corner + far * stride + far, rows, third, mean)
    return dxx, dyy, np.float32(dxy)


@part
def _thirds(sums, corner, across, along, mean):
    """First − 2 middle + last third of a box, as means; `across` and `along` are steps in `sums`."""
    first = _box_mean(sums, corner, across, along, mean)
    middle = _box_mean(sums, corner + along, across, along, np.float32(-2.0) * mean)
    last = _box_mean(sums, corner + 2 * along, across, along, mean)
    return np.float32(np.float64(first) + np.float64(middle) + np.float64(last))


@part
def box_sum(sums, corner, down, right):
    """Sum over the box from sums[corner] to sums[corner + down + right], modulo 2^32."""
    a, b = sums[U(corner)], sums[U(corner + right)]
    c, d = sums[U(corner + down)], sums[U(corner + down + right)]
    return np.int32(a + d - b - c)


@part
def _box_mean(sums, corner, down, right, one_by_area):
    return np.float32(box_sum(sums, corner, down, right)) * one_by_area


@part
def exact_response(sums, stride, corner, side):
    """Determinant of the Hessian, see `exact_derivatives`."""
    dxx, dyy, dxy = exact_derivatives(sums, stride, corner, side)
    return dxx * dyy - _DXY * dxy * dxy


@part
def quick_response(sums, stride, corner, side):
    """`exact_response` but for the last bits: each derivative is one integer before it is rounded."""
    third = side // 3
    low = (4 * side + 9) // 18
    dxx = _sum_thirds(sums, corner + low * stride, (side - 2 * low) * stride, third)
    dyy = _sum_thirds(sums, corner + low, side - 2 * low, third * stride)
    near = (2 * side + 9) // 18
    far = side - near - third
    rows = third * stride
    upper, lower = corner + near * stride, corner + far * stride
    dxy = box_sum(sums, upper + near, rows, third) - box_sum(sums, upper + far, rows, third)
    dxy += box_sum(sums, lower + far, rows, third) - box_sum(sums, lower + near, rows, third)
    mean = np.float32(1.0 / (third * (side - 2 * low)))
    mixed = np.float32(np.int32(dxy)) * np.float32(1.0 / (third * third))
    return np.float32(dxx) * mean * (np.float32(dyy) * mean) - _DXY * mixed * mixed


@part
def _sum_thirds(sums, corner, across, along):
    """First − 2 middle + last third of a box: whole − 3 middle."""
    middle = box_sum(sums, corner + along, across, along)
    return np.int32(box_sum(sums, corner, across, 3 * along) - 3 * middle)


@part
def fill_layer(sums, stride, octave, index, i, j, exactly, values):
    """Responses of a layer at the 3×3 grid positions around (i, j)."""
    offset, side = 4 + 3 * index, (9 + 6 * index) << octave
    for di in range(3):
        for dj in range(3):
            corner = ((i + di - 1 - offset) * stride + j + dj - 1 - offset) << octave
            if exactly:
                values[di, dj] = exact_response(sums, stride, corner, side)
            else:
                values[di, dj] = quick_response(sums, stride, corner, side)


@part
def strongest_neighbour(cube):
    """Largest of the 26 values around the middle of a (3, 3, 3) cube."""
    strongest = np.float32(-np.inf)
    for s in range(3):
        for i in range(3):
            for j in range(3):
                if not s == i == j == 1:
                    strongest = max(strongest, cube[s, i, j])
    return strongest


@part
def mask_accepts(mask_sums, stride, corner, side):
    """OpenCV's rule: at least half of the filter square is inside the mask."""
    one_by_area = np.float32(1.0) / np.float32(side * side)
    return _box_mean(mask_sums, corner, side * stride, side, one_by_area) >= np.float32(0.5)


@part
def newton_offset(cube):
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


@part
def write_record(record, octave, index, i, j, response, trace, step):
    """Write the key point at grid position (i, j) of a layer, a Newton step (dx, dy, ds) farther on."""
    dx, dy, ds = step
    offset, side = 4 + 3 * index, (9 + 6 * index) << octave
    half = np.float32(side - 1) * np.float32(0.5)
    record[0] = np.float32((j - offset) << octave) + half + dx * np.float32(1 << octave)
    record[1] = np.float32((i - offset) << octave) + half + dy * np.float32(1 << octave)
    record[2] = np.float32(side) + ds * np.float32(6 << octave)
    record[3] = np.rint(record[2])
    record[4] = response
    record[5] = octave
    record[6] = np.sign(trace)
