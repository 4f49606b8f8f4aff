"""Non-maximum suppression: of detections that overlap, the best remains."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

APART = 0.6
"""Markers nearer than this many sides are one marker found twice, for paper does not overlap. A marker answers in more
than one octave, and with ghosts of about 16 % of its response around its centre."""

_kept_rows = function(
    "i8 kept_rows(const f8[n,2] xy, const f8[n] sides, f8 apart, b1 by_larger, f8 like_size, i8[n] rows)"
)


def suppress_non_maxima(
    xy: NDArray[Any], sides: NDArray[Any], worth: NDArray[Any], *, by_larger: bool = True, like_size: float = np.inf
) -> NDArray[np.intp]:
    """Return the rows, best first, that do not lie within `APART` sides of a better one that is returned.

    Of (n, 2) centres and (n,) sides, px, and their worth (of equals the first is better). The sides are those of the
    larger of the two, or else of the better one; two whose ratio exceeds `like_size` do not suppress each other.
    """
    order = np.argsort(-worth, kind="stable")
    points, lengths = np.asarray(xy[order], dtype=np.float64), np.asarray(sides[order], dtype=np.float64)
    kept = np.empty(len(order), np.int64)
    count = _kept_rows(points, lengths, APART, by_larger, like_size, kept)
    return np.asarray(order[kept[:count]])
