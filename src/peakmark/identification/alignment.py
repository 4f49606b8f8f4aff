"""What an alignment in any light says for a marker and against it, as columns of evidence.

A blob can be explained by the pattern once enough blur is allowed. So the columns compare with what a plain blob could
do: everything radial around the centre, and a plane of light, is taken out of image and prediction before they are
compared, as a whole and in halves and quadrants; and white paper is looked for just outside the pattern.
"""

from dataclasses import dataclass
from functools import cache
from math import sqrt

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.markers.patterns import Polarity, surf_cells
from peakmark.parallel import map_parallel
from peakmark.refine.align import shape_grid
from peakmark.refine.lit import PARAMETERS, align_in_light, correlate_candidates
from peakmark.refine.model import Pattern, predict

COLUMNS = (
    "quotient",
    "unexplained",
    "blur",
    "blob",
    "non_radial",
    "worst_part",
    "worst_quadrant",
    "correlation",
    "tone",
    "ring",
    "ring_low",
    "michelson",
    "gain",
    "side",
    "anisotropy",
)
"""Evidence of an alignment: the response quotient; −log of the share that the pattern leaves unexplained, beyond the
image's noise; blur over side; log of what a blob leaves over what the pattern leaves; correlation of what is not
radial; −log(1 − least correlation) over eight halves and quadrants; least correlation of what is not radial in a
quadrant; coarse correlation; |ln γ − 0.35|; share of the ring around the pattern that is white, and its lower fifth;
Michelson contrast; log of the gain; log of the side; log of the anisotropy."""

HOPELESS = 1.0
"""Noise over gain² of the softened image above which an alignment is given up."""

_KNOTS: NDArray[np.float64] = np.arange(9) * np.float64(0.08)
"""Radii, sides, of the tents that stand for everything radial."""

_SHIFTS = np.array([(a, b) for a in (-0.07, 0.0, 0.07) for b in (-0.07, 0.0, 0.07) if (a, b) != (0.0, 0.0)])
_TEMPLATE_PX, _TEMPLATE_BLUR, _TEMPLATE_TONE = 1000.0, 0.05, 1.4
"""The coarse template: resolution that makes the pixel's box vanish, blur in sides, and a tone exponent in between."""

_measure_alignment = function(
    "status measure_alignment(const u1[height,width] gray, const f8[16] theta, const f8[2] center, f8 size, "
    "const f8[line_count] lines, const i8[intervals,intervals] index, const f8[base_count] base, f8 extent, "
    "const f8[knot_count] knots, f8[7] figures)"
)


@dataclass(frozen=True)
class Aligned:
    """Candidates aligned with the pattern."""

    theta: NDArray[np.float64]
    """(n, 16) parameters, see `refine.lit`."""
    noise: NDArray[np.float64]
    """(n,) mean square of the residuals."""
    evidence: NDArray[np.float64]
    """(n, len(COLUMNS))."""
    rows: NDArray[np.intp]
    """(n,) of the candidates."""

    @property
    def sides_px(self) -> NDArray[np.float64]:
        """(n,) square roots of the areas."""
        return np.sqrt(np.abs(self.theta[:, 2] * self.theta[:, 5] - self.theta[:, 3] * self.theta[:, 4]))


@cache
def lit_pattern(polarity: Polarity) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return a marker's lines (k,), the index (k + 1, k + 1) of each cell's level, and the levels, rising."""
    framed = np.pad(surf_cells(polarity), 1, constant_values=255)
    starts = np.flatnonzero(np.r_[True, (framed[1:] != framed[:-1]).any(axis=1)])
    cells = framed[np.ix_(starts, starts)]
    levels = np.unique(cells)
    return (starts[1:] - 1) / 9 - 0.5, np.searchsorted(levels, cells).astype(np.int64), levels / 255.0


@cache
def lit_template(polarity: Polarity) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (m, 2) over the pattern and its softened levels there, of mean 0 and length 1."""
    line = (np.arange(9) - 4) / 9 * 0.95
    samples = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    unit = np.zeros(11)
    unit[[2, 5]], unit[8], unit[10] = _TEMPLATE_PX, 1.0, (_TEMPLATE_BLUR * _TEMPLATE_PX) ** 2
    lines, index, levels = lit_pattern(polarity)
    values = predict(unit, samples * _TEMPLATE_PX, Pattern(lines, levels[index] ** _TEMPLATE_TONE, 0.5))
    values = values - values.mean()
    return samples, values / np.linalg.norm(values)


def correlations(
    gray: NDArray[np.uint8], xy: NDArray[np.float64], sides_px: NDArray[np.float64], polarity: Polarity
) -> NDArray[np.float64]:
    """Return (n,) how well the image correlates with the pattern at candidates, in the best of all shapes."""
    samples, template = lit_template(polarity)
    chunks = np.array_split(np.arange(len(xy)), max(1, min(8, len(xy))))
    parts = map_parallel(
        lambda rows: correlate_candidates(gray, xy[rows], sides_px[rows], samples, template, shape_grid(), _SHIFTS),
        chunks,
    )
    return np.concatenate([np.empty(0), *parts])


