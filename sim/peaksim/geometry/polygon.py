"""Convex polygons: signed area in the image, the part inside a box, and the part on one side of a line or plane."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def polygon_area(corners_xy: NDArray[np.float64]) -> float:
    """Return the signed area of a polygon, px², positive if its (n, 2) corners run clockwise on the screen."""
    (x, y), (next_x, next_y) = corners_xy.T, np.concatenate([corners_xy[1:], corners_xy[:1]]).T
    return float((x * next_y - next_x * y).sum() / 2)


def clip_polygon(corners_xy: NDArray[np.float64], low_xy: ArrayLike, high_xy: ArrayLike) -> NDArray[np.float64]:
    """Return the (m, 2) part of a convex polygon inside a box between two corners (Sutherland and Hodgman 1974)."""
    for axis, (low, high) in enumerate(zip(np.asarray(low_xy), np.asarray(high_xy), strict=True)):
        corners_xy = cut_polygon(corners_xy, corners_xy[:, axis] - low)
        corners_xy = cut_polygon(corners_xy, high - corners_xy[:, axis])
    return corners_xy


def cut_polygon(corners: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the part of a polygon where depths, given at its (n, k) corners and linear between, are not negative."""
    kept = []
    for a, b in zip(range(-1, len(depths) - 1), range(len(depths)), strict=True):
        if (depths[a] < 0) != (depths[b] < 0):
            kept.append(corners[a] + depths[a] / (depths[a] - depths[b]) * (corners[b] - corners[a]))
        if depths[b] >= 0:
            kept.append(corners[b])
    return np.array(kept).reshape(-1, corners.shape[1])
