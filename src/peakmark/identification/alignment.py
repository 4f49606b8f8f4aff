"""Candidates aligned with a marker's pattern in any light, and what that explains: as a whole, in parts, in cells."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.identification.correlation import correlate_candidates
from peakmark.identification.detection import FitSpread
from peakmark.identification.stages import STAGE_COLUMNS, STAGES, stage_columns
from peakmark.markers.patterns import Made, Variant, surf_cells
from peakmark.markers.profile import MOST_RADII, RADII, sift_profile
from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.refine.align import shape_grid
from peakmark.refine.api import DITHER, FLOOR_PX
from peakmark.refine.lit import (
    PARAMETERS,
    PART,
    PARTS,
    RAMP,
    RATIO,
    SHARP,
    SOFT,
    STEP,
    WAS,
    align_each,
    finish_in_light,
)
from peakmark.refine.model import Pattern, predict
from peakmark.refine.round import ROUND_EXTENT, ROUND_SPAN, round_shape_grid, round_template

HOPELESS: Mapping[Made, float] = {"surf": 0.05, "sift": 0.02}
"""Noise over gain² of the softened image, beyond its own, above which an alignment is given up: of markers
that nothing covers it is below 0.01. Round ones are not looked at again in parts. Set by hand;
`scripts/compare_kinds.py` and `scripts/evaluate_search.py` tell what it loses."""

RIM = 0.55
"""Half the side, in sides, of what the last fit takes in: paper is white for half a cell around the pattern."""

MOST_EXPECTED = 0.95
"""Of what is known of a marker's perspective, the share that may have been expected beforehand."""

_NOISE_BLOCKS = 8000
"""Blocks of 16 × 16 pixels of which an image's noise is told, at least: all those of 2 megapixels. Set by hand."""

CELLS = 11
"""Along each side: the pattern's nine, and one beyond on either side."""

_KNOTS: NDArray[np.float64] = np.arange(9) * np.float64(0.08)
"""Radii, sides, of the tents that stand for everything radial."""

_SHIFTS = np.array([(a, b) for a in (-0.07, 0.0, 0.07) for b in (-0.07, 0.0, 0.07) if (a, b) != (0.0, 0.0)])
_TEMPLATE_PX, _TEMPLATE_BLUR, _TEMPLATE_TONE = 1000.0, 0.05, 1.4
"""The coarse template: resolution that makes the pixel's box vanish, blur in sides, and a tone exponent in between."""

IsWorth = Callable[[int, NDArray[np.intp], NDArray[np.float64]], NDArray[np.bool_]]
"""Whether candidates are worth another stage: from the one that is done, their rows (k,), and what the stages so far
said, (k, stages, c)."""

_measure_alignment = function(
    "status measure_alignment(const u1[height,width] gray, const f8[18] theta, const f8[2] center, f8 size, "
    "const f8[line_count] lines, const i8[rows,intervals] index, const f8[base_count] base, f8 extent, "
    "const f8[knot_count] knots, f8 cut, f8[8] figures, f8[121] sums, f8[121] counts, f8[121] all)"
)

_measure_each = function(
    "status measure_each(const u1[height,width] gray, const f8[n,2] xy, const f8[n] sides, const f8[line_count] lines, "
    "const i8[rows,intervals] index, const f8[base_count] base, f8 extent, const f8[knot_count] knots, "
    "const f8[n,18] theta, const f8[n,6] fits, f8[n,8] figures, f8[n,121] sums, f8[n,121] counts, f8[n,121] all)"
)
_block_medians = function("void block_medians(const u1[height,width] gray, i8 step, f8[down,across] medians)")


