"""Alignment of a known pattern with an image: coarse search over shapes, then Levenberg–Marquardt; in C.

`native/refine_align.c` holds the kernels; the steps can be called by themselves too.
"""

from functools import cache
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

from peakmark.refine.model import PARAMETERS, levels_at

Values = NDArray[np.float64]

_GRID = "const f8[line_count] lines, const f8[rows,intervals] levels"
_COARSE = "const f8[sample_count,2] samples, const f8[sample_count] expected, const f8[shape_count,2,2] shapes"
_FITTED = "f8[11] theta, f8[1] noise, b1[1] converged"

_align = function(
    f"status align(const u1[height,width] gray, const f8[2] center, f8 size, {_GRID}, f8 extent, f8 focal, {_COARSE}, "
    "f8[11] theta, f8[11,11] covariance, f8[1] noise, b1[1] converged)"
)
_block_means = function("void block_means(const f4[height,width] image, i8 block, f4[rows,columns] means)")
_softened = function("void softened(const f4[height,width] image, f4[height,width] rows, f4[height,width] result)")
_bounded_area = function("i8 bounded_area(const f8[11] theta, f8 extent, i8 height, i8 width)")
_chosen_pixels = function(
    "status chosen_pixels(const f8[11] theta, const f8[line_count] lines, f8 extent, i8 height, i8 width, i8 wanted, "
    "i4[room,2] xy, b1[room] near, i8[1] count)"
)
_coarse_shape = function(
    f"status coarse_shape(const f4[height,width] image, const f8[2] center, f8 size, {_COARSE}, i8[1] best)"
)
_gauss_newton = function(
    f"status gauss_newton(const f4[n] seen, const i4[n,2] xy, const f8[11] start, {_GRID}, const f8[11] mean, "
    f"const f8[11] precision, i8 steps, f8 done, {_FITTED})"
)
_soft_fit = function(
    f"status soft_fit(const f4[height,width] image, const f8[2] center, f8 size, {_GRID}, f8 extent, "
    f"const f8[11] precision, {_COARSE}, f8[11] theta)"
)
_sandwich = function(
    f"status sandwich(const f4[n] seen, const i4[n,2] xy, const f8[11] theta, {_GRID}, f8 noise, "
    "const f8[11] precision, f8[11,11] covariance)"
)


def align(
    gray: NDArray[np.uint8],
    center: Values,
    size: float,
    lines: Values,
    levels: Values,
    extent: float,
    focal: float,
    samples: Values,
    template: Values,
    shapes: Values,
) -> tuple[Values, Values, float, bool]:
    """Find the pattern near a position in an image.

    From a shape search on block means in which the pattern has about 20 px a side, softened, over the sharp
    block means to the image's own pixels. Returns parameters (11,), covariance (11, 11), nan where not converged, the
    residuals' mean square, and whether the fit converged.
    """
    theta, covariance = np.empty(PARAMETERS), np.empty((PARAMETERS, PARAMETERS))
    noise, converged = np.empty(1), np.empty(1, np.bool_)
    grid, coarse = (lines, levels, extent), (samples, template, shapes)
    _align(gray, center, size, *grid, focal, *coarse, theta, covariance, noise, converged)
    return theta, covariance, float(noise[0]), bool(converged[0])


def soft_fit(
    level: NDArray[np.float32],
    center: Values,
    size: float,
    lines: Values,
    levels: Values,
    extent: float,
    precision: Values,
    samples: Values,
    template: Values,
    shapes: Values,
) -> Values:
    """Return the parameters (11,) of the best fit to the softened image.

    Starts from the best of all shapes, if that does not explain the image from the best of those that are
    hardly foreshortened, and each rotated by 30° and 60° too: the rotation is what blur hides. A pattern seen so
    obliquely that softening leaves too few pixels clear of its surround is fitted to the sharp image.
    """
    theta = np.empty(PARAMETERS)
    _soft_fit(level, center, size, lines, levels, extent, precision, samples, template, shapes, theta)
    return theta


