"""The shape of a printed square in the picture: its affinity at the centre, and the ellipse of its circle."""

import numpy as np
from numpy.typing import NDArray

from peaksim.frame import Ellipse
from peaksim.shutter import Shot

_STEP = 1e-4
"""Step of central differences, in sides."""
_POINTS = 48
_TURNS = 2 * np.pi * np.arange(_POINTS) / _POINTS
_CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1) / 2
# second moments per area of a regular polygon to those of its circle
_SPREAD = (2 + np.cos(2 * np.pi / _POINTS)) / 3


def affinities(shot: Shot, corners_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 2, 2) px per side at the centres of (n, 4, 3) squares; columns are their x (right) and y (down)."""
    centers = corners_m.mean(axis=1)
    columns = []
    for side in (corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0]):
        columns.append((shot.project(centers + _STEP * side) - shot.project(centers - _STEP * side)) / (2 * _STEP))
    return np.stack(columns, axis=2)


def ellipses(shot: Shot, corners_m: NDArray[np.float64]) -> tuple[Ellipse, ...]:
    """Return the picture of the circle inscribed in each of (n, 4, 3) squares, nan where part of it is not seen.

    Through a pinhole a circle's picture is an ellipse; through a lens, or with a rolling shutter, this is the ellipse
    of the same centroid and second moments.
    """
    x, y = corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0]
    rims = corners_m.mean(axis=1)[:, None] + _CIRCLE[:, :1] * x[:, None] + _CIRCLE[:, 1:] * y[:, None]
    rims_xy = shot.project(rims.reshape(-1, 3)).reshape(-1, _POINTS, 2)
    return tuple(_ellipse(rim) for rim in rims_xy)


def _ellipse(rim_xy: NDArray[np.float64]) -> Ellipse:
    """Return the ellipse with the moments of a (k, 2) polygon that is inscribed in it."""
    middle = rim_xy.mean(axis=0)
    if not np.isfinite(middle).all():
        return Ellipse(np.full(2, np.nan), (np.nan, np.nan), np.nan)
    a = rim_xy - middle
    b = np.roll(a, -1, axis=0)
    areas = (a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]) / 2
    total = areas.sum()
    offset = (areas[:, None] * (a + b)).sum(axis=0) / (3 * total)
    products = a[:, :, None] * a[:, None] + b[:, :, None] * b[:, None] + (a + b)[:, :, None] * (a + b)[:, None]
    spread = (areas[:, None, None] * products).sum(axis=0) / (12 * total) - offset[:, None] * offset
    squares, axes = np.linalg.eigh(spread / _SPREAD)
    minor, major = 2 * np.sqrt(np.maximum(squares, 0))
    angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1])) % 180
    return Ellipse(middle + offset, (float(major), float(minor)), float(angle))
