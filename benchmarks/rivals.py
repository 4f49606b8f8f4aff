"""What is measured against ours: OpenCV's SURF where cv2 has it, its SIFT, and mahotas's SURF where installed."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark import surf
from peakmark.detectors.registry import has_opencv_surf

Job = Callable[[], object]
ROWS = ("detect", "detect + describe", "strongest 200")
"""Rows of the speed table; rivals find and describe everything in the third, as theirs is no such choice."""


def jobs(gray: NDArray[np.uint8]) -> dict[str, dict[str, Job]]:
    """Row → library → what to time on this image."""
    found = len(surf.detect(gray))
    every = {row: {"peakmark": job} for row, job in zip(ROWS, _ours(gray), strict=True)}
    for library, pair in _rivals(gray, found).items():
        for row, job in zip(ROWS, (*pair, pair[1]), strict=True):
            every[row][library] = job
    return every


def _ours(gray: NDArray[np.uint8]) -> tuple[Job, Job, Job]:
    return (
        lambda: surf.detect(gray),
        lambda: surf.detect_and_describe(gray),
        lambda: surf.detect_and_describe(gray, strongest=200),
    )


def _rivals(gray: NDArray[np.uint8], found: int) -> dict[str, tuple[Job, Job]]:
    """Library → its detection, and its detection with descriptors; mahotas stops at as many key points as ours."""
    rivals: dict[str, tuple[Job, Job]] = {}
    if has_opencv_surf():
        opencv = cv2.xfeatures2d.SURF_create(100)  # type: ignore[attr-defined]
        rivals["opencv SURF"] = (lambda: opencv.detect(gray), lambda: opencv.detectAndCompute(gray, None))
    sift = cv2.SIFT_create()  # type: ignore[attr-defined]
    rivals["opencv SIFT"] = (lambda: sift.detect(gray), lambda: sift.detectAndCompute(gray, None))
    try:
        from mahotas.features import surf as mahotas
    except ImportError:
        return rivals
    rivals["mahotas SURF"] = (
        lambda: mahotas.interest_points(gray, 4, 5, 1, max_points=found),
        lambda: mahotas.surf(gray, 4, 5, 1, max_points=found),
    )
    return rivals
