"""Alignment of a printed pattern in any light: tone, planes of gain and offset, blur along a direction, covers.

The model is `refine.model`'s with what photographs add. *Tone*: a level l of the print shows as l^γ, for a camera's
tone curve and a printer's together. *Light*: gain and offset vary over the marker as planes. *Motion*: blur is wider
along one direction. *Clipping*: where model and image are both at white, nothing is compared. Tone is fitted first;
planes and motion after it, and kept only where the log likelihood gains 25, for planes from the start let blur
explain a pattern away; a fit that cannot gain as much any more ends. *Covers*: where that leaves much that noise does
not explain, or went astray, a second look takes the shape and the sectors around the centre in which pattern and
softened image agree best, fits these alone, and then all, where pixels that are far off count little (Geman &
McClure), at first only those very far.

Parameters: the eleven of `refine.model`; the slopes of gain along x and y, and those of the offset; ln γ; and d, e of
the blur's covariance ((b + d, e), (e, b − d)), px². Slopes are shares of the gain a side, measured from the anchor: its
x, y and the side, px.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.refine.model import levels_at

Values = NDArray[np.float64]

PARAMETERS = 18
"""Number of parameters."""

_GRID = "const f8[line_count] lines, const i8[rows,intervals] index, const f8[base_count] base"
_COARSE = "const f8[sample_count,2] samples, const f8[sample_count] expected, const f8[shape_count,2,2] shapes"
_PIXELS = "const f4[n] seen, const i4[n,2] xy"

_lit_residuals = function(
    f"status lit_residuals({_PIXELS}, const f8[18] theta, const f8[3] anchor, {_GRID}, b1 is_quick, "
    "f8[n] r, f8[18,n] jacobian)"
)
_lit_fit = function(
    f"status lit_fit({_PIXELS}, const f8[18] start, const f8[3] anchor, {_GRID}, const f8[18] mean, "
    "const f8[18] precision, i8 steps, f8 enough, f8[18] theta, f8[1] noise, b1[1] converged)"
)
_align_each = function(
    f"status align_each(const u1[height,width] gray, const f8[n,2] xy, const f8[n] sides, {_GRID}, f8 extent, "
    f"f8 focal, {_COARSE}, f8 sigma, f8 hopeless, i8 stage, f8[n,18] theta, f8[n,6] fits)"
)
_finish_in_light = function(
    f"status finish_in_light(const u1[height,width] gray, const f8[2] center, f8 size, {_GRID}, f8 extent, f8 rim, "
    "f8 focal, f8 cut, f8[18] theta, f8[18,18] covariance)"
)


def lit_residuals(
    gray: NDArray[Any],
    pixels: NDArray[np.int32],
    theta: Values,
    anchor: Values,
    lines: Values,
    index: NDArray[np.int64],
    base: Values,
    is_quick: bool = False,
) -> tuple[Values, Values]:
    """Return image − prediction (n,) at pixels (n, 2) and the prediction's derivatives (18, n).

    Quick ones, which all fits but the last take, may be off by 0.002 of an edge's height.

    `index` (k, k) says which of the printed levels `base` each cell of the pattern has. Beyond the pattern's horizon
    the residual is 255; where image and prediction are both white (253.5 and more) it is 0, without derivatives.
    """
    difference, jacobian = np.empty(len(pixels)), np.empty((PARAMETERS, len(pixels)))
    pattern = (lines, index, base, is_quick)
    _lit_residuals(levels_at(gray, pixels), pixels, theta, anchor, *pattern, difference, jacobian)
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


SOFT, SHARP, PARTS, PART = range(4)
"""Stages of an alignment: a fit to the softened image, and fits to its own pixels; then, where that explains little,
the same at parts, for something may cover the pattern."""

NOISE, STEP, RATIO, CUT, RAMP, WAS = range(6)
"""Columns of fits: mean square of the residuals, grey levels²; length of the last step, σ², below 1 it converged, inf
where it was given up; noise over gain², beyond the image's own, of the best fit to the softened image, inf where
there was none; grey levels of a residual that counts a quarter, for something may cover the pattern, 0 where all
count, and after `PARTS` the share of pixels that is seen; whether a steep ramp of light was found; and after `PARTS`
the noise before it, inf where it was given up."""


def align_each(
    gray: NDArray[np.uint8],
    xy: Values,
    sides: Values,
    lines: Values,
    index: NDArray[np.int64],
    base: Values,
    extent: float,
    focal: float,
    samples: Values,
    template: Values,
    shapes: Values,
    sigma: float,
    hopeless: float,
    stage: int,
    theta: Values,
    fits: Values,
) -> None:
    """Take the alignments of a pattern near positions (n, 2) one stage on, in parameters (n, 18) and fits (n, 6).

    At `SOFT` it does not matter what these hold; an alignment is given up there where its ratio exceeds `hopeless`,
    and one that was given up is not for `SHARP`. What `PARTS` gives up, for it is not needed or explains nothing, is
    not for `PART`; that gives up what the parts do not explain much better. `sigma` is the noise of the image's
    pixels. The anchors of the planes are the positions and sides that were given.
    """
    settings = (lines, index, base, extent, focal, samples, template, shapes, sigma, hopeless)
    _align_each(gray, xy, sides, *settings, stage, theta, fits)


def finish_in_light(
    gray: NDArray[np.uint8],
    theta: Values,
    center: Values,
    size: float,
    lines: Values,
    index: NDArray[np.int64],
    base: Values,
    extent: float,
    rim: float,
    focal: float,
    cut: float,
) -> tuple[Values, Values]:
    """Return the parameters (18,) of an alignment after a last fit, and their covariance (`refine.align.sandwich`).

    The last fit takes the pattern's rim, up to `rim` sides from the middle instead of `extent`, where blur leaves it
    sharp and the paper around it is white; else nothing changes. Parameters that were not fitted have no variance,
    nearly; the covariance (18, 18) is nan where the pixels are too few.
    """
    theta, covariance = np.array(theta, dtype=np.float64), np.empty((PARAMETERS, PARAMETERS))
    _finish_in_light(gray, center, size, lines, index, base, extent, rim, focal, cut, theta, covariance)
    return theta, covariance
