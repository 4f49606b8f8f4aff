"""Key points → markers by the paper's Section 4.2: rank by response, find the drop, compare signatures.

It needs markers in view: without any, or with weak ones beside strong ones, the largest drop is somewhere else.
"""

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.detection import is_polarity
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity

SIGNATURE_LIMIT = 0.45
"""Signature distance up to which a feature can be a marker; markers tilted to 75° stay below 0.35."""

VIS_LIMIT = 0.4
"""The same for both polarities at once, of the version-independent signature: light markers on white paper are 0.24 off
the reference already, see `signature.reference_descriptor`. Chosen by hand, on the CAVE that ships."""

SMALLEST_DROP = 1.3
"""Response ratio between features of neighbouring rank that counts as the drop from markers to clutter."""

RANKED = 1000
"""How many of the strongest features are searched for the drop on a floor; a wall may have thousands of markers."""


def select_markers(
    features: Keypoints, distances: NDArray[np.float32], polarity: Polarity | None = "dark", limit: float | None = None
) -> NDArray[np.intp]:
    """Return the rows of the markers among all features of an image, which come strongest first.

    `limit` is the largest distance, that of SURF's signatures unless given. `distances` are those from the signature of
    a polarity, or of the version-independent one without: then dark and light markers are found together, as in the
    paper's CAVE, and only features that are similar enough are ranked.
    """
    if polarity is None:
        return _select_similar(features, np.flatnonzero(distances <= (limit or VIS_LIMIT)))
    ranked = features[:RANKED]
    kept = suppress_non_maxima(ranked.xy, ranked.scale, ranked.response, by_larger=False)
    kept = kept[: above_drop(features.response[kept])]
    return kept[is_polarity(features, polarity)[kept] & (distances[kept] <= (limit or SIGNATURE_LIMIT))]


def _select_similar(features: Keypoints, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which of the similar features are above their drop; below the last comes the weakest of all features."""
    similar = features[rows]
    kept = rows[suppress_non_maxima(similar.xy, similar.scale, similar.response, by_larger=False)]
    return kept[: above_drop(np.append(features.response[kept], features.response[-1:]))]


def above_drop(responses: NDArray[np.float32]) -> int:
    """Return how many of the falling responses stand above the largest drop; 0 if none is large enough."""
    if len(responses) < 2:
        return len(responses)
    ratios = responses[:-1] / responses[1:]
    last = int(np.argmax(ratios))
    return last + 1 if ratios[last] >= SMALLEST_DROP else 0
