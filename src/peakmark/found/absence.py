"""Why nothing was found in an image: another kind was printed, too little contrast, too small, or not likely enough."""

from collections.abc import Sequence
from itertools import product
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import check_choice
from peakmark.identification.api import checked_detectors, identify, usual_limit
from peakmark.identification.families import SOURCES
from peakmark.identification.general import align_image
from peakmark.identification.marker_model import shipped_model
from peakmark.keypoints.image import as_gray
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant

SMALLEST_PX = 12
"""Side of the smallest markers that the general search finds, px."""

LEAST_CONTRAST = 20
"""Grey levels between the darkest and the lightest pixel of an image, below which no print shows."""


def why_nothing(
    image: ArrayLike, detector: str | Sequence[str] = "surf", limit: Limit | Literal["both"] | None = None
) -> str:
    """Return one sentence on an image in which `find` or `identify`, called alike, find nothing.

    It says what was looked for, and what spoke against it: another kind of marker is there, the contrast is too low,
    the image too small, nothing resembles a marker, or the likeliest candidate is not likely enough. It takes a few
    times as long as the search, since the other kinds are looked for, too.

    Parameters
    ----------
    image
        Grey or RGB, (H, W) or (H, W, 3); see `peakmark.keypoints.image.as_gray`.
    detector, limit
        As they were given to `find`; of several the first is spoken of.

    Raises
    ------
    InputError
        If the detector or the limit is unknown, or the image is none.
    """
    gray = as_gray(image)
    check_choice(limit or "energy", (*get_args(Limit), "both"), "limit")
    names = checked_detectors(detector, "general", limit)
    made_for = SOURCES[names[0]][0]
    limits: tuple[Limit, ...] = get_args(Limit) if limit == "both" else (limit or usual_limit(names),)
    binary = "binary " if limits == ("range",) else ""
    sought = f"looked for dark and light {binary}{made_for.upper()} markers of at least {SMALLEST_PX} px a side"
    if min(gray.shape) < SMALLEST_PX:
        return f"{sought}; the image has {gray.shape[1]}×{gray.shape[0]} px"
    contrast = int(gray.max()) - int(gray.min())
    if contrast < LEAST_CONTRAST:
        return f"{sought}; too little contrast: the darkest and the lightest pixel are {contrast} grey levels apart"
    return f"{sought}; {_another_kind(gray, names, limits) or _likeliest(gray, made_for, limits)}"


def _another_kind(gray: NDArray[np.uint8], names: tuple[str, ...], limits: tuple[Limit, ...]) -> str:
    """Return how to ask for the kind, of those not looked for, that explains something best; "" if none is there."""
    looked_for = set(product((SOURCES[name][0] for name in names), limits))
    others = [each for each in product(get_args(Made), get_args(Limit)) if each not in looked_for]
    found = [identify(gray, detector=made_for, limit=limit) for made_for, limit in others]
    named = [(one, kind) for of_kind, kind in zip(found, others, strict=True) for one in of_kind]
    if not named:
        return ""
    one, (made_for, limit) = max(named, key=lambda each: each[0].explained or 0)
    (x, y), side = one.xy, one.size
    return (
        f"another kind seems to be there: {one.kind}, {side:.0f} px at ({x:.0f}, {y:.0f}), probability "
        f"{one.probability:.2f}: ask for detector {made_for}, limit {limit}"
    )


def _likeliest(gray: NDArray[np.uint8], made_for: Made, limits: tuple[Limit, ...]) -> str:
    variants = [Variant(polarity, limit, made_for) for polarity in get_args(Polarity) for limit in limits]
    found = align_image(gray, variants)
    if not len(found.candidates):
        return "nothing resembles one: is it in the image, in focus, and not covered?"
    model, threshold = shipped_model(made_for, limits[0])
    likely = model.probabilities(found.evidence)
    best = int(np.argmax(likely))
    (x, y), side = found.candidates.xy[best], found.candidates.sides_px[best]
    return (
        f"the likeliest of {len(likely)} candidates, {found.variants[best].polarity}, {side:.0f} px at "
        f"({x:.0f}, {y:.0f}), has a probability of {likely[best]:.2f} of the {threshold:.2f} needed: "
        "print larger, come nearer, or check focus and light"
    )