def align_candidates(
    gray: NDArray[np.uint8],
    xy: NDArray[np.float64],
    sides_px: NDArray[np.float64],
    polarity: Polarity,
    quotients: NDArray[np.float64],
    correlation: NDArray[np.float64],
    noise_sigma: float,
) -> Aligned:
    """Align candidates with a marker of one polarity; those that are none are left out."""
    pattern, template, focal = lit_pattern(polarity), lit_template(polarity), float(max(gray.shape))

    def align(k: int) -> tuple[NDArray[np.float64], float, NDArray[np.float64]] | None:
        theta, noise, converged, _ = align_in_light(
            gray, xy[k], float(sides_px[k]), *pattern, 0.5, focal, *template, shape_grid(), HOPELESS
        )
        if not converged or not _is_near(theta, xy[k], float(sides_px[k])):
            return None
        measures = measure_alignment(gray, theta, xy[k], float(sides_px[k]), *pattern, 0.5, _KNOTS)
        if measures[0] == 0:
            return None
        row = evidence_of(gray, theta, measures, xy[k], float(sides_px[k]), noise_sigma)
        return theta, noise, np.array([quotients[k], *row[:6], correlation[k], *row[6:]])

    found = map_parallel(align, range(len(xy)))
    rows = np.array([k for k, one in enumerate(found) if one is not None], dtype=np.intp)
    kept = [one for one in found if one is not None]
    return Aligned(
        np.array([one[0] for one in kept]).reshape(-1, PARAMETERS),
        np.array([one[1] for one in kept]),
        np.array([one[2] for one in kept]).reshape(-1, len(COLUMNS)),
        rows,
    )


def _is_near(theta: NDArray[np.float64], xy: NDArray[np.float64], side_px: float) -> bool:
    """Return whether a fit is finite, at least 8 px a side, and not far from where it began."""
    if not np.isfinite(theta).all():
        return False
    side = sqrt(abs(theta[2] * theta[5] - theta[3] * theta[4]))
    moved = float(np.hypot(*(theta[:2] - xy)))
    return side >= 8 and moved <= 0.35 * side and 0.5 < side / side_px < 2


def evidence_of(
    gray: NDArray[np.uint8],
    theta: NDArray[np.float64],
    measures: NDArray[np.float64],
    xy: NDArray[np.float64],
    side_px: float,
    noise_sigma: float,
) -> NDArray[np.float64]:
    """Return the columns of an alignment but for quotient and correlation."""
    n, total, by_blob, left, non_radial, part, quadrant = measures
    side = sqrt(abs(theta[2] * theta[5] - theta[3] * theta[4]))
    expected = n * noise_sigma**2
    unexplained = max(left - expected, 0.0) / max(total - expected, 1e-3 * total, 1e-9)
    blob, rest = max(by_blob - expected, 0.0) / max(total, 1e-9), max(left - expected, 0.0) / max(total, 1e-9)
    stretch = np.linalg.svd(theta[2:6].reshape(2, 2), compute_uv=False)
    gain, offset = theta[8], theta[9]
    white, low = ring_evidence(gray, theta, xy, side_px)
    return np.array(
        [
            -np.log(unexplained + 0.004),
            sqrt(abs(theta[10])) / side,
            np.log((blob + 0.003) / (rest + 0.003)),
            non_radial,
            -np.log(1 - min(part, 0.999)),
            quadrant,
            abs(theta[15] - 0.35),
            white,
            low,
            gain / max(gain + 2 * max(offset, 0.0), 1.0),
            np.log(max(gain, 1.0)),
            np.log(side),
            np.log(stretch[0] / max(stretch[1], 1e-6)),
        ]
    )


def ring_evidence(
    gray: NDArray[np.uint8], theta: NDArray[np.float64], xy: NDArray[np.float64], side_px: float
) -> tuple[float, float]:
    """Return the share of points just outside the pattern that are white, and the lower fifth of their levels."""
    side = sqrt(abs(theta[2] * theta[5] - theta[3] * theta[4]))
    away = 0.5 + min(max(0.06, 1.2 * sqrt(abs(theta[10]) + 0.1) / side), 0.12)
    along = np.linspace(-0.525, 0.525, 12)
    edge = np.full(12, away)
    u = np.concatenate(
        [np.column_stack(pair) for pair in ((along, -edge), (along, edge), (-edge, along), (edge, along))]
    )
    points = theta[:2] + (u @ theta[2:6].reshape(2, 2).T) / (1 + u @ theta[6:8])[:, None]
    inside = ((points >= 0) & (points < np.array(gray.shape[::-1]) - 1)).all(axis=1)
    if inside.sum() < 12:
        return 0.5, 0.5
    points = points[inside]
    x, y = points.T.astype(np.float32)
    levels = cv2.remap(gray, x[None], y[None], cv2.INTER_LINEAR)[0].astype(np.float64)
    away_from_anchor = (points - xy) / side_px
    light = np.maximum(1 + away_from_anchor @ theta[11:13], 0.2)
    relative = (levels - theta[9] - theta[8] * (away_from_anchor @ theta[13:15])) / (theta[8] * light)
    return float((relative > 0.85).mean()), float(np.quantile(relative, 0.2))


def noise_sigma_of(gray: NDArray[np.uint8]) -> float:
    """Return the image's noise, grey levels: the lower third of blocks' medians of a second difference.

    Immerkær (1996, doi:10.1006/cviu.1996.0060), made robust against texture.
    """
    stencil = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    response = np.abs(cv2.filter2D(gray.astype(np.float32), -1, stencil))[1:-1, 1:-1]
    height, width = (length // 16 for length in response.shape)
    if height == 0 or width == 0:
        return 0.3
    blocks = response[: 16 * height, : 16 * width].reshape(height, 16, width, 16).swapaxes(1, 2).reshape(-1, 256)
    return max(float(np.quantile(1.4826 * np.median(blocks, axis=1), 0.3)), 0.3)


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
) -> NDArray[np.float64]:
    """Return (7,) figures of an alignment; all 0 with fewer than 24 pixels.

    Pixels; sums of squares after a plane, after a plane and everything radial (tents of 0.08 sides around the knots),
    and after the pattern; the correlation of what is not radial; the least correlation of eight halves and quadrants;
    and that of what is not radial in a quadrant.
    """
    figures = np.empty(7)
    _measure_alignment(gray, theta, center, size, lines, index, base, extent, knots, figures)
    return figures
