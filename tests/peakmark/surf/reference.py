"""SURF as one would write it on paper: NumPy operators that follow the definition, without regard to speed.

The kernels are held against these. Single precision is used where OpenCV uses it, so that the numbers agree to the last
bits.
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import DXY_WEIGHT
from peakmark.surf.descriptor import CELL_SIGMA
from peakmark.surf.layers import Layer, octave_layers
from peakmark.surf.orientation import circle_samples, gaussian
from peakmark.surf.stages import LayerResponse
from peakmark.surf.window import PATCH_SIDE

Float32 = NDArray[np.float32]


class Box(NamedTuple):
    """A half-open box inside the filter square, px, and what its mean is multiplied with."""

    x0: int
    y0: int
    x1: int
    y1: int
    weight: int

    @property
    def area(self) -> int:
        """Pixels in the box."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)


def second_derivative_boxes(side: int) -> tuple[tuple[Box, ...], tuple[Box, ...], tuple[Box, ...]]:
    """Boxes of Dxx, Dyy and Dxy for a filter square of this side, scaled from the square of side 9.

    >>> [box.weight for box in second_derivative_boxes(9)[0]]
    [1, -2, 1]
    """
    at = [round(side * ninths / 9) for ninths in range(10)]
    dxx = tuple(Box(at[x], at[2], at[x + 3], at[7], weight) for x, weight in ((0, 1), (3, -2), (6, 1)))
    dyy = tuple(Box(at[2], at[y], at[7], at[y + 3], weight) for y, weight in ((0, 1), (3, -2), (6, 1)))
    corners = ((1, 1, 1), (5, 1, -1), (1, 5, -1), (5, 5, 1))
    dxy = tuple(Box(at[x], at[y], at[x + 3], at[y + 3], weight) for x, y, weight in corners)
    return dxx, dyy, dxy


def integral_image(gray: NDArray[np.uint8]) -> NDArray[np.int32]:
    sums = np.zeros((gray.shape[0] + 1, gray.shape[1] + 1), dtype=np.int32)
    sums[1:, 1:] = gray.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
    return sums


def hessian_responses(integral: NDArray[np.int32], octaves: int = 4, layers: int = 3) -> list[LayerResponse]:
    """Responses of all `layers` + 2 layers of every octave, finest first.

    Parameters
    ----------
    integral : (H + 1, W + 1) int32 array, see `integral_image`.
    octaves, layers : number of octaves, and of layers per octave in which maxima are sought.
    """
    every = [layer for octave in range(octaves) for layer in octave_layers(octave, layers)]
    return [layer_response(integral, layer) for layer in every]


def layer_response(integral: NDArray[np.int32], layer: Layer) -> LayerResponse:
    """Responses of one layer: zeros where its filter does not fit."""
    height, width = integral.shape[0] - 1, integral.shape[1] - 1
    det = np.zeros(layer.grid_shape(height, width), dtype=np.float32)
    trace = np.zeros_like(det)
    rows, columns = layer.positions(height, width)
    if rows:
        dxx, dyy, dxy = (
            weighted_box_means(integral, boxes, layer.step, rows, columns)
            for boxes in second_derivative_boxes(layer.side)
        )
        inside = (slice(layer.offset, layer.offset + rows), slice(layer.offset, layer.offset + columns))
        det[inside] = dxx * dyy - np.float32(DXY_WEIGHT) * dxy * dxy
        trace[inside] = dxx + dyy
    return LayerResponse(layer, det, trace)


def weighted_box_means(
    integral: NDArray[np.int32], boxes: tuple[Box, ...], step: int, rows: int, columns: int
) -> Float32:
    """Sum of weight × box mean, the boxes placed every `step` px on `rows` × `columns` positions."""

    def corner(x: int, y: int) -> NDArray[np.int32]:
        return integral[y : y + (rows - 1) * step + 1 : step, x : x + (columns - 1) * step + 1 : step]

    total = np.zeros((rows, columns), dtype=np.float64)
    for box in boxes:
        box_sum = corner(box.x0, box.y0) + corner(box.x1, box.y1) - corner(box.x0, box.y1) - corner(box.x1, box.y0)
        total += box_sum.astype(np.float32) * (np.float32(box.weight) / np.float32(box.area))
    return total.astype(np.float32)


def interest_points(responses: Sequence[LayerResponse], threshold: float = 100.0) -> Keypoints:
    """Maxima of the responses over position and scale, refined, strongest first; their angles are −1.

    Parameters
    ----------
    responses : layers as `hessian_responses` returns them: whole octaves, finest first.
    threshold : a maximum must be larger, (grey levels)².

    Returns
    -------
    Keypoints
        Strict maxima among their 26 neighbours whose Newton step is not longer than one grid step along any axis.
    """
    points = [point for triple in _searchable(responses) for point in _layer_maxima(*triple, threshold)]
    points.sort(key=lambda p: (-p.response, -p.size, -p.layer.octave, -p.y, p.x))
    none = np.zeros(0, np.float32)
    return Keypoints(
        xy=np.array([(p.x, p.y) for p in points], np.float32).reshape(-1, 2),
        size=np.array([p.size for p in points], np.float32),
        angle=np.full_like(none, -1, shape=len(points)),
        response=np.array([p.response for p in points], np.float32),
        octave=np.array([p.layer.octave for p in points], np.int32),
        laplacian=np.array([p.laplacian for p in points], np.int8),
        scale=np.array([p.scale for p in points], np.float32),
    )