@dataclass(frozen=True)
class Aligned:
    """Candidates aligned with the pattern."""

    rows: NDArray[np.intp]
    """(n,) of the candidates."""
    centers: NDArray[np.float64]
    """(n, 2) px, where the candidates were: anchors of the planes of light."""
    sizes_px: NDArray[np.float64]
    """(n,) the sides that they had."""
    theta: NDArray[np.float64]
    """(n, 18) parameters, see `refine.lit`."""
    noise: NDArray[np.float64]
    """(n,) mean square of the residuals."""
    steps: NDArray[np.float64]
    """(n,) see `refine.lit.STEP`."""
    ratios: NDArray[np.float64]
    """(n,) see `refine.lit.RATIO`."""
    cuts: NDArray[np.float64]
    """(n,) see `refine.lit.CUT`."""
    figures: NDArray[np.float64]
    """(n, 8) see `measure_alignment`."""
    sums: NDArray[np.float64]
    """(n, 11, 11) of residuals over gain in cells, the outermost beyond the pattern."""
    counts: NDArray[np.float64]
    """(n, 11, 11) pixels of each cell that are compared."""
    pixels: NDArray[np.float64]
    """(n, 11, 11) pixels in each cell."""
    said: NDArray[np.float64]
    """(n, stages, c) what each stage said, see `stages`; nan of the parts where there was no second look."""

    @property
    def sides_px(self) -> NDArray[np.float64]:
        """(n,) square roots of the areas."""
        return np.sqrt(np.abs(self.theta[:, 2] * self.theta[:, 5] - self.theta[:, 3] * self.theta[:, 4]))

    def __getitem__(self, rows: NDArray[np.intp]) -> "Aligned":
        return Aligned(*(getattr(self, field.name)[rows] for field in fields(self)))


def together(parts: Sequence[Aligned]) -> Aligned:
    """Return alignments of several calls as one; their rows are as they were."""
    return Aligned(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Aligned)))


def span_of(variant: Variant) -> float:
    """Return the side of what is aligned over the side of the marker."""
    return 1.0 if variant.made_for == "surf" else ROUND_SPAN


def extent_of(variant: Variant) -> float:
    """Return up to where an image is compared, in units from the centre."""
    return 0.5 if variant.made_for == "surf" else ROUND_EXTENT


def start_of(variant: Variant) -> float:
    """Return the side from which an alignment starts, over the candidate's: a disc's key point is √2 larger."""
    return span_of(variant) / (sqrt(2) if variant.made_for == "sift" and variant.limit == "range" else 1.0)


