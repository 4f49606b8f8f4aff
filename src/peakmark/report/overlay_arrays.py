"""Drawings of arrays on the frame: the paper's Figures 13 and 15."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.arrays.decode import MarkerArray
from peakmark.identification.detection import Detection
from peakmark.report.overlay import FALSE, FOUND, MISSED, label, point, rgb


def draw_arrays(
    image: NDArray[np.uint8],
    detections: Sequence[Detection],
    arrays: Sequence[MarkerArray],
    missed_xy: Sequence[NDArray[np.float64]],
) -> NDArray[np.uint8]:
    """Return an RGB copy with a cross on each marker, each array's outline and number, and each missed place."""
    canvas = np.ascontiguousarray(rgb(image)).copy()
    line = max(1, round(image.shape[1] / 1000))
    for detection in detections:
        cv2.drawMarker(canvas, point(detection.xy, 0), FOUND, cv2.MARKER_CROSS, 14 * line, 2 * line, cv2.LINE_AA)
    for array in arrays:
        colour = FALSE if array.code is None else FOUND
        outline = np.array([point(xy, 4) for xy in outline_px(array)], dtype=np.int32)
        cv2.polylines(canvas, [outline], True, colour, 2 * line, cv2.LINE_AA, shift=4)
        label(canvas, "?" if array.code is None else str(array.code), outline_px(array)[1], colour, line, 2.5)
    for xy in missed_xy:
        cv2.drawMarker(canvas, point(xy, 0), MISSED, cv2.MARKER_TILTED_CROSS, 24 * line, 2 * line, cv2.LINE_AA)
    return canvas


def outline_px(array: MarkerArray) -> NDArray[np.float64]:
    """Return (4, 2) corners around an array's markers, px; from the blank corner clockwise where it has a code."""
    if array.code is None:
        reach = 1.2 * np.mean([d.size for d in array.detections])
        xy = np.array([d.xy for d in array.detections])
        (x0, y0), (x1, y1) = xy.min(axis=0) - reach, xy.max(axis=0) + reach
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    layout, steps = array.layout, array.steps_px
    cells = np.array(layout.cells, dtype=np.float64)
    origin = array.xy - cells.mean(axis=0) @ steps.T
    low, high = np.array([-0.5, -0.5]), np.array([layout.columns, layout.rows]) - 0.5
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    return np.asarray(origin + corners @ steps.T)


def box_around(xy: NDArray[np.float64], margin_px: float, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of a part of a picture of (width, height) around (n, 2) points.

    Right and bottom are exclusive; the part has a pixel at least.
    """
    low = np.clip(np.floor(xy.min(axis=0) - margin_px), 0, np.array(size) - 1)
    high = np.clip(np.ceil(xy.max(axis=0) + margin_px), low + 1, size)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])
