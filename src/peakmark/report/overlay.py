"""Drawings on the frame: the paper's Figure 10, also for films."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.identification.detection import Detection
from peakmark.score.markers import Score

FOUND = (60, 220, 60)
FALSE = (255, 140, 0)
MISSED = (255, 40, 40)
"""RGB of found markers, false detections and missed markers."""


def draw_overlay(
    image: NDArray[np.uint8], truth: Sequence[MarkerTruth], detections: Sequence[Detection], score: Score
) -> NDArray[np.uint8]:
    """Return an RGB copy of the image with each detection's outline and rank, and a cross on each missed marker."""
    canvas = np.ascontiguousarray(rgb(image))
    line = max(1, round(image.shape[1] / 1000))
    matched = set(score.matches.values())
    for detection in detections:
        colour = FOUND if detection.id in matched else FALSE
        circle(canvas, detection.xy, detection.size * 0.75, colour, line)
        label(canvas, str(detection.rank), detection.xy + np.array([detection.size * 0.8, 0]), colour, line)
    for marker in truth:
        if marker.name in score.missed:
            cv2.drawMarker(
                canvas,
                point(marker.center_xy, 0),
                MISSED,
                cv2.MARKER_TILTED_CROSS,
                round(max(12, marker.side_px)),
                2 * line,
                cv2.LINE_AA,
            )
    return canvas


def rgb(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a grey or RGB image as (H, W, 3)."""
    return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image


def circle(canvas: NDArray[np.uint8], xy: NDArray[np.float64], radius: float, colour: Any, line: int) -> None:
    """Draw a circle in place; centre and radius to a sixteenth of a px."""
    cv2.circle(canvas, point(xy, 4), round(radius * 16), colour, 2 * line, cv2.LINE_AA, shift=4)


def label(
    canvas: NDArray[np.uint8], text: str, xy: NDArray[np.float64], colour: Any, line: int, scale: float = 1.0
) -> None:
    """Write text with a dark rim, so that it reads on any floor."""
    size = 0.55 * scale * max(1.0, canvas.shape[1] / 1300)
    for ink, width in (((0, 0, 0), 4 * line), (colour, 2 * line)):
        cv2.putText(canvas, text, point(xy, 0), cv2.FONT_HERSHEY_SIMPLEX, size, ink, width, cv2.LINE_AA)


def point(xy: NDArray[np.float64], shift: int) -> tuple[int, int]:
    """Return OpenCV's integer coordinates with `shift` fractional bits."""
    return round(float(xy[0]) * 2**shift), round(float(xy[1]) * 2**shift)
