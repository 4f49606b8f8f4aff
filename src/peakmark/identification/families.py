"""The kinds of markers that `identify(image)` knows, in one table: where they may be, what is aligned, what decides.

A new pattern is a row here, its levels in `alignment.lit_pattern`, and a model that `scripts/train_search.py` makes.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import Aligned
from peakmark.identification.candidates import MarkerCandidates, candidate_pages
from peakmark.identification.marker_evidence import COLUMNS, COVER_COLUMNS, Column, cover_columns
from peakmark.identification.sift_candidates import sift_candidate_pages, sift_worth, vlfeat_candidate_pages
from peakmark.identification.sift_signature import SIFT_COLUMNS, sift_columns
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made, Variant

Gray = NDArray[np.uint8]
Pages = Callable[[Gray], Iterator[MarkerCandidates]]


@dataclass(frozen=True)
class Family:
    """How the markers that are made for one detector are searched."""

    pages: Pages
    """Where they may be."""
    model: str
    """File of what decides, in this package."""
    columns: tuple[str, ...]
    """Of the evidence."""
    more_evidence: Callable[[Gray, Aligned, tuple[Variant, ...]], Mapping[str, Column]]
    """Columns beyond those of `marker_evidence`."""
    least_correlation: float
    """Coarse correlation from which a candidate is aligned."""
    more_worth: Callable[[MarkerCandidates], Column]
    """What a candidate's order is by, besides correlation and quotient."""
    behind: Mapping[Limit, float]
    """Coarse correlation by which a pattern may fall short of another one of its polarity and still be aligned."""


def _by_size(candidates: MarkerCandidates) -> Column:
    """Return 0.02 for each doubling of the side."""
    return np.asarray(0.02 * np.log2(np.maximum(candidates.sides_px, 8) / 20))


def _by_answer(candidates: MarkerCandidates) -> Column:
    """Return what response and quotient of a DoG are worth."""
    return sift_worth(candidates.responses, candidates.quotients)


DISC_SIDE_OF_SURF = 2.4
"""Side of a DoG marker of a disc's scale, as SIFT's candidates have it, over that which SURF tells of the disc: √2 over
0.59, measured on drawn discs (`tests/peakmark/identification/test_sift.py`)."""

SMALLEST_SURF_OF_DISC_PX = 6.0
"""Side that SURF tells of the smallest disc: that of a marker of 14 px, as small as SIFT's are found."""

FAMILIES: Mapping[Made, Family] = {
    # of markers that nothing covers the correlation is above 0.86, of those covered by a third above 0.8; in any light
    # the binary pattern's, the simpler one, is up to 0.08 above that of the other, where the other is printed, under
    # motion up to 0.1
    "surf": Family(
        candidate_pages,
        "general.json",
        (*COLUMNS, *COVER_COLUMNS),
        lambda gray, aligned, variants: cover_columns(aligned),
        0.79,
        _by_size,
        {"energy": 0.1, "range": 0.01},
    ),
    "sift": Family(
        sift_candidate_pages,
        "sift.json",
        (*COLUMNS, *SIFT_COLUMNS),
        sift_columns,
        0.8,
        _by_answer,
        {"energy": 0.1, "range": 0.04},
    ),
}
"""Of the detectors that markers are made for."""


def surf_disc_pages(gray: Gray) -> Iterator[MarkerCandidates]:
    """Yield SURF's candidates as those of discs: its filter is widest where a disc is 0.27 of it from side to side."""
    for page in candidate_pages(gray, SMALLEST_SURF_OF_DISC_PX):
        yield replace(page, sides_px=page.sides_px * DISC_SIDE_OF_SURF)


SOURCES: Mapping[str, tuple[Made, Pages]] = {
    **{made_for: (made_for, family.pages) for made_for, family in FAMILIES.items()},
    "vlfeat": ("sift", vlfeat_candidate_pages),
    "surf-disc": ("sift", surf_disc_pages),
}
"""Of each detector that `identify` takes the markers that it finds, and where it says that they may be."""
