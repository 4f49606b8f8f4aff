"""SIFT's key points of a stretched image, and the paper's rule on them: rank, drop and the signature of Section 3.1."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.registry import opencv_sift
from peakmark.identification.detection import SIDE_OF_SCALE, Identification, unrefined_detections
from peakmark.identification.paper import select_markers
from peakmark.identification.search import PAD_SHARE, inside
from peakmark.identification.sift_candidates import SIDE_OF_SIGMA
from peakmark.identification.sift_signature import SIGNATURE, reference_sift_descriptor, sift_signature_distances
from peakmark.identification.stretch import Stretch, stretched, unstretched
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, Variant

LOW_CONTRAST = 0.01
"""Contrast threshold of OpenCV's SIFT that keeps tens of thousands of features of a floor image; its own is 0.04."""

SIGNATURE_LIMIT, SHARED_LIMIT = 0.45, 0.25
"""Distances up to which a feature can be a marker, from the signature and from what both polarities share of it: the
dark square around a light marker on white paper is 0.3 off. Chosen by hand, the latter on the CAVE that ships."""


def detect_sift(gray: NDArray[np.uint8], stretch: Stretch, threshold: float = LOW_CONTRAST) -> Keypoints:
    """Return OpenCV's SIFT features of the vertically stretched image, strongest first, in the given one's coordinates.

    The image is continued beyond its border, as for SURF's. `scale` is so that `SIDE_OF_SCALE` times it is the side of
    the DoG marker that a feature may be.
    """
    height, width = gray.shape
    pad = round(PAD_SHARE * width)
    found = opencv_sift(np.pad(stretched(gray, stretch), pad, mode="edge"), threshold)
    sides = found.size / 2 * np.float32(SIDE_OF_SIGMA)
    found = found.with_columns(xy=found.xy - np.float32(pad), scale=sides / np.float32(SIDE_OF_SCALE))
    return inside(unstretched(found, stretch, height), gray.shape)


def identify_sift_features(
    features: Keypoints, polarity: Polarity | Literal["both"] = "dark", limit: Limit = "energy"
) -> Identification:
    """Return which of an image's SIFT features are markers by the paper's rule, at SIFT's own positions."""
    assert features.descriptors is not None
    if polarity == "both":
        distances = shared_distances(features.descriptors, limit)
        rows = select_markers(features, distances, None, SHARED_LIMIT)
    else:
        variants = (Variant(polarity, limit, "sift"),) * len(features)
        distances = sift_signature_distances(features.descriptors, variants).astype(np.float32)
        rows = select_markers(features, distances, polarity, SIGNATURE_LIMIT)
    found = unrefined_detections(features, distances, None if polarity == "both" else polarity, rows)
    return Identification(features, distances, tuple(replace(d, limit=limit, made_for="sift") for d in found))


def shared_distances(descriptors: NDArray[np.float32], limit: Limit = "energy") -> NDArray[np.float32]:
    """Return (n,) distances of SIFT descriptors (n, 128) from what the signatures of both polarities share.

    A light marker's gradients are a dark one's reversed, so that opposite directions are added: SIFT's counterpart to
    the paper's version-independent signature of SURF.
    """
    vectors = np.asarray(descriptors, dtype=np.float64)
    vectors = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    reference = reference_sift_descriptor(Variant("dark", limit, "sift"))[None]
    return np.asarray(np.linalg.norm(_shared(vectors) - _shared(reference), axis=1), dtype=np.float32)


def _shared(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 16) sums of opposite directions in the inner four blocks."""
    return np.asarray(vectors[:, SIGNATURE].reshape(-1, 4, 2, 4).sum(axis=2).reshape(-1, 16))
