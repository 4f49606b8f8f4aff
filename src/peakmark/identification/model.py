"""What identification was fitted to, in one place: the settings of both searches and their decisions.

The numbers come from the fits that their docstrings describe, which no command repeats; the classifier in
`classifier.json`, which shortens the list before, is made again by `scripts/train_classifier.py`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.evidence import aligned_evidence
from peakmark.refine.api import Refined


@dataclass(frozen=True)
class Decision:
    """When a candidate, aligned with the printed pattern, is a marker."""

    weights: NDArray[np.float64]
    """(4,) of the columns of `aligned_evidence`."""
    offset: float
    """Added to their weighted sum; a marker's score is above 0."""
    least_unexplained: float
    """Unexplained shares below this count as this: what is left of a marker is noise."""

    def are_markers(
        self, quotients: NDArray[np.float64], distances: NDArray[np.float64], refined: Refined
    ) -> NDArray[np.bool_]:
        """Return (n,) the decision on candidates of these quotients, signature distances and alignments."""
        columns = aligned_evidence(quotients, distances, refined, self.least_unexplained)
        return np.asarray(columns @ self.weights + self.offset > 0)


JOINT = Decision(np.array([8.8, -11.2, 4.1, -100.0]), -8.4, 0.018)
"""Of the search for one polarity: a logistic regression on 250 rendered views of the gravel floor (exposure 0.35…1.2,
blur to 1.2 px, with and without markers), 60 drawn images of blobs and letters, and scikit-image's photographs camera,
cell, gravel and page; no other floor or photograph had a part in it."""

BOTH = Decision(np.array([2.4, -23.0, 7.5, -122.0]), -16.3, 0.005)
"""Of the search for both polarities: a logistic regression on 1255 alignments of markers ≥ 16 px and 123 of clutter
(coins, letters, gravel) in 130 views of the training rooms. There markers ≥ 20 px lie 5.9 above 0, all markers 2.7, and
clutter 1.2 below. Noise costs what the pattern explains: at σ = 20 of 178 grey levels none passes."""

LONGEST_LIST = 60
"""Most features of an image that the search for one polarity aligns with the pattern, the likeliest first."""

SIGNATURE_SLOPE = 0.7
"""A feature's likelihood is its quotient − this · (signature distance − 0.3): the oblique line that the paper's Section
5 asks for, in the plane of the two."""

SHORT_LIST = 0.3
"""A feature is short-listed if its likelihood is above this. 0.42 would align a third as many features, and keeps all
markers of rides, but loses one in twelve where the stretch does not fit the view."""

PROMISING = 0.5
"""Candidates of a likelihood above this are aligned first, and again where that does not converge."""

RETRIES = (0.95, 1.15)
"""Multiples of its size from which a promising candidate is aligned again: one marker in two hundred needs it."""

COVERED = 0.7
"""Half the width, in sides, of the square around a marker in which the centre of no other can lie."""

THRESHOLD = 500.0
"""Hessian threshold of the search for both polarities; a marker of a fifth of the full contrast at 45° answers with
about 2000."""

OCTAVES, LAYERS = 5, 5
"""Its scale space: one octave more than usual for markers to 500 px, and two layers more in each, so that octaves
overlap. SURF's Newton step rejects one marker in six hundred, seldom in two octaves at once."""
