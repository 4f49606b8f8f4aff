"""Signatures of SIFT markers: the inner four blocks of SIFT's descriptor (paper, Section 3.1 and Figure 4)."""

from collections.abc import Mapping
from functools import cache
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.identification.alignment import Aligned, span_of
from peakmark.identification.marker_evidence import Column
from peakmark.identification.sift_candidates import SIDE_OF_SIGMA
from peakmark.identification.square_edges import square_edges
from peakmark.markers.patterns import Variant, marker_image

SIGNATURE = (8 * np.array([5, 6, 9, 10])[:, None] + np.arange(8)).ravel()
"""The 32 of the 128 descriptor dimensions (0-based), of inner blocks by rows, each with 8 directions."""

SIFT_COLUMNS = ("signature", "is_disc", "is_light", "edge_1", "edge_2", "edge_4", "ground")
"""Evidence of SIFT markers beside that of all."""

_REFERENCE_SIGMA = 8.0
_FIRST_SIGMA, _LAYERS = 1.6, 3

_SMALL_OCTAVE = 255
"""The octave, −1, for which OpenCV doubles an image."""

_REACH_SIGMAS, _REACH_PX = 10.7, 9.0
"""How far a descriptor sees, and the blur beneath it."""


def sift_columns(gray: NDArray[np.uint8], aligned: Aligned, variants: tuple[Variant, ...]) -> Mapping[str, Column]:
    """Return evidence of alignments, in the order of `SIFT_COLUMNS`.

    The signature's distance at the aligned place and size; whether the pattern is a disc, and light; and of the square
    that it is printed in, whose rotation the pattern does not tell: how much lighter it is outside than inside at the
    two lowest and the highest of its sides, over gain, in the rotation where that is most, and the deviation inside.
    """
    sides = aligned.sides_px / np.array([span_of(variant) for variant in variants])
    distances = sift_signature_distances(upright_descriptors(gray, aligned.theta[:, :2], sides, variants), variants)
    kinds = (
        np.array([float(v.limit == "range") for v in variants]),
        np.array([float(v.polarity == "light") for v in variants]),
    )
    return dict(zip(SIFT_COLUMNS, (distances, *kinds, *square_edges(gray, aligned).T), strict=True))


def sift_signature_distances(descriptors: ArrayLike, variants: tuple[Variant, ...]) -> NDArray[np.float64]:
    """Return (n,) Euclidean distances of SIFT descriptors (n, 128) from the signatures of the variants' ideal markers.

    Both descriptors are divided by their lengths first.
    """
    vectors = np.asarray(descriptors, dtype=np.float64).reshape(-1, 128)
    vectors = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    references = np.array([reference_sift_descriptor(variant) for variant in variants]).reshape(-1, 128)
    return np.asarray(np.linalg.norm((vectors - references)[:, SIGNATURE], axis=1))


def key_sigma(side_px: NDArray[np.float64] | float, variant: Variant) -> NDArray[np.float64]:
    """Return σ of a marker's own key point, px."""
    return np.asarray(np.asarray(side_px) / SIDE_OF_SIGMA * (np.sqrt(2) if variant.limit == "range" else 1.0))


def upright_descriptors(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float64],
    sides: NDArray[np.float64],
    variants: tuple[Variant, ...],
    angle_deg: float = 0.0,
) -> NDArray[np.float32]:
    """Return OpenCV's SIFT descriptors (n, 128) at markers' key points, turned by an angle from the image's x axis."""
    found = np.zeros((len(xy), 128), np.float32)
    sigmas = np.array([float(key_sigma(side, variant)) for side, variant in zip(sides, variants, strict=True)])
    is_small = np.array([_packed_octave(sigma) & 255 == _SMALL_OCTAVE for sigma in sigmas], dtype=bool)
    _describe(gray, xy, sigmas, np.flatnonzero(~is_small), angle_deg, found)
    for row in np.flatnonzero(is_small):  # OpenCV doubles the whole of an image for them, which costs most of all
        reach = _REACH_SIGMAS * sigmas[row] + _REACH_PX
        left, top = (np.maximum(np.floor(xy[row] - reach), 0)).astype(int)
        right, bottom = np.ceil(xy[row] + reach).astype(int) + 1
        _describe(gray[top:bottom, left:right], xy - [left, top], sigmas, np.array([row]), angle_deg, found)
    return found


