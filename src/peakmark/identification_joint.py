"""Key points → markers for any number of markers in view, also none: one decision on each feature by itself.

Each feature is described by

* its *quotient*: the response over what the best picture of the same contrast would give. The marker is the picture
  that maximises it (a Rayleigh quotient: paper, Section 3.2), so it tells a dim marker from a strong edge;
* its *signature distance* (Section 4.2);
* how well the *printed pattern* explains the grey levels there, once aligned with them (`peakmark.refine`), and how
  much blur that takes.

A line in the plane of the first two, the oblique one that the paper's Section 5 asks for, makes the short list; a
linear score of all four decides. Its weights are those of a logistic regression on 250 rendered views of the gravel
floor (exposure 0.35…1.2, blur to 1.2 px, with and without markers), 60 drawn pictures of blobs and letters, and
scikit-image's photographs camera, cell, gravel and page; no other floor or photograph had a part in it.
"""

from dataclasses import dataclass, fields
from functools import cache

import numpy as np
from numpy.typing import NDArray

from peakmark.identification import Detection, is_polarity
from peakmark.keypoints import Keypoints
from peakmark.marker import Polarity, surf_filters, surf_form
from peakmark.optimum import Limit, quadratic_optimum
from peakmark.refine import Refined, refine
from peakmark.stretch import Stretch

LONGEST_LIST = 60
"""Most features of a picture that are aligned with the pattern, the likeliest first."""

SIGNATURE_SLOPE = 0.7
SHORT_LIST_QUOTIENT = 0.3
"""A feature is short-listed if quotient − slope · (signature distance − 0.3) is above this."""

SIDE_OF_SCALE = 1.09
"""Side of a marker over its SURF scale, in the median: the filter that answers most is a little smaller."""

PROMISING = 0.5
RETRIES = (0.95, 1.15)
"""Candidates this far above the line (as `SHORT_LIST_QUOTIENT`) whose alignment does not converge are tried again from
these multiples of their size: one marker in two hundred needs it."""

WEIGHTS = np.array([8.8, -11.2, 4.1, -100.0, -8.4])
"""Of the columns of `evidence`, and the offset."""

LEAST_UNEXPLAINED = 0.018
"""Unexplained shares below this count as this: what is left of a marker is noise."""

APART = 0.6
"""Markers nearer than so many sides are one marker found twice."""


def find_markers(
    gray: NDArray[np.uint8],
    features: Keypoints,
    distances: NDArray[np.float32],
    stretch: Stretch,
    polarity: Polarity,
    limit: Limit = "energy",
) -> tuple[Detection, ...]:
    """Return the markers among a picture's features, strongest first.

    Parameters
    ----------
    gray
        (H, W) uint8, unstretched.
    features
        Strongest first, in the coordinates of `gray`.
    distances
        (n,) signature distances.
    stretch
        With which the features were found.
    polarity, limit
        Of the printed markers.
    """
    candidates = aligned_candidates(gray, features, distances, stretch, polarity, limit)
    rows = np.flatnonzero(evidence(candidates) @ WEIGHTS[:-1] + WEIGHTS[-1] > 0)
    rows = rows[
        one_each(candidates.refined.xy[rows], candidates.refined.side_px[rows], candidates.refined.explained[rows])
    ]
    rows = rows[np.argsort(candidates.rows[rows], kind="stable")]
    return tuple(
        Detection(
            id=number,
            xy=candidates.refined.xy[k],
            size=float(candidates.refined.side_px[k]),
            polarity=polarity,
            response=float(features.response[candidates.rows[k]]),
            signature_distance=float(candidates.distances[k]),
            rank=int(candidates.rows[k]) + 1,
            affinity=candidates.refined.affine[k],
            explained=float(candidates.refined.explained[k]),
        )
        for number, k in enumerate(rows)
    )


@dataclass(frozen=True)
class Candidates:
    """The short list, aligned with the pattern."""

    rows: NDArray[np.intp]
    """(n,) rows of the features."""
    quotients: NDArray[np.float64]
    """(n,) see `quotients`."""
    distances: NDArray[np.float64]
    """(n,) signature distances."""
    refined: Refined
    """The alignment of each."""


