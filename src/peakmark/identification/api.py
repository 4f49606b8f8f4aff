"""Key points → markers: `identify`, by the paper's rule or by the joint one (`identification_joint`, the default)."""

from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark import surf
from peakmark.errors import InputError
from peakmark.identification.both import identify_both
from peakmark.identification.detection import SIDE_OF_SCALE, Detection, Identification, as_detections, pattern_name
from peakmark.identification.joint import find_markers
from peakmark.identification.paper import select
from peakmark.identification.signature import signature_distances
from peakmark.identification.stretch import Stretch, stretched, unstretched
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.refine.api import refine

Rule = Literal["joint", "paper"]

LOW_THRESHOLD = 100.0
"""Hessian threshold that keeps tens of thousands of features of a floor picture ("very low", Section 4.2)."""

STRONGEST = 300
"""Features that `identify` describes; a picture with more markers in view needs more."""


_PAD_SHARE = 0.05
"""Rim that is added on every side before detection, as a share of the width, by repeating the outermost pixels: SURF
needs more room around a marker than the marker itself covers."""


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
        wants them; see `identification_both`, which neither stretches nor uses the threshold.
    threshold
        Hessian threshold of the detector.
    rule
        "joint" weighs response, signature and scale of each feature, and aligns the printed pattern: for any number of
        markers, also none. "paper" ranks by response and cuts at the largest drop (Section 4.2).
    limit
        Which marker was printed: "energy" (the paper's) or "range".
    refine
        Align the printed pattern with the picture (`peakmark.refine`): centres to hundredths of a pixel, and the
        affinity. False leaves places and sizes as SURF tells them.

    Raises
    ------
    InputError
        If the stretch is not in 0.25…8, polarity or rule is unknown, both polarities are asked for with another rule
        or limit than the default, or the image is not one that `surf.detect` takes.
    """
    if polarity not in ("dark", "light", "both"):
        raise InputError(f"polarity: expected dark, light or both, got {polarity!r}")
    gray = as_gray(image)
    if polarity == "both":
        if (rule, limit) != ("joint", "energy"):
            raise InputError('rule, limit: expected "joint" and "energy" for both polarities')
        return identify_both(gray).detections
    features = stretched_features(gray, stretch, threshold, None if rule == "paper" else STRONGEST)
    return examine(gray, features, polarity, rule, stretch, limit, refine).detections


def stretched_features(
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
    pad = round(_PAD_SHARE * width)
    padded = np.pad(stretched(gray, stretch), pad, mode="edge")
    features = surf.detect_and_describe(padded, threshold=threshold, strongest=strongest, **parameters)
    features = unstretched(features.with_columns(xy=features.xy - np.float32(pad)), stretch, height)
    inside = (features.xy > -0.5) & (features.xy < np.array([width, height]) - 0.5)
    return features[inside.all(axis=1)]


def examine(
    gray: NDArray[np.uint8],
    features: Keypoints,
    polarity: Polarity = "dark",
    rule: Rule = "joint",
    stretch: Stretch = 2.0,
    limit: Limit = "energy",
    refine: bool = True,
) -> Identification:
    """Return which of an image's features, strongest first and with descriptors, are markers; see `identify`."""
    if rule not in get_args(Rule):
        raise InputError(f"rule: expected one of {', '.join(get_args(Rule))}, got {rule!r}")
    assert features.descriptors is not None
    distances = signature_distances(features.descriptors, polarity)
    if rule == "paper":
        rows = select(features, distances, polarity)
        detections = tuple(as_detections(features, distances, polarity, rows))
        return Identification(features, distances, refined(gray, detections, limit) if refine else detections)

    detections = find_markers(gray, features, distances, stretch, polarity, limit)
    if not refine:
        rows = np.array([detection.rank - 1 for detection in detections], dtype=np.intp)
        detections = tuple(as_detections(features, distances, polarity, rows))
    return Identification(features, distances, detections)


def refined(
    gray: NDArray[np.uint8], detections: tuple[Detection, ...], limit: Limit = "energy"
) -> tuple[Detection, ...]:
    """Return detections of one polarity with refined centre, size and affinity, where the pattern can be aligned."""
    if not detections:
        return ()
    sides = [SIDE_OF_SCALE * max(detection.size, 2.0) for detection in detections]
    fits = refine(gray, [d.xy for d in detections], sides, pattern_name(detections[0].polarity, limit))
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
