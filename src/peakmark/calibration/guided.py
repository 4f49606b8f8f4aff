"""Markers aligned again where a first calibration says that they are: more of them, and without its bias.

Alone, a marker's alignment expects no perspective, which draws its centre aside by a few hundredths of what perspective
moves it, alike in a whole photograph; and it takes a lens for straight within the marker. With the board's pose known,
the perspective is given, what the lens bends is taken off, and markers of arrays that the border of the image cuts, or
that a strong lens hid from the search, are measured too.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, invert, transform

from peakmark.calibration.views import FEWEST, BoardView
from peakmark.maps.marker_map import MarkerMap
from peakmark.parallel import map_parallel
from peakmark.refine.align import chosen_pixels, gauss_newton, sandwich
from peakmark.refine.api import known_pattern
from peakmark.refine.model import PARAMETERS, predict

Values = NDArray[np.float64]

SMALLEST_PX = 12.0
"""Side of the smallest markers that are measured."""

_LARGEST_SHIFT = 0.2
"""Of a centre from where it was expected, in sides: beyond, something else is seen."""

_LEAST_EXPLAINED = 0.8
"""Share of the grey levels' variance that the pattern must explain."""

_MARGIN_PX = 3.0
"""Between a marker's corners and the border of the image."""

_PIXELS, _STEPS, _DONE = 1200, 30, 1e-4
"""Pixels that are compared, steps of the fit, and where it ends, in σ²."""

_BLUR = (0.3, 1 / 4.0**2)
"""Variance of the blur, px², and how sure that is beforehand."""

_ROUNDING_PX = 0.003
"""Added to each σ: grey levels are rounded alike along an edge."""

_LINE = np.linspace(-0.5, 0.5, 6)
_GRID = np.stack(np.meshgrid(_LINE, _LINE), axis=-1).reshape(-1, 2)
"""Points over a marker, sides, through which its homography is laid."""


def guided_view(gray: NDArray[np.uint8], view: BoardView, board: MarkerMap, camera: Camera, pose: Pose) -> BoardView:
    """Return the markers of a board in an image, measured where a camera (4, 4) world_from_camera expects them.

    Where fewer than an array's are found, the view stays as it was.
    """
    expected = _expected(gray.shape, board, camera, pose)
    found = map_parallel(lambda k: _measured(gray, board, expected[k]), range(len(expected)))
    kept = [(each.row, *fit) for each, fit in zip(expected, found, strict=True) if fit is not None]
    if len(kept) < FEWEST:
        return view
    numbers = np.array([row for row, _, _ in kept], dtype=np.intp)
    xy, sigma = np.array([xy for _, xy, _ in kept]), np.array([sigma for _, _, sigma in kept])
    return BoardView(view.name, numbers, board.centers_m[numbers], xy, sigma)


@dataclass(frozen=True)
class _Expected:
    """A marker as a camera should see it."""

    row: int
    """Marker of the board."""
    homography: Values
    """(8,) c, A and g of x = c + A u / (1 + g·u), px and sides."""
    bent_px: Values
    """(2,) from where its centre is seen to where an alignment, which knows no lens, finds it."""


def _expected(shape: tuple[int, ...], board: MarkerMap, camera: Camera, pose: Pose) -> list[_Expected]:
    """Return the markers that are whole in an image, large enough and seen from the front."""
    camera_from_world, size = invert(pose), np.array([shape[1], shape[0]])

    def seen(rows: NDArray[np.intp], u: Values) -> Values:
        points = board.centers_m[rows][:, None] + np.einsum("nij,kj->nki", board.tangents_m[rows], u)
        return np.asarray(camera.project(transform(camera_from_world, points.reshape(-1, 3)))).reshape(len(rows), -1, 2)

    xy = seen(np.arange(len(board)), _GRID)
    with np.errstate(invalid="ignore"):
        inside = (xy > _MARGIN_PX - 0.5) & (xy < size - 0.5 - _MARGIN_PX)
    found = []
    for row in np.flatnonzero(inside.all(axis=(1, 2))):
        homography = _homography(xy[row])
        if np.linalg.det(homography[2:6].reshape(2, 2)) > SMALLEST_PX**2:
            edges = _edges(f"surf-{board.polarities[row]}")
            points = seen(np.array([row]), np.concatenate([np.zeros((1, 2)), edges.u]))[0]
            found.append(_Expected(int(row), homography, _bend(homography, edges, points[1:]) - points[0]))
    return found


@dataclass(frozen=True)
class _Edges:
    """Points on the edges between a pattern's cells, which decide where an alignment ends.

    The pattern's border is not among them: its pixels show what surrounds the marker, too, and are not compared.
    """

    u: Values
    """(n, 2) sides."""
    across: NDArray[np.intp]
    """(n,) 0 where the level changes along x, 1 along y."""
    weight: Values
    """(n,) square of the change, times the length of edge that the point stands for."""


