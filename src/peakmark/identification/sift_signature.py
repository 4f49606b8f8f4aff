"""Signatures of SIFT markers: the inner four blocks of SIFT's descriptor (paper, Section 3.1 and Figure 4)."""

from collections.abc import Mapping
from functools import cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.identification.alignment import Aligned, span_of
from peakmark.identification.marker_evidence import Column
from peakmark.identification.sift_candidates import SIDE_OF_SIGMA
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA, Variant, sift_marker

SIGNATURE = (8 * np.array([5, 6, 9, 10])[:, None] + np.arange(8)).ravel()
"""The 32 of the 128 descriptor dimensions (0-based), of inner blocks by rows, each with 8 directions."""

_REFERENCE_SIGMA = 8.0
_FIRST_SIGMA, _LAYERS = 1.6, 3


def sift_columns(gray: NDArray[np.uint8], aligned: Aligned, variants: tuple[Variant, ...]) -> Mapping[str, Column]:
    """Return evidence of alignments: the signature's distance at the aligned place and size, and which are discs."""
    sides = aligned.sides_px / np.array([span_of(variant) for variant in variants])
    distances = sift_signature_distances(upright_descriptors(gray, aligned.theta[:, :2], sides, variants), variants)
    return {"signature": distances, "is_disc": np.array([float(v.limit == "range") for v in variants])}


def sift_signature_distances(descriptors: ArrayLike, variants: tuple[Variant, ...]) -> NDArray[np.float64]:
    """Return (n,) Euclidean distances of SIFT descriptors (n, 128) from the signatures of the variants' ideal markers.

    Both descriptors are divided by their lengths first.
    """
    vectors = np.asarray(descriptors, dtype=np.float64).reshape(-1, 128)
    vectors = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    references = np.array([reference_sift_descriptor(variant) for variant in variants]).reshape(-1, 128)
    return np.asarray(np.linalg.norm((vectors - references)[:, SIGNATURE], axis=1))


def key_sigma(side_px: NDArray[np.float64] | float, variant: Variant) -> NDArray[np.float64]:
    """Return σ of a marker's own key point, px."""
    return np.asarray(np.asarray(side_px) / SIDE_OF_SIGMA * (np.sqrt(2) if variant.limit == "range" else 1.0))


def upright_descriptors(
    gray: NDArray[np.uint8], xy: NDArray[np.float64], sides: NDArray[np.float64], variants: tuple[Variant, ...]
) -> NDArray[np.float32]:
    """Return OpenCV's SIFT descriptors (n, 128) at markers' key points, with the image's x axis as direction."""
    if not len(xy):
        return np.empty((0, 128), np.float32)
    sigmas = [float(key_sigma(side, variant)) for side, variant in zip(sides, variants, strict=True)]
    points = [
        cv2.KeyPoint(float(x), float(y), 2 * sigma, 0.0, 1.0, _packed_octave(sigma), k)
        for k, ((x, y), sigma) in enumerate(zip(xy, sigmas, strict=True))
    ]
    detector = cv2.SIFT_create(enable_precise_upscale=True)  # type: ignore[attr-defined]
    kept, descriptors = detector.compute(gray, points)
    found = np.zeros((len(xy), 128), np.float32)
    if descriptors is not None:
        found[[point.class_id for point in kept]] = descriptors
    return found


def _packed_octave(sigma: float) -> int:
    """Return what OpenCV's SIFT keeps in a key point's octave: octave, and layer of three."""
    level = max(round(_LAYERS * float(np.log2(sigma / _FIRST_SIGMA))), -_LAYERS + 1)
    octave, layer = divmod(level - 1, _LAYERS)
    return (octave & 255) | (layer + 1) << 8


@cache
def reference_sift_descriptor(variant: Variant) -> NDArray[np.float64]:
    """Return the (128,) descriptor of length 1 of an ideal marker seen squarely, on its own ground."""
    sigma = _REFERENCE_SIGMA
    side = round(float(SIDE_OF_SIGMA * sigma / (np.sqrt(2) if variant.limit == "range" else 1.0)))
    marker = sift_marker(side / SIFT_SIDE_IN_SIGMA, side, variant.polarity, variant.limit)
    view = np.pad(marker, side, mode="edge")
    middle = np.array([[(len(view) - 1) / 2] * 2])
    vector = upright_descriptors(view, middle, np.array([float(side)]), (variant,))[0].astype(np.float64)
    vector /= np.linalg.norm(vector)
    vector.setflags(write=False)
    return np.asarray(vector)