class _Point(NamedTuple):
    x: float
    y: float
    scale: float
    response: float
    laplacian: int
    layer: Layer

    @property
    def size(self) -> float:
        """OpenCV rounds the scale to whole pixels."""
        return round(self.scale)


def _searchable(responses: Sequence[LayerResponse]) -> list[tuple[LayerResponse, LayerResponse, LayerResponse]]:
    """Each inner layer of an octave between its neighbours."""
    triples = zip(responses, responses[1:], responses[2:], strict=False)
    return [triple for triple in triples if triple[0].layer.octave == triple[2].layer.octave]


def _layer_maxima(below: LayerResponse, here: LayerResponse, above: LayerResponse, threshold: float) -> list[_Point]:
    margin = here.layer.margin
    if min(here.det.shape) <= 2 * margin:
        return []
    cube = np.stack([below.det, here.det, above.det])
    rows, columns = here.det.shape

    def shifted(ds: int, dy: int, dx: int) -> Float32:
        return cube[1 + ds, margin + dy : rows - margin + dy, margin + dx : columns - margin + dx]

    center = shifted(0, 0, 0)
    peak = center > threshold
    for shift in product((-1, 0, 1), repeat=3):
        if any(shift):
            peak &= center > shifted(*shift)
    candidates = (_refined(cube, here, i + margin, j + margin) for i, j in np.argwhere(peak).tolist())
    return [point for point in candidates if point is not None]


def _refined(cube: Float32, here: LayerResponse, i: int, j: int) -> _Point | None:
    """Maximum of the parabola through the 3×3×3 responses around grid position (i, j); None if it is too far away."""
    offset = newton_step(cube[:, i - 1 : i + 2, j - 1 : j + 2].astype(np.float64))
    if not offset.any() or np.abs(offset).max() > 1:
        return None
    layer = here.layer
    dx, dy, ds = offset.tolist()
    half = (layer.side - 1) / 2
    return _Point(
        x=layer.step * (j - layer.offset + dx) + half,
        y=layer.step * (i - layer.offset + dy) + half,
        scale=layer.side + ds * 6 * layer.step,
        response=float(here.det[i, j]),
        laplacian=int(np.sign(here.trace[i, j])),
        layer=layer,
    )


def newton_step(cube: NDArray[np.float64]) -> NDArray[np.float64]:
    """−H⁻¹ g of a 3×3×3 neighbourhood (scale, y, x), as (x, y, scale); zero where H is singular."""
    steps = [cube[1, 1, 2] - cube[1, 1, 0], cube[1, 2, 1] - cube[1, 0, 1], cube[2, 1, 1] - cube[0, 1, 1]]
    gradient = np.array(steps) / 2
    twice = 2 * cube[1, 1, 1]
    xx = cube[1, 1, 0] - twice + cube[1, 1, 2]
    yy = cube[1, 0, 1] - twice + cube[1, 2, 1]
    ss = cube[0, 1, 1] - twice + cube[2, 1, 1]
    xy = (cube[1, 2, 2] - cube[1, 2, 0] - cube[1, 0, 2] + cube[1, 0, 0]) / 4
    xs = (cube[2, 1, 2] - cube[2, 1, 0] - cube[0, 1, 2] + cube[0, 1, 0]) / 4
    ys = (cube[2, 2, 1] - cube[2, 0, 1] - cube[0, 2, 1] + cube[0, 0, 1]) / 4
    hessian = np.array([[xx, xy, xs], [xy, yy, ys], [xs, ys, ss]])
    try:
        return np.linalg.solve(hessian, -gradient)
    except np.linalg.LinAlgError:
        return np.zeros(3)


def orientation(integral: NDArray[np.int32], x: float, y: float, size: float) -> float:
    """Orientation of one key point, degrees in 0…360; −1 where no Haar filter fits into the image."""
    offsets, weights = circle_samples()
    s = size * 1.2 / 9
    half = round(2 * s)
    left, top = np.rint(np.array([[x], [y]]) + offsets.T * s - (2 * half - 1) / 2).astype(int)
    inside = (left >= 0) & (top >= 0) & (left + 2 * half < integral.shape[1]) & (top + 2 * half < integral.shape[0])
    if not inside.any():
        return -1.0
    haar = _haar_responses(integral, left[inside], top[inside], half) * weights[inside]
    directions = np.rint(np.degrees(np.arctan2(haar[1], haar[0])) % 360)
    centers = np.arange(0, 360, 5)
    apart = np.abs(directions[None] - centers[:, None])
    sums = ((apart < 30) | (apart > 330)) @ haar.T
    best_x, best_y = sums[np.argmax((sums**2).sum(axis=1))]
    return float(np.degrees(np.arctan2(-best_y, best_x)) % 360)


