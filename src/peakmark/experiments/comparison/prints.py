"""What is printed: one pattern of each design, all of the same printed area."""

import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.tags import tag_dictionary
from peakmark.errors import InputError
from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.markers.patterns import Polarity, Variant, marker_image, surf_marker

Design = Literal[
    "marker", "binary marker", "SIFT marker", "disc", "array", "AprilTag 36h11", "ArUco 4×4", "ring", "chess corner"
]
DESIGNS: tuple[Design, ...] = get_args(Design)

SIDE_M = 0.06
"""Side of the square that each design's print takes, black borders and the white inside included; a ring's ink has
that square's area, an array's three markers and the white between them stand in it; it is 12 σ of a DoG or disc."""

TEXELS = 360
"""Of that side: a multiple of the 22.5 cells of an array, and of the 6 and 8 modules of the tags."""

MARGIN = 0.2
"""White around the square, in sides."""

ARRAY_SIDE = 1 / (1 + THREE_BIT.pitch)
"""Side of an array's markers, in sides of its square."""

RING_RADIUS = np.sqrt(1 / np.pi)
"""Outer radius of the ring's ink, in sides."""

_RING_IDS = 11
_MARKERS: Mapping[Design, Variant] = {
    "marker": Variant("dark", "energy", "surf"),
    "binary marker": Variant("dark", "range", "surf"),
    "SIFT marker": Variant("dark", "energy", "sift"),
    "disc": Variant("dark", "range", "sift"),
}
"""Designs that are one marker; their light ones have the number 1."""
_TAGS: Mapping[Design, str] = {"AprilTag 36h11": "DICT_APRILTAG_36h11", "ArUco 4×4": "DICT_4X4_50"}

IDS: Mapping[Design, int] = {
    **dict.fromkeys(_MARKERS, 2),
    "array": 2**THREE_BIT.bits,
    "AprilTag 36h11": 12,
    "ArUco 4×4": 12,
    "ring": _RING_IDS,
    "chess corner": 1,
}
"""How many different ones hang: the two polarities, the eight codes, the first ids of the dictionaries."""


@cache
def drawn(design: Design, code: int) -> NDArray[np.uint8]:
    """Return one print with its white margin, grey levels; (1 + 2 · MARGIN) · TEXELS a side."""
    side = round((1 + 2 * MARGIN) * TEXELS)
    paper = np.full((side, side), 255, np.uint8)
    if design == "ring":
        return _ring(paper, code)
    edge = round(MARGIN * TEXELS)
    paper[edge : edge + TEXELS, edge : edge + TEXELS] = _square(design, code)
    return paper


def _square(design: Design, code: int) -> NDArray[np.uint8]:
    if design in _TAGS:
        return np.asarray(tag_dictionary(_TAGS[design]).generateImageMarker(code, TEXELS), dtype=np.uint8)
    if design == "chess corner":
        half = TEXELS // 2
        return np.array([[0, 255], [255, 0]], np.uint8).repeat(half, axis=0).repeat(half, axis=1)
    if design == "array":
        return _array(code)
    return marker_image(TEXELS, _MARKERS[design]._replace(polarity=polarity_of_code(code)))


def polarity_of_code(code: int) -> Polarity:
    """Return the polarity that a marker's number stands for."""
    return "light" if code else "dark"


def _array(code: int) -> NDArray[np.uint8]:
    image, side = np.full((TEXELS, TEXELS), 255, np.uint8), round(ARRAY_SIDE * TEXELS)
    for polarity, (column, row) in zip(polarities_of(code), THREE_BIT.cells, strict=True):
        left, top = (round(step * THREE_BIT.pitch * side) for step in (column, row))
        image[top : top + side, left : left + side] = surf_marker(side, polarity)
    return image


def _ring(paper: NDArray[np.uint8], code: int) -> NDArray[np.uint8]:
    """Return ringgrid's own drawing of one ring, scaled so that its ink ends at `RING_RADIUS`."""
    patch = _ring_patches()[code]
    width = round(2 * RING_RADIUS * TEXELS)
    scaled = cv2.resize(patch, (width, width), interpolation=cv2.INTER_AREA)
    edge = (len(paper) - width) // 2
    paper[edge : edge + width, edge : edge + width] = scaled
    return paper


@cache
def ring_layout() -> Any:
    """Return ringgrid's target of `_RING_IDS` rings with its usual shares of radii; an `InputError` without it."""
    try:
        import ringgrid
    except ImportError as error:
        raise InputError("rings need ringgrid: pip install 'peakmark[compare]'") from error
    outer = 10.0
    return ringgrid.TargetLayout.coded_rect(
        pitch_mm=4 * outer,
        rows=1,
        cols=_RING_IDS,
        outer_radius_mm=outer,
        inner_radius_mm=outer * 2 / 3,
        ring_width_mm=0.24 * outer,
    )


@cache
def _ring_patches() -> tuple[NDArray[np.uint8], ...]:
    """Return (n, n) images of the rings, cut where their ink ends, by number."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "rings.png")
        ring_layout().write_png(path, dpi=600.0, margin_mm=5.0, include_scale_bar=False)
        sheet = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    inked = np.flatnonzero((sheet < 128).any(axis=0))
    starts = inked[np.flatnonzero(np.diff(inked, prepend=-100) > 20)]
    rows = np.flatnonzero((sheet < 128).any(axis=1))
    width = rows[-1] - rows[0] + 1
    patches = tuple(sheet[rows[0] : rows[0] + width, left : left + width] for left in starts)
    if len(patches) != _RING_IDS:
        raise InputError(f"rings: expected {_RING_IDS} on ringgrid's sheet, got {len(patches)}")
    return patches
