"""Drawings on the frame: detections (the paper's Figure 10), arrays (Figures 13 and 15) and key points."""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth
from peaksim.image_file import to_8_bits

from peakmark.arrays.decode import MarkerArray
from peakmark.found.outline import outline_px
from peakmark.found.rows import FoundRow
from peakmark.identification.detection import Detection
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.score.markers import Score

_MOST_RANKS = 3
"""Of one marker that are written beside it."""

Canvas = NDArray[np.uint8]
Point = Sequence[float] | NDArray[Any]
Colour = tuple[int, int, int]

FOUND: Colour = (60, 220, 60)
FALSE: Colour = (255, 140, 0)
MISSED: Colour = (255, 40, 40)
"""RGB of found markers, false detections and missed markers."""

DARK, LIGHT, OTHER = (64, 160, 255), (255, 196, 0), (0, 230, 120)
"""RGB of key points with a dark centre (Laplacian +1), a light one (−1), and others."""


def draw_overlay(
    image: NDArray[Any],
    truth: Sequence[MarkerTruth],
    detections: Sequence[Detection],
    score: Score,
    ranks: Mapping[str, Sequence[int]] | None = None,
) -> Canvas:
    """Return an RGB copy of the image with each detection's outline and rank, and a cross on each missed marker.

    `ranks` has a marker's name → the ranks of all its features, if they are to be shown instead of the detection's.
    """
    canvas, line = rgb_copy(image), _line_px(image)
    matched = {index: name for name, index in score.matches.items()}
    for detection in detections:
        colour = FOUND if detection.id in matched else FALSE
        shown = (ranks or {}).get(matched.get(detection.id, ""), (detection.rank,))
        draw_circle(canvas, detection.xy, detection.size * 0.75, colour, 2 * line)
        at = detection.xy + np.array([detection.size * 0.8, 0])
        more = ", …" if len(shown) > _MOST_RANKS else ""
        draw_label(canvas, ", ".join(map(str, shown[:_MOST_RANKS])) + more, at, colour, line)
    for marker in truth:
        if marker.name in score.missed:
            draw_cross(canvas, marker.center_xy, max(12, marker.side_px), MISSED, 2 * line)
    return canvas


def draw_arrays(
    image: NDArray[Any], detections: Sequence[Detection], arrays: Sequence[MarkerArray], missed_xy: Sequence[Point]
) -> Canvas:
    """Return an RGB copy with a cross on each marker and missed position, and each array's outline and number."""
    canvas, line = rgb_copy(image), _line_px(image)
    for detection in detections:
        draw_cross(canvas, detection.xy, 14 * line, FOUND, 2 * line, cv2.MARKER_CROSS)
    for array in arrays:
        colour, corners = FALSE if array.code is None else FOUND, outline_px(array)
        draw_outline(canvas, corners, colour, 2 * line)
        draw_label(canvas, "?" if array.code is None else str(array.code), corners[1], colour, line, 2.5)
    for xy in missed_xy:
        draw_cross(canvas, xy, 24 * line, MISSED, 2 * line)
    return canvas


def draw_found(image: NDArray[Any], rows: Sequence[FoundRow]) -> Canvas:
    """Return an RGB copy with the outline of each marker, dark or light, and each array's outline and number.

    The image is any that `as_gray` takes.
    """
    canvas = rgb_copy(to_8_bits(image)) if image.ndim == 3 else rgb_copy(as_gray(image))
    line = _line_px(canvas)
    for row in rows:
        if row.kind == "marker":
            colour = {"dark": DARK, "light": LIGHT}.get(row.polarity or "", OTHER)
            draw_outline(canvas, row.corners, colour, 2 * line)
            draw_cross(canvas, (row.x, row.y), 0.2 * row.side_px, colour, line, cv2.MARKER_CROSS)
    for row in rows:
        if row.kind == "array":
            colour = FALSE if row.code is None else FOUND
            draw_outline(canvas, row.corners, colour, 2 * line)
            draw_label(canvas, "?" if row.code is None else str(row.code), row.corners[1], colour, line, 2.5)
    return canvas