def _haar_responses(
    integral: NDArray[np.int32], left: NDArray[np.intp], top: NDArray[np.intp], half: int
) -> NDArray[np.float64]:
    """Right − left and upper − lower half of squares of side 2 · half, as means: (2, n)."""

    def mean(x0: int, y0: int, x1: int, y1: int) -> NDArray[np.float64]:
        rows, columns = (top + y0, top + y1), (left + x0, left + x1)
        total = integral[rows[1], columns[1]] + integral[rows[0], columns[0]]
        total -= integral[rows[0], columns[1]] + integral[rows[1], columns[0]]
        return total / (2 * half * half)

    side = 2 * half
    right_minus_left = mean(half, 0, side, side) - mean(0, 0, half, side)
    upper_minus_lower = mean(0, 0, side, half) - mean(0, half, side, side)
    return np.stack([right_minus_left, upper_minus_lower])


def descriptor(
    gray: NDArray[np.uint8], x: float, y: float, size: float, angle_deg: float, extended: bool = False
) -> NDArray[np.float64]:
    """Descriptor (64,) or (128,) of one key point."""
    patch = averaged(rotated_window(gray, x, y, int(PATCH_SIDE * size * 1.2 / 9), angle_deg), PATCH_SIDE)
    upper_left, upper_right = patch[:-1, :-1], patch[:-1, 1:]
    lower_left, lower_right = patch[1:, :-1], patch[1:, 1:]
    weights = np.outer(gaussian(PATCH_SIDE - 1, CELL_SIGMA), gaussian(PATCH_SIDE - 1, CELL_SIGMA))
    dx = (upper_right - upper_left + lower_right - lower_left) * weights
    dy = (lower_left - upper_left + lower_right - upper_right) * weights
    if extended:
        down, right = dy >= 0, dx >= 0
        signed = [
            part
            for values, chosen in ((dx, down), (dx, ~down), (dy, right), (dy, ~right))
            for part in (values * chosen, abs(values) * chosen)
        ]
    else:
        signed = [dx, dy, abs(dx), abs(dy)]
    cells = np.stack([values.reshape(4, 5, 4, 5).sum(axis=(1, 3)) for values in signed], axis=2).ravel()
    length = np.linalg.norm(cells)
    return cells / length if length else cells


def rotated_window(gray: NDArray[np.uint8], x: float, y: float, side: int, angle_deg: float) -> NDArray[np.float64]:
    """Square window whose rows run along the angle, bilinear, rounded; the nearest pixel outside the image.

    In OpenCV's arithmetic: rows begin a step in single precision apart, samples of a row a step in double precision.
    """
    one = np.float32(1)
    angle = np.float64(np.float32(angle_deg) * np.float32(np.pi / 180))
    cosine, sine, reach = np.float32(np.cos(angle)), np.float32(-np.sin(angle)), np.float32(-(side - 1) / 2)
    start_x = np.float32(x) + reach * cosine + reach * sine
    start_y = np.float32(y) - reach * sine + reach * cosine
    steps = np.full(side - 1, one)
    columns = np.add.accumulate([start_x, *(steps * sine)], dtype=np.float32)[:, None] + np.arange(side) * float(cosine)
    rows = np.add.accumulate([start_y, *(steps * cosine)], dtype=np.float32)[:, None] - np.arange(side) * float(sine)
    height, width = gray.shape
    left, top = np.floor(columns).astype(int), np.floor(rows).astype(int)
    inside = (left >= 0) & (left < width - 1) & (top >= 0) & (top < height - 1)
    left = np.where(inside, left, np.clip(np.rint(columns), 0, width - 1)).astype(int)
    top = np.where(inside, top, np.clip(np.rint(rows), 0, height - 1)).astype(int)
    a, b = (np.where(inside, at - first, 0).astype(np.float32) for at, first in ((columns, left), (rows, top)))
    right_of, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    upper = gray[top, left] * (one - a) * (one - b) + gray[top, right_of] * a * (one - b)
    window = upper + gray[below, left] * (one - a) * b + gray[below, right_of] * a * b
    return np.rint(window).astype(np.float64)


def averaged(window: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """Mean over each of side × side equal areas of a window, rounded to whole levels."""
    shares = area_shares(len(window), side)
    patch: NDArray[np.float64] = np.rint(shares @ window @ shares.T)
    return patch


def area_shares(length: int, cells: int) -> NDArray[np.float64]:
    """(cells, length) shares of pixels in equal cells along a line; each row sums to 1."""
    edges = np.arange(cells + 1)[:, None] * (length / cells)
    covered = np.clip(edges - np.arange(length), 0, 1)
    shares: NDArray[np.float64] = np.diff(covered, axis=0) * (cells / length)
    return shares