def aligned_candidates(
    gray: NDArray[np.uint8],
    features: Keypoints,
    distances: NDArray[np.float32],
    stretch: Stretch,
    polarity: Polarity,
    limit: Limit = "energy",
) -> Candidates:
    """Return the features above the oblique line, at most `LONGEST_LIST`, aligned with the pattern."""
    shares = quotients(gray, features, stretch)
    height = shares - SIGNATURE_SLOPE * (distances - 0.3)
    possible = is_polarity(features, polarity) & (height > SHORT_LIST_QUOTIENT)
    rows = np.flatnonzero(possible)
    rows = np.sort(rows[np.argsort(-height[rows], kind="stable")[:LONGEST_LIST]])
    pattern = f"surf-{polarity}" if limit == "energy" else f"surf-range-{polarity}"
    refined = aligned(gray, features.xy[rows], SIDE_OF_SCALE * features.scale[rows], height[rows] > PROMISING, pattern)
    return Candidates(rows, shares[rows], distances[rows].astype(np.float64), refined)


def aligned(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float32],
    sides: NDArray[np.float32],
    is_promising: NDArray[np.bool_],
    pattern: str,
) -> Refined:
    """Return each candidate's alignment; promising ones that do not converge are tried again from other sizes."""
    refined = refine(gray, xy, np.maximum(sides, 2.0), pattern)
    for factor in RETRIES:
        again = np.flatnonzero(is_promising & ~refined.converged)
        if len(again) == 0:
            break
        refined = _replaced(refined, again, refine(gray, xy[again], np.maximum(factor * sides[again], 2.0), pattern))
    return refined


def _replaced(all_of_them: Refined, rows: NDArray[np.intp], new: Refined) -> Refined:
    columns = {}
    for column in fields(Refined):
        values = getattr(all_of_them, column.name).copy()
        values[rows] = getattr(new, column.name)
        columns[column.name] = values
    return Refined(**columns)


def evidence(candidates: Candidates) -> NDArray[np.float64]:
    """Return (n, 4) columns: quotient, signature distance, −log of the unexplained share, blur in sides."""
    refined = candidates.refined
    unexplained = np.maximum(1 - refined.explained, LEAST_UNEXPLAINED)
    with np.errstate(invalid="ignore"):
        blur = np.where(refined.converged, refined.blur_px / refined.side_px, 1.0)
    return np.column_stack([candidates.quotients, candidates.distances, -np.log(unexplained), blur])


def quotients(gray: NDArray[np.uint8], features: Keypoints, stretch: Stretch) -> NDArray[np.float64]:
    """Return (n,) responses over the largest that a picture of the same variance under the filter can give, 0…1.

    Sub-pixel sizes and interpolation can lift it a little above 1.
    """
    factor = np.asarray(stretch, dtype=np.float64)
    if factor.ndim:
        factor = factor[np.clip(np.rint(features.xy[:, 1]), 0, len(factor) - 1).astype(np.intp)]
    across = features.scale * np.sqrt(factor)
    variance = box_variance(gray, features.xy, np.column_stack([across, across / factor]))
    return np.asarray(features.response / (best_response() * np.maximum(variance, 1e-3)))


@cache
def best_response() -> float:
    """Return the largest determinant per unit of variance under the filter: the eigenvalue of the marker, 19.19."""
    filters = surf_filters()
    return float(quadratic_optimum(filters, surf_form(), "energy").bound * filters[0].size)


def box_variance(
    gray: NDArray[np.uint8], centers: NDArray[np.float32], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n,) variances of the grey levels in boxes of (n, 2) widths and heights, cut at the border."""
    import cv2

    sums, squares = cv2.integral2(gray, sdepth=cv2.CV_64F, sqdepth=cv2.CV_64F)
    limits = np.array(gray.shape[::-1])
    low, high = (np.clip(np.rint(centers + sign * sizes / 2 + 0.5), 0, limits).astype(np.intp) for sign in (-1, 1))
    high = np.maximum(high, np.minimum(low + 1, limits))
    count = np.maximum((high - low).prod(axis=1), 1)
    mean, mean_square = (_box_sums(np.asarray(table), low, high) / count for table in (sums, squares))
    return np.asarray(np.maximum(mean_square - mean**2, 0.0))


def _box_sums(table: NDArray[np.float64], low: NDArray[np.intp], high: NDArray[np.intp]) -> NDArray[np.float64]:
    (x0, y0), (x1, y1) = low.T, high.T
    return np.asarray(table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0])


def one_each(xy: NDArray[np.float64], sides: NDArray[np.float64], worth: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows, best first, that are not within `APART` sides of a better one."""
    kept: list[int] = []
    for i in np.argsort(-worth, kind="stable"):
        gaps = np.linalg.norm(xy[kept] - xy[i], axis=1)
        if (gaps > APART * np.maximum(sides[kept], sides[i])).all():
            kept.append(int(i))
    return np.array(kept, dtype=np.intp)
