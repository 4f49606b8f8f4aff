"""A camera that nobody calibrated: a pinhole with the field of view that EXIF tells, or that phones have."""

import math

from peaksim.camera.camera import Camera

FILM_DIAGONAL_MM = math.hypot(36, 24)
"""Of the film that EXIF's equivalent focal lengths refer to."""

PHONE_35MM = 26.0
"""Equivalent focal length of most phones' main camera, mm: 69° across the longer side."""


def guessed_camera(width: int, height: int, focal_35mm: float | None = None) -> Camera:
    """Return a pinhole camera without distortion; `focal_35mm` is 26 unless given.

    Lenses differ from what EXIF rounds by some percent, and distances from the camera with them.
    """
    focal_px = (focal_35mm or PHONE_35MM) / FILM_DIAGONAL_MM * math.hypot(width, height)
    return Camera(width, height, focal_px)
