"""Key points → markers by the paper's Section 4.2: stretch, rank by response, find the drop, compare signatures."""

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
"""Response ratio between features of neighbouring rank that counts as the drop from markers to clutter."""

RANKED = 1000
"""How many of the strongest features are searched for the drop."""

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
    return examine(stretched_features(gray, stretch, threshold), polarity).detections


def stretched_features(gray: NDArray[np.uint8], stretch: float, threshold: float = LOW_THRESHOLD) -> Keypoints:
    """Return the SURF features of the vertically stretched image, in the coordinates of the given one."""
    tall = stretched(gray, stretch)
    return unstretched(surf.detect_and_describe(tall, threshold=threshold), tall.shape[0] / gray.shape[0])


def examine(features: Keypoints, polarity: Polarity = "dark") -> Identification:
    """Return which of an image's features, strongest first and with descriptors, are markers."""
    assert features.descriptors is not None
    distances = signature_distances(features.descriptors, polarity)
    return Identification(features, distances, select(features, distances, polarity))


def stretched(gray: NDArray[np.uint8], stretch: float) -> NDArray[np.uint8]:
    """Return the image stretched vertically to the nearest whole height, bilinear."""
    import cv2

    if not 0.25 <= stretch <= 8:
        raise InputError(f"stretch: expected 0.25…8, got {stretch}")
    if stretch == 1:
        return gray
    size = (gray.shape[1], max(1, round(gray.shape[0] * stretch)))
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def unstretched(features: Keypoints, stretch: float) -> Keypoints:
    """Map key points of the stretched image back: row y to (y + ½)/stretch − ½, sizes to equal area."""
    xy = features.xy.astype(np.float64)
    xy[:, 1] = (xy[:, 1] + 0.5) / stretch - 0.5
    shrink = np.sqrt(stretch)
    return features.with_columns(xy=xy, size=features.size / shrink, scale=features.scale / shrink)


def select(features: Keypoints, distances: NDArray[np.float32], polarity: Polarity) -> tuple[Detection, ...]:
    """Return the markers among all features of an image, which come strongest first."""
    sign = 1 if polarity == "dark" else -1  # OpenCV's class_id is the sign of the trace: +1 for a dark centre
    kept = merged(features, np.arange(min(len(features), RANKED)))
    kept = kept[: above_drop(features.response[kept])]
    kept = kept[(features.laplacian[kept] == sign) & (distances[kept] <= SIGNATURE_LIMIT)]
    return tuple(
        Detection(number, features.xy[i].astype(np.float64), float(features.scale[i]), polarity,
                  float(features.response[i]), float(distances[i]), int(i) + 1)
        for number, i in enumerate(kept)
    )  # fmt: skip


def merged(features: Keypoints, candidates: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the candidates, given strongest first, without those near a stronger one.

    A marker answers in more than one octave, and with ghosts of about 16 % of its response around its centre.
    """
    kept: list[int] = []
    for i in candidates:
        gaps = np.linalg.norm(features.xy[kept] - features.xy[i], axis=1)
        if (gaps > MERGE_RADIUS * features.scale[kept]).all():
            kept.append(int(i))
    return np.array(kept, dtype=np.intp)


def above_drop(responses: NDArray[np.float32]) -> int:
    """Return how many of the falling responses stand above the largest drop; 0 if none is large enough."""
    if len(responses) < 2:
        return len(responses)
    ratios = responses[:-1] / responses[1:]
    last = int(np.argmax(ratios))
    return last + 1 if ratios[last] >= SMALLEST_DROP else 0
