"""Features of an image → markers, any number of them, also none: two searches, one decision on each feature by itself.

`find_markers` looks for one polarity in a stretched image, `search_image` for dark and light markers on walls::

    SURF ─▶ short list (a line over quotient and signature, or the classifier) ─▶ alignment with the printed pattern
         ─▶ linear decision (`model.Decision`) ─▶ non-maximum suppression ─▶ detections

A feature is judged by its *quotient*, its *signature distance* (Section 4.2), and by how well the *printed pattern*
explains the grey levels there once aligned with them (`peakmark.refine`), and how much blur that takes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from peakmark import surf
from peakmark.identification import model
from peakmark.identification.classifier import COLUMNS, Classifier, shipped_classifier
from peakmark.identification.detection import SIDE_OF_SCALE, Detection, is_polarity, pattern_name
from peakmark.identification.evidence import feature_evidence, response_quotients
from peakmark.identification.model import Decision
from peakmark.identification.stretch import Stretch
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.refine.api import Refined, refine

PAD_SHARE = 0.05
"""Rim that is added on every side before detection, as a share of the width, by repeating the outermost pixels: SURF
needs more room around a marker than the marker itself covers."""

QUOTIENT, DISTANCE = COLUMNS.index("quotient"), COLUMNS.index("vis_distance")
"""Columns of `feature_evidence` that the decision uses again."""


@dataclass(frozen=True)
class SearchResult:
    """Everything that the search for both polarities found in one image."""

    features: Keypoints
    """All features, strongest first."""
    evidence: NDArray[np.float64]
    """(n, c) columns, see `classifier.COLUMNS`."""
    scores: NDArray[np.float64]
    """(n,) the classifier's."""
    detections: tuple[Detection, ...]
    """Those above the operating point that the printed pattern explains, strongest first; their row is `rank` − 1."""


@dataclass(frozen=True)
class Candidates:
    """Features of the short list, aligned with the pattern."""

    rows: NDArray[np.intp]
    """(n,) rows of the features."""
    quotients: NDArray[np.float64]
    """(n,) see `response_quotients`."""
    distances: NDArray[np.float64]
    """(n,) signature distances."""
    refined: Refined
    """The alignment of each."""


def detect_to_the_border(gray: NDArray[np.uint8], pad: int, **parameters: Any) -> Keypoints:
    """Return SURF features, those of markers at the border included: the image is continued by `pad` px beyond it.

    Some lie outside the image. Further `parameters` are those of `surf.detect_and_describe`.
    """
    features = surf.detect_and_describe(np.pad(gray, pad, mode="edge"), **parameters)
    return features.with_columns(xy=features.xy - np.float32(pad))


def inside(features: Keypoints, shape: tuple[int, ...]) -> Keypoints:
    """Return the features inside an image of shape (H, W)."""
    are_inside = (features.xy > -0.5) & (features.xy < np.array(shape[::-1]) - 0.5)
    return features[are_inside.all(axis=1)]


def find_markers(
    gray: NDArray[np.uint8],
    features: Keypoints,
    distances: NDArray[np.float32],
    stretch: Stretch,
    polarity: Polarity,
    limit: Limit = "energy",
) -> tuple[Detection, ...]:
    """Return the markers of one polarity among an image's features, strongest first.

    At most `LONGEST_LIST` features above the oblique line are aligned, the promising ones first, and again from other
    sizes where that does not converge. Features on a marker already found are passed over: most are its corners and
    ghosts. The features come strongest first, in the coordinates of the unstretched image, with the stretch under which
    they were found and their (n,) signature distances.
    """
    quotients = response_quotients(gray, features, stretch)
    likelihoods = quotients - model.SIGNATURE_SLOPE * (distances - 0.3)
    listed = np.flatnonzero(is_polarity(features, polarity) & (likelihoods > model.SHORT_LIST))
    listed = listed[np.argsort(-likelihoods[listed], kind="stable")[: model.LONGEST_LIST]]
    promising = likelihoods[listed] > model.PROMISING
    found: list[Detection] = []

    def align(rows: NDArray[np.intp], factor: float) -> NDArray[np.intp]:
        """Align rows that lie on no marker found yet, keep those that are markers; return those that failed."""
        rows = rows[~are_covered(features.xy[rows], found)]
        sides = np.maximum(factor * SIDE_OF_SCALE * features.scale[rows], 2.0)
        refined = refine(gray, features.xy[rows], sides, pattern_name(polarity, limit))
        candidates = Candidates(rows, quotients[rows], distances[rows].astype(np.float64), refined)
        found.extend(accepted(features, candidates, model.JOINT, polarity))
        return rows[~refined.converged]

    left = listed[promising]
    for factor in (1.0, *model.RETRIES):
        left = align(left, factor)
    align(listed[~promising], 1.0)
    return tuple(replace(detection, id=number) for number, detection in enumerate(one_a_marker(found)))