@cache
def _edges(name: str) -> _Edges:
    pattern = known_pattern(name, 0.0)
    lines, levels = pattern.lines, pattern.levels
    middles, lengths = (lines[1:] + lines[:-1]) / 2, np.diff(lines)
    u, across, weight = [], [], []
    for axis, changes in enumerate((np.diff(levels[1:-1], axis=1), np.diff(levels.T[1:-1], axis=1))):
        for cell, inner in zip(*np.nonzero(changes[:, 1:-1]), strict=True):
            line = inner + 1
            for part in (-0.3, 0.0, 0.3):
                point = (lines[line], middles[cell] + part * lengths[cell])
                u.append(point if axis == 0 else point[::-1])
                across.append(axis)
                weight.append(changes[cell, line] ** 2 * lengths[cell])
    return _Edges(np.array(u), np.array(across), np.array(weight))


def _bend(homography: Values, edges: _Edges, xy: Values) -> Values:
    """Return (2,) where an alignment finds a centre whose edges are seen at (n, 2), with g as given.

    It moves c and A until the edges fit across themselves; how they fit along themselves does not count.
    """
    center, shape, g = homography[:2], homography[2:6].reshape(2, 2), homography[6:]
    depth = 1 + edges.u @ g
    flat = edges.u / depth[:, None]
    gaps = xy - center - flat @ shape.T
    local = (shape - np.einsum("ni,j->nij", flat @ shape.T, g)) / depth[:, None, None]
    normals = np.linalg.inv(local)[np.arange(len(xy)), edges.across]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    root = np.sqrt(edges.weight)[:, None]
    by_shape = (normals[:, :, None] * flat[:, None, :]).reshape(len(xy), 4)
    columns = np.column_stack([normals, by_shape]) * root
    moved = np.linalg.lstsq(columns, (normals * gaps).sum(axis=1) * root[:, 0], rcond=None)[0]
    return np.asarray(center + moved[:2])


def _homography(xy: Values) -> Values:
    """Return c, A and g of x = c + A u / (1 + g·u), (8,), nearest to where the points of a marker are seen."""
    u, v = _GRID.T
    middle = xy.mean(axis=0)
    x, y = (xy - middle).T
    one, nil = np.ones_like(u), np.zeros_like(u)
    weight = np.ones_like(u)
    for _ in range(3):  # the algebraic error, weighted by the depth, becomes that in the image
        along_x = np.column_stack([u, v, one, nil, nil, nil, -x * u, -x * v]) / weight[:, None]
        along_y = np.column_stack([nil, nil, nil, u, v, one, -y * u, -y * v]) / weight[:, None]
        seen = np.concatenate([x / weight, y / weight])
        h = np.linalg.lstsq(np.concatenate([along_x, along_y]), seen, rcond=None)[0]
        weight = 1 + h[6] * u + h[7] * v
    center, g = h[[2, 5]], h[6:]
    shape = h[[0, 1, 3, 4]].reshape(2, 2) - np.outer(center, g)
    return np.concatenate([center + middle, shape.ravel(), g])


def _measured(gray: NDArray[np.uint8], board: MarkerMap, expected: _Expected) -> tuple[Values, float] | None:
    """Return where the centre of a marker is seen, and σ; None where it is not seen."""
    pattern = known_pattern(f"surf-{board.polarities[expected.row]}", 0.0)
    theta = np.concatenate([expected.homography, [1.0, 0.0, _BLUR[0]]])
    pixels = chosen_pixels(gray, theta, pattern.lines, pattern.extent, _PIXELS)
    if len(pixels) < 4 * PARAMETERS:
        return None
    seen = gray[pixels[:, 1], pixels[:, 0]].astype(np.float64)
    shown = predict(theta, pixels.astype(np.float64), pattern)
    theta[8:10] = np.polyfit(shown, seen, 1)
    if theta[8] <= 0:
        return None
    precision = np.zeros(PARAMETERS)
    side = float(np.sqrt(abs(np.linalg.det(theta[2:6].reshape(2, 2)))))
    precision[6:8], precision[10] = 1e8, _BLUR[1]
    data = (pattern.lines, pattern.levels)
    fitted, noise, converged = gauss_newton(gray, pixels, theta, *data, theta, precision, _STEPS, _DONE)
    shift = np.linalg.norm(fitted[:2] - theta[:2])
    signal = fitted[8] ** 2 * float(pattern.levels.var())
    if not converged or not shift < _LARGEST_SHIFT * side or signal < _LEAST_EXPLAINED * (signal + noise):
        return None
    covariance = sandwich(gray, pixels, fitted, *data, noise, precision)
    sigma = float(np.sqrt(np.trace(covariance[:2, :2]) / 2 + _ROUNDING_PX**2))
    return fitted[:2] - expected.bent_px, sigma
