"""Key points → markers: the paper's rule of Section 4.2 — stretch, rank by response, find the drop, compare signatures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark import surf
from peakmark.errors import InputError
from peakmark.keypoints import Keypoints
from peakmark.marker import Polarity
from peakmark.signature import signature_distances

LOW_THRESHOLD = 100.0
"""Hessian threshold that keeps tens of thousands of features of a floor picture ("very low", Section 4.2)."""

SIGNATURE_LIMIT = 0.45
"""Signature distance up to which a feature can be a marker; markers tilted to 75° stay below 0.35."""

SMALLEST_DROP = 1.3
"""Response ratio between neighbouring candidates that counts as the drop from markers to clutter."""

MERGE_RADIUS = 0.6
"""In sizes of the stronger feature: weaker ones this near repeat it or are its ghosts."""


@dataclass(frozen=True)
class Detection:
    """An identified marker."""

    id: int
    """0, 1, … by falling response."""
    xy: NDArray[np.float64]
    """(2,) centre in the given image, px, pixel centres at integers."""
    size: float
    """Estimated side of the pattern in the given image (square root of its area), px."""
    polarity: Polarity
    """"dark" or "light" centre."""
    response: float
    """Determinant of the Hessian."""
    signature_distance: float
    """Euclidean distance from the ideal marker's signature."""
    rank: int
    """1-based rank of the feature by response among all features of the image."""


@dataclass(frozen=True)
class Identification:
    """Everything found in one image: what the figures of Section 4.2 are drawn from."""

    features: Keypoints
    """All features, strongest first, in the given (unstretched) image."""
    signature_distances: NDArray[np.float32]
    """(n,) of the features from the reference."""
    detections: tuple[Detection, ...]
    """The markers, strongest first."""


def identify(
    gray: NDArray[np.uint8],
    stretch: float = 2.0,
    polarity: Polarity = "dark",
    threshold: float = LOW_THRESHOLD,
) -> tuple[Detection, ...]:
    """Return the markers of one polarity in a grey image, strongest first; none is an empty tuple.

    Parameters
    ----------
    gray
        (H, W) uint8.
    stretch
        Vertical stretch before detection: about 1 / cos(tilt) of the surface that carries the markers.
    polarity
        Which markers to look for.
    threshold
        Hessian threshold of the detector.

    Raises
    ------
    InputError
        If the stretch is not in 0.25…8, or the image is not one that `surf.detect` takes.
    """
    return examine(gray, stretch, polarity, threshold).detections


def examine(
    gray: NDArray[np.uint8],
    stretch: float = 2.0,
    polarity: Polarity = "dark",
    threshold: float = LOW_THRESHOLD,
) -> Identification:
    """Do as `identify`, and return all features and their signature distances too."""
    features = surf.detect_and_describe(stretched(gray, stretch), threshold=threshold)
    distances = signature_distances(features.descriptors, polarity)
    features = unstretched(features, stretch)
    return Identification(features, distances, select(features, distances, polarity))


def stretched(gray: NDArray[np.uint8], stretch: float) -> NDArray[np.uint8]:
    """Return the image stretched vertically, bilinear; row y goes to (y + ½)·stretch − ½."""
    import cv2

    if not 0.25 <= stretch <= 8:
        raise InputError(f"stretch: expected 0.25…8, got {stretch}")
    if stretch == 1:
        return gray
    size = (gray.shape[1], round(gray.shape[0] * stretch))
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
