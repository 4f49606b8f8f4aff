"""Non-maximum suppression: of detections that overlap, the best remains."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.kernel import kernel

APART = 0.6
"""Markers nearer than this many sides are one marker found twice, for paper does not overlap. A marker answers in more
than one octave, and with ghosts of about 16 % of its response around its centre."""


def suppress_non_maxima(
    xy: NDArray[Any], sides: NDArray[Any], worth: NDArray[Any], *, by_larger: bool = True, like_size: float = np.inf
) -> NDArray[np.intp]:
    """Return the rows, best first, that do not lie within `APART` sides of a better one that is returned.

    Of (n, 2) centres and (n,) sides, px, and their worth (of equals the first is better). The sides are those of the
    larger of the two, or else of the better one; two whose ratio exceeds `like_size` do not suppress each other.
    """
    order = np.argsort(-worth, kind="stable")
    points, lengths = np.asarray(xy[order], dtype=np.float64), np.asarray(sides[order], dtype=np.float64)
    return np.asarray(order[_are_kept(points, lengths, APART, by_larger, like_size)])


@kernel
def _are_kept(xy, sides, apart, by_larger, like_size):
    """Return (n,) whether each, in this order, lies outside the reach of all before it that are kept."""
    kept = np.empty(len(xy), np.intp)
    are_kept = np.zeros(len(xy), np.bool_)
    count = 0
    for i in range(len(xy)):
        are_kept[i] = True
        for k in kept[:count]:
            larger, smaller = max(sides[k], sides[i]), min(sides[k], sides[i])
            if larger > like_size * smaller:
                continue
            x, y = xy[k, 0] - xy[i, 0], xy[k, 1] - xy[i, 1]
            if not np.sqrt(x * x + y * y) > apart * (larger if by_larger else sides[k]):
                are_kept[i] = False
                break
        if are_kept[i]:
            kept[count] = i
            count += 1
    return are_kept
