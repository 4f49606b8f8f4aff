"""Dark and light markers in one picture, any number of each (paper, Section 4.2: the SIFT/SURF CAVE).

    SURF ─▶ classifier over response, version-independent signature and size ─▶ one key point a marker
         ─▶ alignment with the printed pattern of its polarity ─▶ a second, linear decision ─▶ detections

The sign of the Laplacian tells the polarity; `polarity_by_signature` is the other way that the paper names.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark import surf
from peakmark.identification.classifier import Classifier, shipped_classifier
from peakmark.identification.detection import SIDE_OF_SCALE, Detection
from peakmark.identification.evidence import aligned_evidence, evidence, one_each
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity
from peakmark.refine.api import Refined, refine

THRESHOLD = 500.0
"""Hessian threshold; a marker of a fifth of the full contrast at 45° answers with about 2000."""

OCTAVES, LAYERS = 5, 5
"""One octave more than usual for markers to 500 px, and two layers more in each, so that octaves overlap: SURF's Newton
step rejects one marker in six hundred, seldom in two octaves at once."""

WEIGHTS = np.array([2.4, -23.0, 7.5, -122.0, -16.3])
"""Of the columns of `aligned_evidence`, and the offset: a logistic regression on 1255 alignments of markers ≥ 16 px and
123 of clutter (coins, letters, gravel) in 130 views of the training rooms. There markers ≥ 20 px lie 5.9 above 0, all
markers 2.7, and clutter 1.2 below. Noise costs what the pattern explains: at σ = 20 of 178 grey levels none passes."""

LEAST_UNEXPLAINED = 0.005
"""Unexplained shares below this count as this."""

_PAD_SHARE = 0.05
_POLARITIES: tuple[Polarity, Polarity] = ("light", "dark")
"""By (Laplacian > 0): OpenCV's class_id is +1 for a dark centre."""


@dataclass(frozen=True)
class Both:
    """Everything found in one picture."""

    features: Keypoints
    """All features, strongest first."""
    evidence: NDArray[np.float64]
    """(n, c) see `classification.COLUMNS`."""
    scores: NDArray[np.float64]
    """(n,) the classifier's."""
    candidates: NDArray[np.intp]
    """(k,) rows of the features above the operating point, one a place."""
    detections: tuple[Detection, ...]
    """The candidates that the printed pattern explains, strongest first; `rank` − 1 is the row of the feature."""


def identify_both(gray: NDArray[np.uint8], classifier: Classifier | None = None) -> Both:
    """Return the dark and light markers of a grey picture (H, W).

    Raises
    ------
    InputError
        If the image is not one that `surf.detect` takes.
    """
    return examine_both(gray, features_of(gray), classifier)


def examine_both(gray: NDArray[np.uint8], features: Keypoints, classifier: Classifier | None = None) -> Both:
    """Return which of a picture's features, from `features_of`, are markers."""
    columns = evidence(gray, features)
    chosen = classifier or shipped_classifier()
    scores = chosen.scores(columns)
    candidates = candidates_of(features, scores, chosen.threshold)
    return Both(features, columns, scores, candidates, verified(gray, features, columns, candidates))


def features_of(gray: NDArray[np.uint8], layers: int = LAYERS) -> Keypoints:
    """Return the SURF features, strongest first, those of markers at the border included.

    SURF needs more room than a marker covers, so that the picture is continued beyond its border.
    """
    pad = round(_PAD_SHARE * max(gray.shape))
    padded = np.pad(gray, pad, mode="edge")
    features = surf.detect_and_describe(padded, threshold=THRESHOLD, octaves=OCTAVES, layers=layers)
    features = features.with_columns(xy=features.xy - np.float32(pad))
    inside = (features.xy > -0.5) & (features.xy < np.array(gray.shape[::-1]) - 0.5)
    return features[inside.all(axis=1)]


def candidates_of(features: Keypoints, scores: NDArray[np.float64], threshold: float) -> NDArray[np.intp]:
    """Return the rows above the threshold, best first, without those within 0.6 sides of a better one."""
    rows = np.flatnonzero(scores > threshold)
    sides = SIDE_OF_SCALE * features.scale[rows].astype(np.float64)
    return rows[one_each(features.xy[rows].astype(np.float64), sides, scores[rows])]


def verified(
    gray: NDArray[np.uint8], features: Keypoints, columns: NDArray[np.float64], candidates: NDArray[np.intp]
) -> tuple[Detection, ...]:
    """Return the candidates that are markers once aligned with the pattern of their polarity, strongest first."""
    found: list[Detection] = []
    for sign, polarity in ((1, "dark"), (-1, "light")):
        rows = candidates[features.laplacian[candidates] == sign]
        refined = refine(gray, features.xy[rows], SIDE_OF_SCALE * features.scale[rows], f"surf-{polarity}")
        found += _detections(features, columns, rows, refined)
    xy, sides = np.array([d.xy for d in found]).reshape(-1, 2), np.array([d.size for d in found])
    kept = [found[i] for i in one_each(xy, sides, np.array([d.explained or 0.0 for d in found]))]
    return tuple(sorted(kept, key=lambda d: d.rank))


def _detections(
    features: Keypoints, columns: NDArray[np.float64], rows: NDArray[np.intp], refined: Refined
) -> list[Detection]:
    sides_px = refined.side_px
    aligned = aligned_evidence(columns[rows, 3], columns[rows, 1], refined, LEAST_UNEXPLAINED)
    good = aligned @ WEIGHTS[:-1] + WEIGHTS[-1] > 0
    return [
        Detection(
            id=int(row),
            xy=refined.xy[k],
            size=float(sides_px[k]),
            polarity=_POLARITIES[int(features.laplacian[row] > 0)],
            response=float(features.response[row]),
            signature_distance=float(columns[row, 1]),
            rank=int(row) + 1,
            affinity=refined.affine[k],
            explained=float(refined.explained[k]),
        )
        for k, row in enumerate(rows)
        if good[k]
    ]