def block_means(image: NDArray[np.float32], block: int) -> NDArray[np.float32]:
    """Return the means of block × block pixels, without an incomplete last row or column."""
    means = np.empty((image.shape[0] // block, image.shape[1] // block), np.float32)
    _block_means(image, block, means)
    return means


def softened(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the image filtered by (1, 2, 1) / 4 along both axes, edges repeated: variance ½ px²."""
    rows, result = np.empty(image.shape, np.float32), np.empty(image.shape, np.float32)
    _softened(image, rows, result)
    return result


def chosen_pixels(image: NDArray[Any], theta: Values, lines: Values, extent: float, wanted: int) -> NDArray[np.int32]:
    """Return the pixels (n, 2) to compare, at most about `wanted` of them."""
    height, width = image.shape
    room = _bounded_area(theta[:PARAMETERS], extent, height, width)
    found, count = np.empty((room, 2), np.int32), np.empty(1, np.int64)
    near = np.empty(room, np.bool_)
    _chosen_pixels(theta[:PARAMETERS], lines, extent, height, width, wanted, found, near, count)
    return found[: count[0]]


def gauss_newton(
    gray: NDArray[Any],
    pixels: NDArray[np.int32],
    start: Values,
    lines: Values,
    levels: Values,
    mean: Values,
    precision: Values,
    steps: int,
    done: float,
) -> tuple[Values, float, bool]:
    """Solve Jᵀr / noise = precision (θ − mean), the noise being the residuals' own mean square.

    Stops when a step is shorter than √done standard deviations. J leaves out how A and g change the blur, so
    the solution is that of an unbiased estimating equation; Σ r² is a safeguard, not what is minimised. The blur's
    variance is held above 0.001 px². Returns parameters (11,), noise (grey levels²), at least that of rounding to whole
    levels, or 0 for fewer than 24 pixels, and whether it converged within `steps`.
    """
    theta, noise, converged = np.empty(PARAMETERS), np.empty(1), np.empty(1, np.bool_)
    data, before = (levels_at(gray, pixels), pixels), (mean, precision)
    _gauss_newton(*data, start, lines, levels, *before, steps, done, theta, noise, converged)
    return theta, float(noise[0]), bool(converged[0])


def sandwich(
    gray: NDArray[Any],
    pixels: NDArray[np.int32],
    theta: Values,
    lines: Values,
    levels: Values,
    noise: float,
    precision: Values,
) -> Values:
    """Return the covariance (11, 11) as H⁻¹ (Σ e² j jᵀ + prior) H⁻¹, H = JᵀJ / noise + prior.

    It stays right where the noise depends on the grey level or is cut at black and white. e is a pixel's residual
    from a fit without that pixel, r / (1 − leverage): the few pixels at edges decide the centre and draw the fit to
    themselves, so that r alone would promise too much (MacKinnon & White 1985, doi:10.1016/0304-4076(85)90158-7).
    """
    covariance = np.full((PARAMETERS, PARAMETERS), np.nan)
    _sandwich(levels_at(gray, pixels), pixels, theta, lines, levels, noise, precision, covariance)
    return covariance


def coarse_shape(
    image: NDArray[Any], cx: float, cy: float, size: float, samples: Values, template: Values, shapes: Values
) -> int:
    """Return the index of the shape whose view of the pattern correlates best with the image.

    `samples` (m, 2), at most 128, are pattern points and `template` (m,) their levels, of mean 0; `shapes` (k, 2, 2)
    map sides to multiples of `size`. Samples outside the image take its nearest pixel.
    """
    best = np.empty(1, np.int64)
    center = np.array([cx, cy])
    _coarse_shape(np.asarray(image, dtype=np.float32), center, size, samples, template, shapes, best)
    return int(best[0])


@cache
def shape_grid() -> np.ndarray:
    """Return the (k, 2, 2) shapes of `coarse_shape`: rotations, foreshortenings and their directions, sizes."""
    shapes = []
    for aspect in (1.0, 1.5, 2.2, 3.3):
        for direction in np.arange(0, pi, pi / 8) if aspect > 1 else (0.0,):
            c, s = cos(direction), sin(direction)
            across = np.array([[c, -s], [s, c]])
            stretch = across @ np.diag([sqrt(aspect), 1 / sqrt(aspect)]) @ across.T
            for angle in np.arange(0, pi / 2, pi / 12):
                rotation = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
                shapes += [scale * stretch @ rotation for scale in (0.75, 0.9, 1.1, 1.33)]
    return np.array(shapes)