def _describe(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float64],
    sigmas: NDArray[np.float64],
    rows: NDArray[np.intp],
    angle_deg: float,
    found: NDArray[np.float32],
) -> None:
    """Fill in the descriptors of some key points; those that OpenCV leaves out stay."""
    if not len(rows) or not gray.size:
        return
    points = [
        cv2.KeyPoint(float(x), float(y), 2 * float(sigma), angle_deg, 1.0, _packed_octave(sigma), int(row))
        for row, (x, y), sigma in zip(rows, xy[rows], sigmas[rows], strict=True)
    ]
    kept, descriptors = _sift().compute(gray, points)
    if descriptors is not None:
        found[[point.class_id for point in kept]] = descriptors


def _sift() -> Any:
    return cv2.SIFT_create(enable_precise_upscale=True)  # type: ignore[attr-defined]


def _packed_octave(sigma: float) -> int:
    """Return what OpenCV's SIFT keeps in a key point's octave: octave, and layer of three."""
    level = max(round(_LAYERS * float(np.log2(sigma / _FIRST_SIGMA))), -_LAYERS + 1)
    octave, layer = divmod(level - 1, _LAYERS)
    return (octave & 255) | (layer + 1) << 8


@cache
def reference_sift_descriptor(variant: Variant) -> NDArray[np.float64]:
    """Return the (128,) descriptor of length 1 of an ideal marker seen squarely, on its own ground."""
    return _described_view(variant, _sheet(variant, is_on_paper=False), _REFERENCE_SIGMA, 0.0)


@cache
def sift_views(variant: Variant) -> NDArray[np.float64]:
    """Return (13, 128) descriptors of length 1: the reference, and views on paper, square and at 45°, turned by 30°."""
    found = [reference_sift_descriptor(variant)]
    for turn_deg, tilt_deg, towards_deg in product((0.0, 30.0, 60.0), (0.0, 45.0), (0.0, 90.0)):
        narrow, angle = np.cos(np.radians(tilt_deg)), np.radians(towards_deg)
        c, s = np.cos(angle), np.sin(angle)
        spin, sheet = np.array([[c, -s], [s, c]]), _sheet(variant, is_on_paper=True)
        linear = spin @ np.diag([narrow**-0.5, narrow**0.5]) @ spin.T
        middle = np.full(2, (len(sheet) - 1) / 2)
        view = cv2.warpAffine(
            sheet, np.column_stack([linear, middle - linear @ middle]), sheet.shape, borderMode=cv2.BORDER_REPLICATE
        )
        found.append(_described_view(variant, np.asarray(view), _REFERENCE_SIGMA * narrow**0.25, turn_deg))
    return np.array(found)


def _sheet(variant: Variant, is_on_paper: bool) -> NDArray[np.uint8]:
    """Return a marker whose key point has the reference's scale, in the middle of three sides."""
    side = round(float(SIDE_OF_SIGMA * _REFERENCE_SIGMA / (np.sqrt(2) if variant.limit == "range" else 1.0)))
    marker = marker_image(side, variant)
    return np.pad(marker, side, constant_values=255) if is_on_paper else np.pad(marker, side, mode="edge")


def _described_view(variant: Variant, view: NDArray[np.uint8], sigma: float, turn_deg: float) -> NDArray[np.float64]:
    side = np.array([sigma * SIDE_OF_SIGMA / (np.sqrt(2) if variant.limit == "range" else 1.0)])
    middle = np.array([[(len(view) - 1) / 2] * 2])
    vector = upright_descriptors(view, middle, side, (variant,), turn_deg)[0].astype(np.float64)
    vector /= np.linalg.norm(vector)
    vector.setflags(write=False)
    return np.asarray(vector)