@cache
def lit_pattern(
    variant: Variant, radii_count: int = RADII
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return a marker's lines (k,), the index (k + 1, k + 1) of each cell's level, and the levels, rising.

    Of a round one the lines are the radii at which it has the levels, and the index is (1, k); a DoG has so many.
    """
    if variant.made_for == "sift":
        radii, levels = sift_profile(variant.polarity, variant.limit, radii_count)
        return radii / ROUND_SPAN, np.arange(len(levels))[None], levels
    framed = np.pad(surf_cells(variant.polarity, variant.limit), 1, constant_values=255)
    starts = np.flatnonzero(np.r_[True, (framed[1:] != framed[:-1]).any(axis=1)])
    cells = framed[np.ix_(starts, starts)]
    levels = np.unique(cells)
    return (starts[1:] - 1) / 9 - 0.5, np.searchsorted(levels, cells).astype(np.int64), levels / 255.0


@cache
def lit_template(variant: Variant) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (m, 2) over the pattern and its softened levels there, of mean 0 and length 1."""
    if variant.made_for == "sift":
        radii, _, shown = lit_pattern(variant)
        samples, values = round_template(radii, shown**_TEMPLATE_TONE)
        return samples, values / np.linalg.norm(values)
    line = (np.arange(9) - 4) / 9 * 0.95
    samples = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    values = template_levels(variant, samples)
    values = values - values.mean()
    return samples, values / np.linalg.norm(values)


def template_levels(variant: Variant, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the softened levels (m,), 0…1, of a square marker at points (m, 2), sides from its centre."""
    unit = np.zeros(11)
    unit[[2, 5]], unit[8], unit[10] = _TEMPLATE_PX, 1.0, (_TEMPLATE_BLUR * _TEMPLATE_PX) ** 2
    lines, index, levels = lit_pattern(variant)
    return predict(unit, points * _TEMPLATE_PX, Pattern(lines, levels[index] ** _TEMPLATE_TONE, 0.5))


def shapes_of(variant: Variant) -> NDArray[np.float64]:
    """Return the shapes (k, 2, 2) that a coarse search tries."""
    return shape_grid() if variant.made_for == "surf" else round_shape_grid()


def correlations(
    gray: NDArray[np.uint8], xy: NDArray[np.float64], sides_px: NDArray[np.float64], variant: Variant
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n,) how well the image correlates with the pattern at candidates, in the best of all shapes.

    And the posture (n, 6) in which it does, see `correlate_candidates`.
    """
    samples, template = lit_template(variant)
    chunks = np.array_split(np.arange(len(xy)), max(1, min(8, len(xy))))
    parts = map_parallel(
        lambda rows: correlate_candidates(
            gray, xy[rows], sides_px[rows], samples, template, shapes_of(variant), _SHIFTS
        ),
        chunks,
    )
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def align_candidates(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float64],
    sides_px: NDArray[np.float64],
    variant: Variant,
    sigma: float,
    is_worth: IsWorth | None = None,
) -> Aligned:
    """Align candidates with one of the markers in an image of noise σ; those that are none are left out.

    And those that are not worth another stage, if that is asked.
    """
    lines, index, base = lit_pattern(variant)
    samples, template = lit_template(variant)
    extent = extent_of(variant)
    focal, shapes, hopeless = float(max(gray.shape)), shapes_of(variant), HOPELESS[variant.made_for]
    theta, fits = np.empty((len(xy), PARAMETERS)), np.empty((len(xy), WAS + 1))
    said = np.full((len(xy), len(STAGES), len(STAGE_COLUMNS)), np.nan)

    def take_on(stage: int, rows: NDArray[np.intp]) -> None:
        def take(cut: tuple[int, int]) -> None:
            own = rows[slice(*cut)]
            found, fit = theta[own], fits[own]
            places, limits = (xy[own], sides_px[own]), (sigma, hopeless)
            search = (samples, template, shapes)
            align_each(gray, *places, lines, index, base, extent, focal, *search, *limits, stage, found, fit)
            theta[own], fits[own] = found, fit

        map_parallel(take, _shares(len(rows)))

    def worth(stage: int, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        said[rows, stage] = stage_columns(xy[rows], sides_px[rows], sigma, theta[rows], fits[rows])
        return np.ones(len(rows), np.bool_) if is_worth is None else is_worth(stage, rows, said[rows, : stage + 1])

    rows = np.arange(len(xy))
    take_on(SOFT, rows)
    rows = rows[worth(SOFT, rows)]
    take_on(SHARP, rows[np.isfinite(fits[rows, STEP])])
    rows = rows[worth(SHARP, rows)]
    if variant.made_for == "surf":
        whole = theta.copy(), fits.copy()
        take_on(PARTS, rows)
        parts = rows[np.isfinite(fits[rows, STEP])]
        is_kept = worth(PARTS, parts)
        take_on(PART, parts[is_kept])
        rows = np.setdiff1d(rows, parts[~is_kept])
        in_vain = ~np.isfinite(fits[:, STEP])
        theta[in_vain], fits[in_vain] = whole[0][in_vain], whole[1][in_vain]
        fits[:, RATIO] = whole[1][:, RATIO]
    return _measured(gray, rows, xy, sides_px, (lines, index, base, extent), theta, fits, said)


def _shares(count: int) -> list[tuple[int, int]]:
    """Return the parts in which so many candidates are worked at."""
    return bands(count, 1 if thread_count() == 1 else count)


def _measured(
    gray: NDArray[np.uint8],
    rows: NDArray[np.intp],
    xy: NDArray[np.float64],
    sides_px: NDArray[np.float64],
    pattern: tuple[Any, ...],
    theta: NDArray[np.float64],
    fits: NDArray[np.float64],
    said: NDArray[np.float64],
) -> Aligned:
    """Return what is aligned of some rows, measured."""
    xy, sides_px, theta, fits = xy[rows], sides_px[rows], theta[rows], fits[rows]
    figures, cells = np.empty((len(rows), 8)), np.empty((3, len(rows), CELLS**2))

    def measure(cut: tuple[int, int]) -> None:
        own = slice(*cut)
        columns = (figures[own], *cells[:, own])
        _measure_each(gray, xy[own], sides_px[own], *pattern, _KNOTS, theta[own], fits[own], *columns)

    map_parallel(measure, _shares(len(rows)))
    own = np.flatnonzero(figures[:, 0] > 0)
    noise, step, ratio, cut = fits[own, :RAMP].T
    sums, counts, pixels = cells[:, own].reshape(3, -1, CELLS, CELLS)
    fit, cells_of = (noise, step, ratio, cut, figures[own]), (sums, counts, pixels)
    return Aligned(rows[own], xy[own], sides_px[own], theta[own], *fit, *cells_of, said[rows[own]])


def finished(
    gray: NDArray[np.uint8], aligned: Aligned, row: int, variant: Variant, focal_px: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return an alignment's parameters (18,) after its last fit, with the pattern's rim, and how sure they are.

    That is the covariance (8, 8) of centre, affinity and perspective, to which rounding adds (0.003 px)² where there is
    no noise, and the precision with which no perspective was expected beforehand. The focal length is the image's
    longer side unless given.
    """
    center, side_px = aligned.centers[row], float(aligned.sizes_px[row])
    extent, focal = extent_of(variant), float(focal_px or max(gray.shape))
    rim = RIM if variant.made_for == "surf" else extent + 1e-6  # its last fit takes no rim, but perspective
    extra = (extent, rim, focal, float(aligned.cuts[row]))
    pattern = lit_pattern(variant, MOST_RADII)
    theta, covariance = finish_in_light(gray, aligned.theta[row], center, side_px, *pattern, *extra)
    is_rounded = aligned.noise[row] < DITHER**2
    rounding = is_rounded * FLOOR_PX**2 * np.diag([1.0] * 6 + [0.0] * 2)
    return theta, np.asarray(covariance[:8, :8] + rounding), (focal / side_px) ** 2


def spread_of(covariance: NDArray[np.float64], precision: float) -> FitSpread:
    """Return how far a fit is off whose (8, 8) covariance counts that no perspective was expected beforehand.

    Given the true perspective g, what was expected is no chance any more: it moves the fit by a fixed amount.
    """
    variances, axes = np.linalg.eigh(covariance[6:, 6:])
    share = np.minimum(precision * variances, MOST_EXPECTED)
    by_perspective = covariance[:, 6:] @ axes
    drawn = by_perspective * (share / variances) @ axes.T
    known = by_perspective * (share / variances) @ by_perspective.T
    return FitSpread(covariance - known, drawn)


def noise_sigma_of(gray: NDArray[np.uint8]) -> float:
    """Return the image's noise, grey levels: the lower third of blocks' medians of a second difference.

    Of a large image every second block is looked at along either side, or every third, ….

    Immerkær (1996, doi:10.1006/cviu.1996.0060), made robust against texture.
    """
    rows, columns = (max(length - 2, 0) // 16 for length in gray.shape)
    if rows == 0 or columns == 0:
        return 0.3
    step = max(1, int(np.sqrt(rows * columns / _NOISE_BLOCKS)))
    medians = np.empty((-(-rows // step), -(-columns // step)))
    _block_medians(gray, step, medians)
    return max(float(np.quantile(1.4826 / 6 * medians, 0.3)), 0.3)


def measure_alignment(
    gray: NDArray[np.uint8],
    theta: NDArray[np.float64],
    center: NDArray[np.float64],
    size: float,
    lines: NDArray[np.float64],
    index: NDArray[np.int64],
    base: NDArray[np.float64],
    extent: float,
    knots: NDArray[np.float64],
    cut: float,
) -> tuple[NDArray[np.float64], ...]:
    """Return (8,) figures of an alignment, all 0 with fewer than 24 pixels, and (121,) sums and pixels of its cells.

    Pixels; sums of squares after a plane, after a plane and everything radial (tents of 0.08 sides around the knots),
    and after the pattern; the correlation of what is not radial; the least correlation of eight halves and quadrants;
    that of what is not radial in a quadrant; and the share of pixels that were compared: those whose residual exceeds
    twice a `cut` above 0 are left out, for something covers them. A cell, a ninth of the side, has the sum of its
    residuals over gain; the outermost lie beyond the pattern. The pixels come twice: those that were compared, and all.
    """
    measured = (np.empty(8), *np.empty((3, CELLS**2)))
    _measure_alignment(gray, theta, center, size, lines, index, base, extent, knots, cut, *measured)
    return measured
