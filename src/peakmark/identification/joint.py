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

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.detection import SIDE_OF_SCALE, Detection, is_polarity, pattern_name
from peakmark.identification.evidence import aligned_evidence, one_each, quotients
from peakmark.identification.stretch import Stretch
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.refine.api import Refined, refine

LONGEST_LIST = 60
"""Most features of a picture that are aligned with the pattern, the likeliest first."""

SIGNATURE_SLOPE = 0.7
SHORT_LIST_QUOTIENT = 0.3
"""A feature is short-listed if quotient − slope · (signature distance − 0.3) is above this. 0.42 would align a third as
many features, and keeps all markers of rides, but loses one in twelve where the stretch does not fit the view."""

PROMISING = 0.5
RETRIES = (0.95, 1.15)
"""Candidates this far above the line (as `SHORT_LIST_QUOTIENT`) whose alignment does not converge are tried again from
these multiples of their size: one marker in two hundred needs it."""

WEIGHTS = np.array([8.8, -11.2, 4.1, -100.0, -8.4])
"""Of the columns of `aligned_evidence`, and the offset."""

LEAST_UNEXPLAINED = 0.018
"""Unexplained shares below this count as this: what is left of a marker is noise."""


COVERED = 0.7
"""Half the width, in sides, of the square around a marker in which the centre of no other can lie."""


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
    pattern = pattern_name(polarity, limit)
    markers = one_of_each(marked_candidates(gray, features, distances, quotients(gray, features, stretch), pattern))
    return tuple(
        Detection(
            id=number,
            xy=markers.refined.xy[k],
            size=float(markers.refined.side_px[k]),
            polarity=polarity,
            response=float(features.response[markers.rows[k]]),
            signature_distance=float(markers.distances[k]),
            rank=int(markers.rows[k]) + 1,
            affinity=markers.refined.affine[k],
            explained=float(markers.refined.explained[k]),
        )
        for number, k in enumerate(np.argsort(markers.rows, kind="stable"))
    )


@dataclass(frozen=True)
class Candidates:
    """Features of the short list, aligned with the pattern."""

    rows: NDArray[np.intp]
    """(n,) rows of the features."""
    quotients: NDArray[np.float64]
    """(n,) see `quotients`."""
    distances: NDArray[np.float64]
    """(n,) signature distances."""
    refined: Refined
    """The alignment of each."""

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "Candidates":
        return Candidates(
            self.rows[chosen],
            self.quotients[chosen],
            self.distances[chosen],
            _column_wise(lambda c: c[chosen], self.refined),
        )


def marked_candidates(
    gray: NDArray[np.uint8],
    features: Keypoints,
    distances: NDArray[np.float32],
    shares: NDArray[np.float64],
    pattern: str,
) -> Candidates:
    """Return the features above the oblique line that are markers, at most `LONGEST_LIST` of them looked at.

    Promising ones come first, and again from other sizes where their alignment did not converge; the others last.
    What lies on a marker already found is not looked at: most of them are its corners and ghosts.
    """
    height = shares - SIGNATURE_SLOPE * (distances - 0.3)
    possible = np.flatnonzero(
        is_polarity(features, "light" if pattern.endswith("light") else "dark") & (height > SHORT_LIST_QUOTIENT)
    )
    possible = possible[np.argsort(-height[possible], kind="stable")[:LONGEST_LIST]]

    def aligned(rows: NDArray[np.intp], factor: float) -> Candidates:
        sides = np.maximum(factor * SIDE_OF_SCALE * features.scale[rows], 2.0)
        refined = refine(gray, features.xy[rows], sides, pattern)
        return Candidates(rows, shares[rows], distances[rows].astype(np.float64), refined)

    promising = height[possible] > PROMISING
    found = aligned(possible[:0], 1.0)
    left = possible[promising]
    for factor in (1.0, *RETRIES):
        tried = aligned(left[~is_covered(features.xy[left], found.refined)], factor)
        found = joined(found, tried[is_marker(tried)])
        left = tried.rows[~tried.refined.converged]
    left = possible[~promising]
    tried = aligned(left[~is_covered(features.xy[left], found.refined)], 1.0)
    return joined(found, tried[is_marker(tried)])


def is_marker(candidates: Candidates) -> NDArray[np.bool_]:
    """Return (n,) the decision."""
    columns = aligned_evidence(candidates.quotients, candidates.distances, candidates.refined, LEAST_UNEXPLAINED)
    return np.asarray(columns @ WEIGHTS[:-1] + WEIGHTS[-1] > 0)


def is_covered(xy: NDArray[np.float32], markers: Refined) -> NDArray[np.bool_]:
    """Return (n,) whether places (n, 2) lie on one of the markers or so near that no other fits there."""
    covered = np.zeros(len(xy), dtype=bool)
    for center, affine in zip(markers.xy, markers.affine, strict=True):
        covered |= (np.abs((xy - center) @ np.linalg.inv(affine).T) < COVERED).all(axis=1)
    return covered


def one_of_each(candidates: Candidates) -> Candidates:
    """Return the best explained of the candidates at each place."""
    refined = candidates.refined
    return candidates[one_each(refined.xy, refined.side_px, refined.explained)]


def joined(first: Candidates, second: Candidates) -> Candidates:
    """Return the candidates of both."""
    refined = _column_wise(lambda a, b: np.concatenate([a, b]), first.refined, second.refined)
    return Candidates(
        np.concatenate([first.rows, second.rows]),
        np.concatenate([first.quotients, second.quotients]),
        np.concatenate([first.distances, second.distances]),
        refined,
    )


def _column_wise(operation: Callable[..., NDArray[Any]], *refined: Refined) -> Refined:
    return Refined(**{c.name: operation(*(getattr(r, c.name) for r in refined)) for c in fields(Refined)})
