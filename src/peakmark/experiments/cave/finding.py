"""Image → dark and light markers on walls, by either rule and of either detector, with what Figure 14 is drawn from."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.api import detect_stretched, identify, identify_features
from peakmark.identification.detection import Detection, Identification, is_polarity
from peakmark.identification.search import DISTANCE, detect_features, search_features
from peakmark.identification.sift_features import detect_sift, identify_sift_features, shared_distances
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Made

CaveRule = Literal["robust", "paper"]

_NEAR_SIDES = 0.15
"""A feature belongs to a marker that is found without it if it is so near, in the marker's sides."""


def detect(gray: NDArray[np.uint8], rule: CaveRule, made_for: Made) -> Keypoints:
    """Return the features of an image that a rule ranks."""
    if made_for == "sift":
        return detect_sift(gray, 1.0)
    return detect_features(gray) if rule == "robust" else detect_stretched(gray, 1.0)


def find(gray: NDArray[np.uint8], features: Keypoints, rule: CaveRule, made_for: Made) -> Identification:
    """Return the dark and light markers, and all features with their distances from the signature that both share.

    SIFT's markers are those of `identify(image, detector="sift")` by the robust rule; a detection's rank is then that
    of the strongest feature of its polarity near it, beyond all where there is none.
    """
    assert features.descriptors is not None
    if rule == "paper":
        if made_for == "sift":
            return identify_sift_features(features, "both")
        return identify_features(gray, features, "both", "paper", 1.0, refine=False)
    if made_for == "sift":
        markers = tuple(_ranked(marker, features) for marker in identify(gray, detector="sift"))
        return Identification(features, shared_distances(features.descriptors), markers)
    found = search_features(gray, features)
    return Identification(features, found.evidence[:, DISTANCE].astype(np.float32), found.detections)


def _ranked(marker: Detection, features: Keypoints) -> Detection:
    near = np.linalg.norm(features.xy - marker.xy, axis=1) < _NEAR_SIDES * marker.size
    rows = np.flatnonzero(near & is_polarity(features, marker.polarity or "dark"))
    return replace(marker, rank=int(rows[0] if len(rows) else len(features)) + 1)
