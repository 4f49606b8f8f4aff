"""What a detector gave for one image, and what it did wrong: named and counted, so that a long run is not stopped."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.registry import Detector
from peakmark.keypoints.keypoints import Keypoints


@dataclass(frozen=True)
class Outcome:
    """A detector's key points without what cannot be one."""

    keypoints: Keypoints
    """Strongest first; finite and inside the image."""
    not_finite: int = 0
    outside: int = 0
    """Key points with nan or inf, and outside the image, left out."""
    failure: str = ""
    """The exception's type and text, where the detector raised one."""


def run_detector(detector: Detector, gray: NDArray[np.uint8]) -> Outcome:
    """Run a detector on one image; an exception or unusable key points are named and counted, not passed on."""
    try:
        keypoints = detector(gray)
    except Exception as error:
        return Outcome(Keypoints.empty(), failure=f"{type(error).__name__}: {error}")
    columns = [keypoints.xy, keypoints.size[:, None], keypoints.response[:, None]]
    finite = np.isfinite(np.concatenate(columns, axis=1)).all(axis=1)
    limit = np.array(gray.shape[1::-1]) - 0.5
    inside = ((keypoints.xy >= -0.5) & (keypoints.xy <= limit)).all(axis=1)
    kept = keypoints[finite & inside]
    order = np.argsort(-np.abs(kept.response), kind="stable")
    return Outcome(kept[order], int((~finite).sum()), int((finite & ~inside).sum()))