def draw_keypoints(image: NDArray[Any], keypoints: Keypoints, strongest: int = 2000) -> Canvas:
    """Return the grey image as RGB with the strongest key points' circles, of half their size, and orientations.

    The image is any that `as_gray` takes; an angle below 0 draws no line.
    """
    canvas = rgb_copy(as_gray(image))
    shown = keypoints[:strongest]
    angles = np.deg2rad(shown.angle)
    tips = shown.xy + shown.size[:, None] / 2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for k in reversed(range(len(shown))):
        colour = {1: DARK, -1: LIGHT}.get(int(shown.laplacian[k]), OTHER)
        draw_circle(canvas, shown.xy[k], float(shown.size[k]) / 2, colour, 1)
        if shown.angle[k] >= 0:
            cv2.line(canvas, _fixed(shown.xy[k]), _fixed(tips[k]), colour, 1, cv2.LINE_AA, shift=_BITS)
    return canvas


# --- parts of an image -----------------------------------------------------------------------------------------


def box_around(xy: NDArray[np.float64], margin_px: float, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of the part around (n, 2) points of an image of (width, height).

    Right and bottom are exclusive; the part has at least one pixel.
    """
    low = np.clip(np.floor(xy.min(axis=0) - margin_px), 0, np.array(size) - 1)
    high = np.clip(np.ceil(xy.max(axis=0) + margin_px), low + 1, size)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


# --- strokes, drawn in place; points are px with centres at integers ----------------------------------------------

_BITS = 4  # OpenCV's fractional bits: positions and radii to a sixteenth of a px
_FARTHEST = 2.0**20  # px: what lies beyond is in no image, and far beyond OpenCV refuses to draw


def rgb_copy(image: NDArray[Any]) -> Canvas:
    """Return a (H, W, 3) copy of a grey or RGB image, of 8 or 16 bits, to draw on."""
    image = to_8_bits(image)
    return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else np.array(image, order="C")


def draw_circle(canvas: Canvas, xy: Point, radius: float, colour: Colour, thickness: int) -> None:
    """Draw a circle, filled where the thickness is −1."""
    cv2.circle(canvas, _fixed(xy), round(_near(radius) * 2**_BITS), colour, thickness, cv2.LINE_AA, _BITS)


def draw_outline(canvas: Canvas, corners: Sequence[Point] | NDArray[Any], colour: Colour, thickness: int) -> None:
    """Draw a closed polygon."""
    fixed = np.array([_fixed(xy) for xy in corners], dtype=np.int32)
    cv2.polylines(canvas, [fixed], True, colour, thickness, cv2.LINE_AA, _BITS)


def draw_cross(
    canvas: Canvas, xy: Point, size: float, colour: Colour, thickness: int, kind: int = cv2.MARKER_TILTED_CROSS
) -> None:
    """Draw a cross at the nearest pixel."""
    cv2.drawMarker(canvas, _nearest(xy), colour, kind, round(_near(size)), thickness, cv2.LINE_AA)


def draw_label(canvas: Canvas, text: str, xy: Point, colour: Colour, line: int, scale: float = 1.0) -> None:
    """Write text with a dark rim, so that it can be read on any floor."""
    size = 0.55 * scale * max(1.0, canvas.shape[1] / 1300)
    for ink, width in (((0, 0, 0), 4 * line), (colour, 2 * line)):
        cv2.putText(canvas, text, _nearest(xy), cv2.FONT_HERSHEY_SIMPLEX, size, ink, width, cv2.LINE_AA)


def _line_px(image: NDArray[np.uint8]) -> int:
    """Return half the thickness of strokes, so that they show when a page scales the image down."""
    return int(max(1, round(image.shape[1] / 1000)))


def _fixed(xy: Point) -> tuple[int, int]:
    return round(_near(xy[0]) * 2**_BITS), round(_near(xy[1]) * 2**_BITS)


def _nearest(xy: Point) -> tuple[int, int]:
    return round(_near(xy[0])), round(_near(xy[1]))


def _near(px: float) -> float:
    return min(max(float(px), -_FARTHEST), _FARTHEST)
