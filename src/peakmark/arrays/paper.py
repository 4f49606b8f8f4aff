"""The paper's rule for its 3-bit arrays (Section 4.2): two nearest neighbours, similarly far, roughly perpendicular."""

from collections.abc import Sequence

import numpy as np
import scipy

from peakmark.identification.detection import Detection

DISTANCE_RATIO = 1.3
"""Largest ratio of the two distances that is still similar."""

ANGLE_TOLERANCE_DEG = 20.0
"""Largest difference from 90° that is still roughly perpendicular."""


def decode_upright(found: Sequence[Detection]) -> list[tuple[int, int, int]]:
    """Return the clusters as indices of the topmost, the leftmost and the remaining marker, each cluster once."""
    if len(found) < 3:
        return []
    xy = np.array([d.xy for d in found])
    _, nearest = scipy.spatial.cKDTree(xy).query(xy, 3)
    clusters = {tuple(sorted(map(int, row))) for row in nearest if _is_corner(xy[row])}
    return [_upright_order(xy, cluster) for cluster in sorted(clusters)]


def _is_corner(xy: np.ndarray) -> bool:
    """Return whether (3, 2) points, the corner first, have sides of similar length at about a right angle."""
    first, second = xy[1:] - xy[0]
    short, long = sorted((np.linalg.norm(first), np.linalg.norm(second)))
    if not 0 < long <= DISTANCE_RATIO * short:
        return False
    angle = np.degrees(np.arccos(np.clip(first @ second / (short * long), -1, 1)))
    return bool(abs(angle - 90) <= ANGLE_TOLERANCE_DEG)


def _upright_order(xy: np.ndarray, cluster: tuple[int, ...]) -> tuple[int, int, int]:
    top = min(cluster, key=lambda i: float(xy[i, 1]))
    left = min((i for i in cluster if i != top), key=lambda i: float(xy[i, 0]))
    (rest,) = (i for i in cluster if i not in (top, left))
    return top, left, rest
