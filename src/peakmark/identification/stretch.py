"""Vertical stretching before detection (paper, Section 4.2): a floor's markers look wider than high, which it undoes.

A stretch is a number for the whole image, as in the paper, or one number a row: seen by a camera of known pitch,
each row of the floor has its own foreshortening.
"""

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints

if TYPE_CHECKING:
    from peaksim.camera.camera import Camera

SMALLEST, LARGEST = 0.25, 8.0
"""Range of stretches that are accepted."""

LARGEST_OF_ROWS = 4.0
"""Stretch beyond which `floor_stretch` does not go: of a surface seen at 75.5°."""

Stretch = float | NDArray[np.float64]
"""One factor, or (H,) factors, one a row."""


def stretched(gray: NDArray[np.uint8], stretch: Stretch) -> NDArray[np.uint8]:
    """Return the image stretched vertically to the nearest whole height, bilinear.

    A factor that is not in 0.25…8, or factors that are not one a row, are an `InputError`.
    """
    factor = _check(stretch, gray.shape[0])
    if np.ndim(factor) == 0:
        height = max(1, round(gray.shape[0] * float(factor)))
        if height == gray.shape[0]:
            return gray
        return np.asarray(cv2.resize(gray, (gray.shape[1], height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    edges = _edges(factor)
    rows = np.interp(np.arange(round(edges[-1])) + 0.5, edges, np.arange(len(edges))) - 0.5
    return _resampled(gray, np.clip(rows, 0, gray.shape[0] - 1))


def unstretched(features: Keypoints, stretch: Stretch, height: int) -> Keypoints:
    """Map key points of the stretched image back to the given one, `height` rows high; sizes to equal area."""
    edges = _edges(np.broadcast_to(np.asarray(_check(stretch, height), dtype=np.float64), height))
    xy = features.xy.astype(np.float64)
    row = np.interp(xy[:, 1] + 0.5, edges, np.arange(height + 1))
    shrink = np.sqrt(np.diff(edges)[np.clip(row.astype(np.intp), 0, height - 1)])
    xy[:, 1] = row - 0.5
    return features.with_columns(xy=xy, size=features.size / shrink, scale=features.scale / shrink)


def floor_stretch(camera: "Camera", pitch_deg: float) -> NDArray[np.float64]:
    """Return the (H,) stretch of each row under which the markers of a floor look square to a camera without roll.

    Width over height of a small square on the floor, in the column of the principal point; at most 4, and 1 above the
    horizon. `pitch_deg` is how far the camera looks down from the horizon.
    """
    positions = np.column_stack([np.full(camera.height, camera.cx), np.arange(camera.height)])
    down = np.array([0, np.cos(np.radians(pitch_deg)), np.sin(np.radians(pitch_deg))])
    steps = ([0, 0.5], [0, -0.5], [0.5, 0], [-0.5, 0])
    below, above, right, left = (camera.unproject(positions + step) for step in steps)
    ray = (below + above) / 2
    length = np.linalg.norm(ray, axis=1)
    sink = ray @ down / length
    high = np.linalg.norm(np.cross(ray, below - above), axis=1) / length
    wide = np.linalg.norm(right - left, axis=1)
    with np.errstate(divide="ignore"):
        stretch = high / wide / sink
    return np.where(sink > 0, np.clip(stretch, 1.0, LARGEST_OF_ROWS), 1.0)


def _check(stretch: ArrayLike, height: int) -> NDArray[np.float64]:
    factor = np.asarray(stretch, dtype=np.float64)
    if factor.shape not in ((), (height,)):
        raise InputError(f"stretch: expected one number or {height}, one a row, got shape {factor.shape}")
    if not ((factor >= SMALLEST) & (factor <= LARGEST)).all():
        raise InputError(f"stretch: expected {SMALLEST:g}…{LARGEST:g}, got {np.min(factor):g}…{np.max(factor):g}")
    return factor


def _edges(stretches: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (H + 1,) upper edges of the rows in the stretched image, the last a whole number."""
    edges = np.concatenate([[0.0], np.cumsum(stretches)])
    return np.asarray(edges * (max(1, round(edges[-1])) / edges[-1]))


def _resampled(gray: NDArray[np.uint8], rows: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the image at fractional rows, bilinear, in 8-bit fixed point."""
    upper = np.minimum(rows.astype(np.intp), gray.shape[0] - 2) if gray.shape[0] > 1 else np.zeros(len(rows), np.intp)
    lower = np.minimum(upper + 1, gray.shape[0] - 1)
    weight = np.rint((rows - upper) * 256).astype(np.uint32)[:, None]
    mixed = gray[upper] * (256 - weight) + gray[lower] * weight
    return np.asarray((mixed + 128) >> 8, dtype=np.uint8)