def are_covered(xy: NDArray[np.float32], found: Sequence[Detection]) -> NDArray[np.bool_]:
    """Return (n,) whether positions (n, 2) lie on one of the refined markers or so near that no other fits there."""
    covered = np.zeros(len(xy), dtype=bool)
    for marker in found:
        assert marker.affinity is not None
        covered |= (np.abs((xy - marker.xy) @ np.linalg.inv(marker.affinity).T) < model.COVERED).all(axis=1)
    return covered


def search_image(gray: NDArray[np.uint8], classifier: Classifier | None = None) -> SearchResult:
    """Return the dark and light markers of a grey image (H, W), any number of each."""
    return search_features(gray, detect_features(gray), classifier)


def detect_features(gray: NDArray[np.uint8], layers: int = model.LAYERS) -> Keypoints:
    """Return the SURF features, with so many layers an octave, that this search wants, strongest first."""
    pad = round(PAD_SHARE * max(gray.shape))
    features = detect_to_the_border(gray, pad, threshold=model.THRESHOLD, octaves=model.OCTAVES, layers=layers)
    return inside(features, gray.shape)


def search_features(gray: NDArray[np.uint8], features: Keypoints, classifier: Classifier | None = None) -> SearchResult:
    """Return which of an image's features, from `detect_features`, are markers.

    The sign of the Laplacian tells the polarity; `signature.polarity_by_signature` is the paper's other way.
    """
    evidence = feature_evidence(gray, features)
    chosen = classifier or shipped_classifier()
    scores = chosen.scores(evidence)
    rows = np.flatnonzero(scores > chosen.threshold)
    rows = rows[
        suppress_non_maxima(features.xy[rows], SIDE_OF_SCALE * features.scale[rows].astype(np.float64), scores[rows])
    ]
    found: list[Detection] = []
    for polarity in get_args(Polarity):
        own = rows[is_polarity(features, polarity)[rows]]
        refined = refine(gray, features.xy[own], SIDE_OF_SCALE * features.scale[own], pattern_name(polarity, "energy"))
        candidates = Candidates(own, evidence[own, QUOTIENT], evidence[own, DISTANCE], refined)
        found += accepted(features, candidates, model.BOTH, polarity)
    return SearchResult(features, evidence, scores, one_a_marker(found))


def accepted(
    features: Keypoints, candidates: Candidates, decision: Decision, polarity: Polarity
) -> Iterator[Detection]:
    """Yield the candidates that are markers, each under the row of its feature."""
    refined, sides_px = candidates.refined, candidates.refined.side_px
    for k in np.flatnonzero(decision.are_markers(candidates.quotients, candidates.distances, refined)):
        row = int(candidates.rows[k])
        yield Detection(
            id=row,
            xy=refined.xy[k],
            size=float(sides_px[k]),
            polarity=polarity,
            response=float(features.response[row]),
            signature_distance=float(candidates.distances[k]),
            rank=row + 1,
            affinity=refined.affine[k],
            explained=float(refined.explained[k]),
        )


def one_a_marker(found: Sequence[Detection]) -> tuple[Detection, ...]:
    """Return of refined detections that overlap the best explained, strongest first."""
    xy, sides = np.array([d.xy for d in found]).reshape(-1, 2), np.array([d.size for d in found])
    kept = suppress_non_maxima(xy, sides, np.array([d.explained or 0.0 for d in found]))
    return tuple(sorted((found[k] for k in kept), key=lambda detection: detection.rank))
