"""The shape of a printed square in the image: its affinity at the centre, and the ellipse of its circle."""

import numpy as np
from numpy.typing import NDArray

from peaksim.camera.frame import Ellipse
from peaksim.camera.shutter import PosedCamera

_STEP = 1e-4
"""Step of central differences, in sides."""
_POINTS = 48
"""Corners of the regular polygon that stands for a circle."""
_ANGLES = 2 * np.pi * np.arange(_POINTS) / _POINTS
CIRCLE = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) / 2
"""(k, 2) points of the inscribed circle, in sides right and down from the middle of a square."""
# second moments per area of a regular polygon to those of its circle
_SPREAD = (2 + np.cos(2 * np.pi / _POINTS)) / 3


def affinities(posed: PosedCamera, corners_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 2, 2) px per side at the centres of (n, 4, 3) squares; columns are their x (right) and y (down)."""
    centers = corners_m.mean(axis=1)
    columns = []
    for side in (corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0]):
        columns.append((posed.project(centers + _STEP * side) - posed.project(centers - _STEP * side)) / (2 * _STEP))
    return np.stack(columns, axis=2)


def rims_m(corners_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, k, 3) points on the circle inscribed in each of (n, 4, 3) squares."""
    x, y = corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0]
    return np.asarray(corners_m.mean(axis=1)[:, None] + CIRCLE[:, :1] * x[:, None] + CIRCLE[:, 1:] * y[:, None])


def ellipses(posed: PosedCamera, rims: NDArray[np.float64]) -> tuple[Ellipse, ...]:
    """Return the image of each of n circles of (n, k, 3) points, nan where part of it is behind the camera.

    Through a pinhole a circle's image is an ellipse; through a lens, with a rolling shutter, or on bent paper, this is
    the ellipse of the same centroid and second moments.
    """
    rims_xy = posed.project(rims.reshape(-1, 3)).reshape(-1, _POINTS, 2)
    seen = np.asarray(np.isfinite(rims_xy).all(axis=(1, 2)))
    middles, half_axes, angles = _of_same_moments(np.where(seen[:, None, None], rims_xy, CIRCLE))
    nowhere = Ellipse(np.full(2, np.nan), (np.nan, np.nan), np.nan)
    return tuple(
        Ellipse(middles[k], (float(half_axes[k, 1]), float(half_axes[k, 0])), float(angles[k])) if seen[k] else nowhere
        for k in range(len(seen))
    )


def _of_same_moments(
    rims_xy: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return (n, 2) centres, (n, 2) half axes, the shorter first, and (n,) angles of ellipses around polygons."""
    middles = rims_xy.mean(axis=1)
    a = rims_xy - middles[:, None]
    b = np.roll(a, -1, axis=1)
    areas = (a[..., 0] * b[..., 1] - b[..., 0] * a[..., 1]) / 2
    totals = areas.sum(axis=1)
    offsets = (areas[..., None] * (a + b)).sum(axis=1) / (3 * totals[:, None])
    products = sum(v[..., :, None] * v[..., None, :] for v in (a, b, a + b))
    spreads = (areas[..., None, None] * products).sum(axis=1) / (12 * totals[:, None, None])
    spreads -= offsets[:, :, None] * offsets[:, None, :]
    squares, axes = np.linalg.eigh(spreads / _SPREAD)
    angles = np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1])) % 180
    return middles + offsets, 2 * np.sqrt(np.maximum(squares, 0)), angles
