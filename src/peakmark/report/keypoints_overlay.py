"""Key points drawn on their image."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints

DARK_RGB, LIGHT_RGB, OTHER_RGB = (64, 160, 255), (255, 196, 0), (0, 230, 120)
"""Colours of key points with a dark centre (Laplacian +1), a light one (−1), and others."""


def draw_keypoints(image: NDArray[Any], keypoints: Keypoints, strongest: int = 2000) -> NDArray[np.uint8]:
    """Draw a circle of half the size and the orientation of each key point on the grey image.

    Parameters
    ----------
    image : as in `as_gray`.
    keypoints : in px of that image; an angle below 0 draws no line.
    strongest : draw only the first so many.

    Returns
    -------
    (H, W, 3) RGB.
    """
    canvas = cv2.cvtColor(as_gray(image), cv2.COLOR_GRAY2RGB)
    shown = keypoints[:strongest]
    angles = np.deg2rad(shown.angle)
    tips = shown.xy + shown.size[:, None] / 2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for k in reversed(range(len(shown))):
        colour = {1: DARK_RGB, -1: LIGHT_RGB}.get(int(shown.laplacian[k]), OTHER_RGB)
        center = _fixed_point(shown.xy[k])
        cv2.circle(canvas, center, round(float(shown.size[k]) * 8), colour, 1, cv2.LINE_AA, shift=4)
        if shown.angle[k] >= 0:
            cv2.line(canvas, center, _fixed_point(tips[k]), colour, 1, cv2.LINE_AA, shift=4)
    return canvas  # type: ignore[return-value]


def _fixed_point(xy: NDArray[Any]) -> tuple[int, int]:
    """OpenCV draws at 1 / 16 px with `shift=4`."""
    return round(float(xy[0]) * 16), round(float(xy[1]) * 16)
