"""Image → markers: `identify`, in any image (`general`), on a floor (`search`), or by the paper's rule (`paper`)."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
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
from peakmark.identification.families import SOURCES
from peakmark.identification.general import detect_markers
from peakmark.identification.paper import select_markers
from peakmark.identification.search import PAD_SHARE, detect_to_the_border, find_markers, inside
from peakmark.identification.sift_features import LOW_CONTRAST, detect_sift, identify_sift_features
from peakmark.identification.signature import signature_distances
from peakmark.identification.stretch import Stretch, stretched, unstretched
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant
from peakmark.refine.api import refine

Rule = Literal["general", "joint", "paper"]
Narrower = Literal["joint", "paper"]
"""Rules that search one polarity in one stretch."""

LOW_THRESHOLD = 100.0
"""Hessian threshold that keeps tens of thousands of features of a floor image ("very low", Section 4.2)."""

STRONGEST = 300
"""Features that `identify` describes; an image with more markers in view needs more."""


def identify(
    image: ArrayLike,
    stretch: Stretch | None = None,
    polarity: Polarity | Literal["both"] | None = None,
    threshold: float | None = None,
    rule: Rule | None = None,
    limit: Limit | Literal["both"] | None = None,
    refine: bool | None = None,
    detector: str | Sequence[str] = "surf",
    focal_px: float | None = None,
) -> tuple[Detection, ...]:
    """Return the markers in an image, strongest first; none is an empty tuple.

    `identify(image)` finds dark and light markers of any size, rotation and tilt, in any light, in anybody's image
    (`identification.general`). What is said of the floor or of the rule narrows the search.

    Parameters
    ----------
    image
        Grey or RGB; see `peakmark.keypoints.image.as_gray`.
    rule
        "general" searches everywhere, see above. "joint" weighs response and signature of each feature of one polarity
        in one stretch, and aligns the printed pattern: for floors, any number of markers, also none. "paper" ranks by
        response and cuts at the largest drop (Section 4.2). Unless given, "general", and "joint" where anything but
        polarity and limit is given.
    polarity
        Which markers to look for; "both" unless given, and "dark" by the narrower rules, which look for one. With the
        rule "paper", "both" is the identification of the paper's CAVE: response and version-independent signature, then
        the sign of the Laplacian.
    stretch
        Vertical stretch before detection: about 1 / cos(tilt) of the surface that carries the markers; unless given 2,
        the paper's on the floor, and 1 for both polarities, as on walls. `identification.stretch.floor_stretch` gives
        each row its own where the camera's pitch is known.
    threshold
        Hessian threshold of the detector; 100 unless given.
    limit
        Which marker was printed: "energy" (the paper's) unless given, or "range", the binary one, or "both" with the
        general rule. A dark binary marker is all but a disc: looking for it costs false detections.
    refine
        Align the printed pattern with the image (`peakmark.refine`): centres to hundredths of a pixel, and the
        affinity. True unless given; False leaves positions and sizes as SURF tells them.
    detector
        For whose markers to look: "surf", "sift", "vlfeat", VLFeat's SIFT (needs pycolmap), or several of them, such as
        ("surf", "sift"). `Detection.kind` says which marker was found; with the rule "paper" one of "surf" and "sift",
        with "joint" SURF's alone. SIFT's markers are round: their affinity is that without a rotation, and with limit
        "range" they are discs. A disc is a marker for both: "surf-disc" looks for discs where SURF answers, and calls
        them what "sift" does.
    focal_px
        Focal length, px, of an image without distortion: how strong perspective can be, and where the centres of discs
        may be seen (`Detection.aside`), by the general rule. About the image's longer side unless given.

    Raises
    ------
    InputError
        If the stretch is not in 0.25…8, polarity, rule, limit or detector is unknown, both polarities are asked for
        with the rule "joint" or both limits, another detector or a focal length with a narrower rule, a stretch,
        threshold or refinement with the general one, the focal length is not above 0, pycolmap is missing, or the image
        is not one that `surf.detect` takes.
    """
    narrowing = {"stretch": stretch, "threshold": threshold, "refine": refine}
    given = [name for name, value in narrowing.items() if value is not None]
    rule = rule or ("joint" if given else "general")
    polarity = polarity or ("both" if rule == "general" else "dark")
    _check_choices(rule, polarity, limit or "energy", given)
    detectors = checked_detectors(detector, rule, limit)
    _check_focal(focal_px, rule)
    gray = as_gray(image)
    if rule == "general":
        polarities: tuple[Polarity, ...] = get_args(Polarity) if polarity == "both" else (polarity,)
        limits: tuple[Limit, ...] = get_args(Limit) if limit == "both" else (limit or usual_limit(detectors),)
        made_for = dict.fromkeys(SOURCES[name][0] for name in detectors)
        variants = [Variant(*each) for each in product(polarities, limits, made_for)]
        return detect_markers(gray, variants, detectors, focal_px)
    assert limit != "both"
    default = 1.0 if polarity == "both" else 2.0
    stretch = default if stretch is None else stretch
    is_refined = refine is None or refine
    if detectors == ("sift",):
        features = detect_sift(gray, stretch, LOW_CONTRAST if threshold is None else threshold)
        found = identify_sift_features(features, polarity, limit or "energy").detections
        return refine_detections(gray, found, limit or "energy") if is_refined else found
    strongest = None if rule == "paper" else STRONGEST
    features = detect_stretched(gray, stretch, LOW_THRESHOLD if threshold is None else threshold, strongest)
    return identify_features(gray, features, polarity, rule, stretch, limit or "energy", is_refined).detections


def _check_choices(rule: str, polarity: str, limit: str, given: Sequence[str]) -> None:
    check_choice(rule, get_args(Rule), "rule")
    check_choice(polarity, (*get_args(Polarity), "both"), "polarity")
    check_choice(limit, (*get_args(Limit), "both"), "limit")
    if rule == "general" and given:
        raise InputError(f'{given[0]}: expected none with rule "general", which searches everywhere')
    if rule == "joint" and polarity == "both":
        raise InputError('polarity: expected dark or light with rule "joint", got "both"')
    if rule != "general" and limit == "both":
        raise InputError(f'limit: expected energy or range with rule "{rule}", got "both"')


def _check_focal(focal_px: float | None, rule: str) -> None:
    if focal_px is not None and not 0 < focal_px < np.inf:
        raise InputError(f"focal_px: expected a positive number, got {focal_px}")
    if focal_px is not None and rule != "general":
        raise InputError(f'focal_px: expected none with rule "{rule}", got {focal_px:g}')


def checked_detectors(detector: str | Sequence[str], rule: Rule, limit: str | None) -> tuple[str, ...]:
    """Return the detectors' names, each once."""
    names = (detector,) if isinstance(detector, str) else tuple(dict.fromkeys(detector))
    if not names:
        raise InputError(f"detector: expected some of {', '.join(SOURCES)}, got none")
    for name in names:
        check_choice(name, tuple(SOURCES), "detector")
    if "surf-disc" in names and limit == "energy":
        raise InputError('limit: expected range or both with the detector surf-disc, got "energy"')
    taken = {"joint": ("surf",), "paper": ("surf", "sift")}.get(rule)
    if taken and (len(names) > 1 or names[0] not in taken):
        raise InputError(f'detector: expected {" or ".join(taken)} with rule "{rule}", got {", ".join(names)}')
    return names


def usual_limit(detectors: tuple[str, ...]) -> Limit:
    """Return which limit is looked for unless one is given: discs are binary."""
    return "range" if detectors == ("surf-disc",) else "energy"


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
    polarity: Polarity | Literal["both"] = "dark",
    rule: Narrower = "joint",
    stretch: Stretch = 2.0,
    limit: Limit = "energy",
    refine: bool = True,
) -> Identification:
    """Return which of an image's features, strongest first and with descriptors, are markers; see `identify`."""
    check_choice(rule, get_args(Narrower), "rule")
    _check_choices(rule, polarity, limit, ())
    assert features.descriptors is not None
    one = None if polarity == "both" else polarity
    distances = signature_distances(features.descriptors, one)
    if rule == "paper":
        rows = select_markers(features, distances, one)
        detections = unrefined_detections(features, distances, one, rows)
        detections = refine_detections(gray, detections, limit) if refine else detections
    else:
        assert one is not None
        detections = find_markers(gray, features, distances, stretch, one, limit)
        if not refine:
            rows = np.array([detection.rank - 1 for detection in detections], dtype=np.intp)
            detections = unrefined_detections(features, distances, one, rows)
    return Identification(features, distances, tuple(replace(found, limit=limit) for found in detections))


def refine_detections(
    gray: NDArray[np.uint8], detections: tuple[Detection, ...], limit: Limit = "energy"
) -> tuple[Detection, ...]:
    """Return detections with refined centre, size and affinity, where the pattern can be aligned."""
    check_choice(limit, get_args(Limit), "limit")
    refined: dict[int, Detection] = {}
    for polarity in get_args(Polarity):
        for made_for in get_args(Made):
            wanted = (polarity, made_for)
            own = [k for k, d in enumerate(detections) if (d.polarity or "dark", d.made_for) == wanted]
            aligned = _refined(gray, [detections[k] for k in own], pattern_name(polarity, limit, made_for))
            refined.update(zip(own, aligned, strict=True))
    return tuple(refined[k] for k in range(len(detections)))


def _refined(gray: NDArray[np.uint8], detections: Sequence[Detection], pattern: str) -> tuple[Detection, ...]:
    if not detections:
        return ()
    sides = [SIDE_OF_SCALE * max(detection.size, 2.0) for detection in detections]
    fits = refine(gray, [d.xy for d in detections], sides, pattern)
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
