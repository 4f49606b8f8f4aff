"""Alignment of a printed pattern in any light: planes of gain and offset, a tone exponent, clipped pixels left out.

The model is `refine.model`'s with three things that photographs add. *Tone*: a level l of the print shows as l^γ, for a
camera's tone curve and a printer's together. *Light*: gain and offset vary over the marker as planes. *Clipping*:
where model and image are both at white, nothing is compared. Tone is fitted first; planes second, and kept only where
they explain a fifth of what was left, for planes from the start let blur explain a pattern away.

Parameters: the eleven of `refine.model`, then the slopes of gain along x and y, those of the offset, and ln γ. Slopes
are shares of the gain a side, measured from the anchor: its x, y and the side, px.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.refine.model import levels_at

Values = NDArray[np.float64]

PARAMETERS = 16
"""Number of parameters."""

_GRID = "const f8[line_count] lines, const i8[intervals,intervals] index, const f8[base_count] base"
_COARSE = "const f8[sample_count,2] samples, const f8[sample_count] expected, const f8[shape_count,2,2] shapes"
_PIXELS = "const f4[n] seen, const i4[n,2] xy"

_lit_residuals = function(
    f"status lit_residuals({_PIXELS}, const f8[16] theta, const f8[3] anchor, {_GRID}, f8[n] r, f8[16,n] jacobian)"
)
_lit_fit = function(
    f"status lit_fit({_PIXELS}, const f8[16] start, const f8[3] anchor, {_GRID}, const f8[16] mean, "
    "const f8[16] precision, i8 steps, f8 enough, f8[16] theta, f8[1] noise, b1[1] converged)"
)
_align_in_light = function(
    f"status align_in_light(const u1[height,width] gray, const f8[2] center, f8 size, {_GRID}, f8 extent, f8 focal, "
    f"{_COARSE}, f8 hopeless, f8[16] theta, f8[1] noise, b1[1] converged, f8[1] ratio)"
)
_correlate_candidates = function(
    f"status correlate_candidates(const u1[height,width] gray, const f8[n,2] xy, const f8[n] sides, {_COARSE}, "
    "const f8[shift_count,2] shifts, f8[n] found)"
)


def lit_residuals(
    gray: NDArray[Any],
    pixels: NDArray[np.int32],
    theta: Values,
    anchor: Values,
    lines: Values,
    index: NDArray[np.int64],
    base: Values,
) -> tuple[Values, Values]:
    """Return image − prediction (n,) at pixels (n, 2) and the prediction's derivatives (16, n).

    `index` (k, k) says which of the printed levels `base` each cell of the pattern has. Beyond the pattern's horizon
    the residual is 255; where image and prediction are both white (253.5 and more) it is 0, without derivatives.
    """
    difference, jacobian = np.empty(len(pixels)), np.empty((PARAMETERS, len(pixels)))
    _lit_residuals(levels_at(gray, pixels), pixels, theta, anchor, lines, index, base, difference, jacobian)
    return difference, jacobian


def lit_fit(
    gray: NDArray[Any],
    pixels: NDArray[np.int32],
    start: Values,
    anchor: Values,
    lines: Values,
    index: NDArray[np.int64],
    base: Values,
    mean: Values,
    precision: Values,
    steps: int,
    enough: float,
) -> tuple[Values, float, bool]:
    """Minimise residuals² / noise + prior by Levenberg–Marquardt; return parameters, noise, whether it converged.

    Parameters whose prior has a precision of 10¹² are held. It has converged where a step is shorter than a standard
    deviation, and ends where one is shorter than √enough of them.
    """
    theta, noise, converged = np.empty(PARAMETERS), np.empty(1), np.empty(1, np.bool_)
    data, grid, before = (levels_at(gray, pixels), pixels), (lines, index, base), (mean, precision)
    _lit_fit(*data, start, anchor, *grid, *before, steps, enough, theta, noise, converged)
    return theta, float(noise[0]), bool(converged[0])


def correlate_candidates(
    gray: NDArray[np.uint8],
    xy: Values,
    sides: Values,
    samples: Values,
    template: Values,
    shapes: Values,
    shifts: Values,
) -> Values:
    """Return (n,) the best correlation of each candidate over shapes, then over shifts of its centre in sides.

    A plane over the samples is taken out of the image first, so that a ramp of light costs nothing.
    """
    found = np.empty(len(xy))
    _correlate_candidates(gray, xy, sides, samples, template, shapes, shifts, found)
    return found


def align_in_light(
    gray: NDArray[np.uint8],
    center: Values,
    size: float,
    lines: Values,
    index: NDArray[np.int64],
    base: Values,
    extent: float,
    focal: float,
    samples: Values,
    template: Values,
    shapes: Values,
    hopeless: float,
) -> tuple[Values, float, bool, float]:
    """Align the pattern near a position; return parameters (16,), noise, whether it converged, and the soft ratio.

    As `refine.align.align`. The anchor of the planes is the centre and size that were given; the soft ratio is the
    noise over gain² of the best fit to the softened image, and the alignment is given up where it exceeds `hopeless`.
    """
    theta, noise, converged, ratio = np.empty(PARAMETERS), np.empty(1), np.empty(1, np.bool_), np.empty(1)
    grid, coarse = (lines, index, base), (samples, template, shapes)
    _align_in_light(gray, center, size, *grid, extent, focal, *coarse, hopeless, theta, noise, converged, ratio)
    return theta, float(noise[0]), bool(converged[0]), float(ratio[0])
