"""Why nothing was found in an image: too little contrast, too small, or nothing that is likely enough."""

from typing import get_args

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.general import align_image
from peakmark.identification.marker_model import shipped_model
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Polarity, Variant

SMALLEST_PX = 12
"""Side of the smallest markers that the general search finds, px."""

LEAST_CONTRAST = 20
"""Grey levels between the darkest and the lightest hundredth of an image, below which no print shows."""


def why_nothing(gray: NDArray[np.uint8], made_for: Made = "surf", limit: Limit = "energy") -> str:
    """Return one sentence: what was looked for in a (H, W) image, and what spoke against the likeliest candidate."""
    binary = "binary " if limit == "range" else ""
    sought = f"looked for dark and light {binary}{made_for.upper()} markers of at least {SMALLEST_PX} px a side"
    if min(gray.shape) < SMALLEST_PX:
        return f"{sought}; the image has {gray.shape[1]}×{gray.shape[0]} px"
    darkest, lightest = np.percentile(gray, (1, 99))
    if lightest - darkest < LEAST_CONTRAST:
        return f"{sought}; too little contrast: 98 % of the image lie within {lightest - darkest:.0f} grey levels"
    found = align_image(gray, [Variant(polarity, limit, made_for) for polarity in get_args(Polarity)])
    if not len(found.candidates):
        return f"{sought}; nothing resembles one: is it in the image, in focus, and not covered?"
    model, threshold = shipped_model(made_for, limit)
    likely = model.probabilities(found.evidence)
    best = int(np.argmax(likely))
    (x, y), side = found.candidates.xy[best], found.candidates.sides_px[best]
    return (
        f"{sought}; the likeliest of {len(likely)} candidates, {found.variants[best].polarity}, {side:.0f} px at "
        f"({x:.0f}, {y:.0f}), has a probability of {likely[best]:.2f} of the {threshold:.2f} needed: "
        "print larger, come nearer, or check focus and light"
    )
