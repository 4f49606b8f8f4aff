"""Image → markers: `identify`, by the paper's rule (`paper`) or by one decision on each feature (`search`)."""

from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError, check_choice
from peakmark.identification.detection import (
    SIDE_OF_SCALE,
    Detection,
    Identification,
    pattern_name,
    unrefined_detections,
)
from peakmark.identification.paper import select_markers
from peakmark.identification.search import PAD_SHARE, detect_to_the_border, find_markers, inside, search_image
from peakmark.identification.signature import signature_distances
from peakmark.identification.stretch import Stretch, stretched, unstretched
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, check_pattern
from peakmark.refine.api import refine

Rule = Literal["joint", "paper"]

LOW_THRESHOLD = 100.0
"""Hessian threshold that keeps tens of thousands of features of a floor image ("very low", Section 4.2)."""

STRONGEST = 300
"""Features that `identify` describes; an image with more markers in view needs more."""


def identify(
    image: ArrayLike,
    stretch: Stretch = 2.0,
    polarity: Polarity | Literal["both"] = "dark",
    threshold: float = LOW_THRESHOLD,
    rule: Rule = "joint",
    limit: Limit = "energy",
    refine: bool = True,
) -> tuple[Detection, ...]:
    """Return the markers in an image, strongest first; none is an empty tuple.

    Parameters
    ----------
    image
        Grey or RGB; see `peakmark.keypoints.image.as_gray`.
    stretch
        Vertical stretch before detection: about 1 / cos(tilt) of the surface that carries the markers; 2 is the
        paper's, `identification.stretch.floor_stretch` gives each row its own where the camera's pitch is known.
    polarity
        Which markers to look for. "both" is for walls: any number of dark and light ones, as `peakmark.decode_arrays`
        wants them; see `search.search_image`, which neither stretches nor uses the threshold.
    threshold
        Hessian threshold of the detector.
    rule
        "joint" weighs response and signature of each feature, and aligns the printed pattern: for any number of
        markers, also none. "paper" ranks by response and cuts at the largest drop (Section 4.2).
    limit
        Which marker was printed: "energy" (the paper's) or "range".
    refine
        Align the printed pattern with the image (`peakmark.refine`): centres to hundredths of a pixel, and the
        affinity. False leaves positions and sizes as SURF tells them.

    Raises
    ------
    InputError
        If the stretch is not in 0.25…8, polarity, rule or limit is unknown, both polarities are asked for with another
        rule or limit than the default, or the image is not one that `surf.detect` takes.
    """
    if polarity not in ("dark", "light", "both"):
        raise InputError(f"polarity: expected dark, light or both, got {polarity!r}")
    check_choice(rule, get_args(Rule), "rule")
    check_choice(limit, get_args(Limit), "limit")
    gray = as_gray(image)
    if polarity == "both":
        if (rule, limit) != ("joint", "energy"):
            raise InputError('rule, limit: expected "joint" and "energy" for both polarities')
        return search_image(gray).detections
    features = detect_stretched(gray, stretch, threshold, None if rule == "paper" else STRONGEST)
    return identify_features(gray, features, polarity, rule, stretch, limit, refine).detections


def detect_stretched(
    gray: NDArray[np.uint8],
    stretch: Stretch,
    threshold: float = LOW_THRESHOLD,
    strongest: int | None = None,
    **parameters: Any,
) -> Keypoints:
    """Return the SURF features of the vertically stretched image, in the coordinates of the given one.

    The image is continued beyond its border, so that markers at the border are found as well; features that lie
    outside it are left out. Further `parameters` are those of `surf.detect_and_describe`.
    """
    height, width = gray.shape
    settings = {"threshold": threshold, "strongest": strongest, **parameters}
    features = detect_to_the_border(stretched(gray, stretch), round(PAD_SHARE * width), **settings)
    return inside(unstretched(features, stretch, height), gray.shape)


def identify_features(
    gray: NDArray[np.uint8],
    features: Keypoints,
    polarity: Polarity = "dark",
    rule: Rule = "joint",
    stretch: Stretch = 2.0,
    limit: Limit = "energy",
    refine: bool = True,
) -> Identification:
    """Return which of an image's features, strongest first and with descriptors, are markers; see `identify`."""
    check_choice(rule, get_args(Rule), "rule")
    check_pattern(polarity, limit)
    assert features.descriptors is not None
    distances = signature_distances(features.descriptors, polarity)
    if rule == "paper":
        rows = select_markers(features, distances, polarity)
        plain = unrefined_detections(features, distances, polarity, rows)
        return Identification(features, distances, refine_detections(gray, plain, limit) if refine else plain)
    detections = find_markers(gray, features, distances, stretch, polarity, limit)
    if not refine:
        rows = np.array([detection.rank - 1 for detection in detections], dtype=np.intp)
        detections = unrefined_detections(features, distances, polarity, rows)
    return Identification(features, distances, detections)


def refine_detections(
    gray: NDArray[np.uint8], detections: tuple[Detection, ...], limit: Limit = "energy"
) -> tuple[Detection, ...]:
    """Return detections of one polarity with refined centre, size and affinity, where the pattern can be aligned."""
    check_choice(limit, get_args(Limit), "limit")
    if not detections:
        return ()
    sides = [SIDE_OF_SCALE * max(detection.size, 2.0) for detection in detections]
    fits = refine(gray, [d.xy for d in detections], sides, pattern_name(detections[0].polarity or "dark", limit))
    return tuple(
        replace(
            detection,
            xy=fits.xy[k],
            size=float(fits.side_px[k]),
            affinity=fits.affine[k],
            explained=float(fits.explained[k]),
        )
        if fits.converged[k]
        else detection
        for k, detection in enumerate(detections)
    )
