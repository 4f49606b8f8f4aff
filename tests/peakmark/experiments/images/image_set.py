"""A small set of images with truth: an array and an AprilTag on a wall, a lone marker, a plain wall."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from peakmark.detectors.tags import tag_dictionary
from peakmark.markers.patterns import surf_marker
from tests.peakmark.identification.walls import TEXELS, centers, sheet, wall

ARRAY_XY, ARRAY_SIDE, CODE = (150.0, 120.0), 36.0, 6
MARKER_XY, MARKER_SIDE = (300.0, 200.0), 30.0
TAG_XY, TAG_SIDE, TAG = (380.0, 80.0), 60.0, 7


def write_set(folder: Path) -> list[dict[str, Any]]:
    """Write the images and truth.json; return its content."""
    lone = np.full((2 * TEXELS, 2 * TEXELS), 255, np.uint8)
    lone[TEXELS // 2 : 3 * TEXELS // 2, TEXELS // 2 : 3 * TEXELS // 2] = surf_marker(TEXELS)
    tag = np.pad(tag_dictionary("DICT_APRILTAG_36h11").generateImageMarker(TAG, 80), 20, constant_values=255)
    with_array = wall(
        [(sheet(CODE), *ARRAY_XY, ARRAY_SIDE, 0), (np.asarray(tag, np.uint8), *TAG_XY, TAG_SIDE * TEXELS / 80, 0)]
    )
    images = {"array.png": with_array, "lone.png": wall([(lone, *MARKER_XY, MARKER_SIDE, 20)], seed=1)}
    images["plain.png"] = wall([], seed=2)
    for name, image in images.items():
        cv2.imwrite(str(folder / name), image)
    flat = {"tilt_deg": 0.0, "visible": 1.0, "inside": 1.0}
    members = [
        {"polarity": polarity, "xy": _member(cell), "side_px": ARRAY_SIDE, "group": "a", "code": CODE, **flat}
        for cell, polarity in centers(CODE).items()
    ]
    alone = {"polarity": "dark", "xy": MARKER_XY, "side_px": MARKER_SIDE, **flat}
    tags = [{"id": TAG, "xy": TAG_XY, "side_px": TAG_SIDE, "tilt_deg": 0.0, "visible": 1.0}]
    truth = [
        {"file": "array.png", "condition": "near", "version": "phone", "markers": members, "tags": tags},
        {"file": "lone.png", "condition": "far", "version": "phone", "markers": [alone]},
        {"file": "plain.png", "condition": "bare", "version": "phone", "markers": []},
    ]
    (folder / "truth.json").write_text(json.dumps(truth))
    return truth


def _member(cell: tuple[int, int]) -> tuple[float, float]:
    x, y = (c + 1.5 * (k - 0.5) * ARRAY_SIDE for c, k in zip(ARRAY_XY, cell, strict=True))
    return x, y
