"""Blobs of five shapes: maxima of box Hessians, over position and size, on sums that are upright and tilted by 45°.

SURF's filters (Bay et al. 2008, doi:10.1016/j.cviu.2007.09.014) answer to square markers; those twice as long as wide,
along rows, columns and diagonals, to markers that are seen foreshortened. Tilted sums (Lienhart and Maydt 2002,
doi:10.1109/ICIP.2002.1038171) give boxes along diagonals from four corners, so that no image is warped.

An octave o has filters whose corners lie 2^o px apart; they are tried at every second of these positions, and from
the maxima there a climb over all positions and neighbouring sizes leads to the blob.
"""

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.markers.optimum import quadratic_optimum
from peakmark.markers.patterns import surf_form
from peakmark.parallel import map_parallel

_SUMS = "const u1[height,width] gray, u4[rows,stride] sums, u4[rows,stride] squares"
_upright_sums = function(f"void upright_sums({_SUMS})")
_tilted_sums = function(f"status tilted_sums({_SUMS})")
_find_blobs = function(
    "status find_blobs(const u4[rows,stride] sums, const u4[rows,stride] squares, b1 is_tilted, i8 octave, "
    "const i8[families,layers,2] thirds, const f8[families,layers] best, i8 pad, i8 height, i8 width, f8 threshold, "
    "f8 least_quotient, f8[room,6] found, i8[1] count)"
)

Thirds = tuple[int, int]
"""A third of a filter's sides, along its first direction and across, in units of its octave."""

ROUND: tuple[Thirds, ...] = tuple((n, n) for n in (3, 4, 5, 6, 8, 10, 12))
"""Of the first octave, by size; others have it from the second on. The first and the last are only to be compared with,
and the one before the last is only climbed to: it is the next octave's first, whose coarser positions may miss it."""
WIDE: tuple[Thirds, ...] = tuple((2 * n, n) for n in (2, 3, 4, 5, 6, 8, 10))
"""As `ROUND`, of filters twice as long as wide."""
DIAGONAL: tuple[Thirds, ...] = ((3, 2), (4, 2), (6, 3), (8, 4), (10, 5), (12, 6), (16, 8))
"""As `WIDE`, of tilted ones, whose units are √2 px."""

_PAD_SHARE = 0.05
"""Of the longer side, by which the image is continued, so that filters fit that are centred near its border."""
_PAD_PX = 32
"""Of the first octave's filters, by which it is continued at most; of the next one's twice as much."""


def blob_rows(
    gray: NDArray[np.uint8],
    threshold: float,
    least_quotient: float,
    octaves: Sequence[int] | None = None,
    has_slanted: bool = True,
) -> NDArray[np.float64]:
    """Return (n, 6) x, y, scale, response, sign and response quotient of the blobs in a (H, W) image.

    The scale is the root of the filter's area, px; the response, which exceeds a threshold, the determinant of the
    Hessian, (grey levels)²; the sign +1 where the centre is dark, −1 where light; and the quotient the response over
    the largest that levels of the same variance under the filter can give. Octaves are all in which a filter fits,
    unless given; without slanted ones filters are square.
    """
    octaves = range(octave_count(gray.shape)) if octaves is None else octaves
    pad = min(round(_PAD_SHARE * max(gray.shape)), _PAD_PX << octaves[-1])
    padded = np.asarray(cv2.copyMakeBorder(gray, pad, pad, pad, pad, cv2.BORDER_REPLICATE))
    sums = np.empty((1 + has_slanted, 2, padded.shape[0] + 1, padded.shape[1] + 1), np.uint32)
    kinds = range(len(sums))
    map_parallel(lambda kind: (_upright_sums, _tilted_sums)[kind](padded, *sums[kind]), kinds)
    tasks = [(octave, kind) for octave in octaves for kind in kinds]

    def search(task: tuple[int, int]) -> NDArray[np.float64]:
        octave, kind = task
        filters = _filters(bool(kind), octave == 0, has_slanted)
        settings = (bool(kind), octave, *filters, pad, *gray.shape, threshold, least_quotient)
        found, count = np.empty((64 + (gray.size >> (2 * octave + 4)), 6)), np.empty(1, np.int64)
        _find_blobs(*sums[kind], *settings, found, count)
        if count[0] > len(found):
            found = np.empty((int(count[0]), 6))
            _find_blobs(*sums[kind], *settings, found, count)
        return found[: count[0]].copy()

    return np.concatenate([np.empty((0, 6)), *map_parallel(search, tasks)])


def octave_count(shape: tuple[int, ...]) -> int:
    """Return how many octaves have a filter that fits into an image of a shape."""
    smallest = 3 * ROUND[2][0]
    return max(1, (min(shape) // smallest).bit_length())


@cache
def _filters(is_tilted: bool, is_first: bool, has_slanted: bool) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return thirds (families, layers, 2) and best responses (families, layers) of an octave's filters."""
    slanted = DIAGONAL if is_tilted else WIDE
    families = [] if is_tilted else [ROUND]
    families += [slanted, tuple((across, along) for along, across in slanted)] if has_slanted else []
    thirds = np.array(families, np.int64)[:, 0 if is_first else 1 :]
    return thirds, np.array([[best_response(int(a), int(b)) for a, b in family] for family in thirds])


@cache
def best_response(along: int, across: int) -> float:
    """Return the largest determinant per unit of variance under a filter with such thirds: of SURF's smallest 19.08."""
    filters = box_filters(along, across)
    return float(quadratic_optimum(filters, surf_form(), "energy").bound * filters[0].size)


def box_filters(along: int, across: int) -> NDArray[np.float64]:
    """Return Dxx, Dyy and Dxy as (3, 3 across, 3 along), each box divided by its area."""
    a, b = 3 * along, 3 * across
    low_a, low_b, near_a, near_b = ((share * side + 9) // 18 for share in (4, 2) for side in (a, b))
    filters = np.zeros((3, b, a))
    for k, weight in enumerate((1.0, -2.0, 1.0)):
        filters[0, low_b : b - low_b, k * along : (k + 1) * along] = weight / (along * (b - 2 * low_b))
        filters[1, k * across : (k + 1) * across, low_a : a - low_a] = weight / (across * (a - 2 * low_a))
    for x, y, weight in ((0, 0, 1.0), (1, 0, -1.0), (0, 1, -1.0), (1, 1, 1.0)):
        left, top = (a - near_a - along if x else near_a), (b - near_b - across if y else near_b)
        filters[2, top : top + across, left : left + along] = weight / (along * across)
    return filters
