"""Alignment of a known pattern with an image: coarse search over shapes, then Levenberg–Marquardt (Numba)."""

from functools import cache
from math import cos, pi, sin, sqrt

import numpy as np
from peaksim.kernel import kernel

from peakmark.refine.model import PARAMETERS, gram, residuals, select_pixels

_MIN_PIXELS = 24
"""Fewer pixels than this, about two a parameter, are not fitted."""

_SOFT_PIXELS, _BLOCK_PIXELS, _PIXELS = 250, 600, 3000
"""Most pixels that are compared with the softened image, the block means, and the image itself; set by hand."""

_SHARP = 0.1
"""Variance of the blur, px², from which a fit to an image that was not softened starts."""

_MIN_BLUR = 1e-3
"""Least variance of the blur, px²: the model divides by it."""

_HELD = 1e12
"""Precision of the prior that holds a parameter."""

_RIDGE = 1e-9
"""Added to the diagonal, so that a parameter that nothing tells does not make it singular."""

_CLEAR = 0.01
"""Noise over gain² below which the best shape explains the image, and no others are tried."""

_CENTER_SPREAD, _SHAPE_SPREAD = 0.1, 0.25
"""Standard deviations of the prior on centre and shape in the first fit, in sides: what a detector's errors may be."""

_LEVEL_SIDE = 18.0
"""Side, px, to which block means bring a larger pattern, at least; above it the first fit softens twice."""

_NOISE_FLOOR = 1 / 12
"""Variance of rounding to whole grey levels."""

_BLUR_SPREAD = 5.0
"""Standard deviation of the prior on the blur's variance in the last fit, px²."""


@kernel
def align(gray, center, size, lines, levels, extent, focal, samples, template, shapes):
    """Find the pattern near a position in an image.

    From a shape search on block means in which the pattern has about 20 px a side, softened, over the sharp
    block means to the image's own pixels. Returns parameters (11,), covariance (11, 11), the residuals'
    mean square, and whether the fit converged.
    """
    reach = 1.2 * size + 4
    left, top = int(max(0.0, center[0] - reach)), int(max(0.0, center[1] - reach))
    crop = gray[top : int(center[1] + reach) + 1, left : int(center[0] + reach) + 1].astype(np.float32)
    block = max(1, int(size / _LEVEL_SIDE))
    level = block_means(crop, block)
    theta = np.zeros(PARAMETERS)
    covariance = np.full((PARAMETERS, PARAMETERS), np.nan)
    if min(level.shape) < 4:
        return theta, covariance, 0.0, False
    shift = np.array([left + (block - 1) / 2, top + (block - 1) / 2])
    mean, precision = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    precision[6], precision[7] = (focal / size) ** 2, (focal / size) ** 2
    precision[10] = _HELD
    theta = soft_fit(
        level, (center - shift) / block, size / block, lines, levels, extent, precision, samples, template, shapes
    )
    mean[10] = theta[10] = _SHARP
    if block > 1:
        pixels = chosen_pixels(level, theta, lines, extent, _BLOCK_PIXELS)
        theta, noise, converged = gauss_newton(level, pixels, theta, lines, levels, mean, precision, 8, 1.0)
    theta[:2] = block * theta[:2] + (block - 1) / 2
    theta[2:6] *= block
    precision[10] = 1 / _BLUR_SPREAD**2
    pixels = chosen_pixels(crop, theta, lines, extent, _PIXELS)
    theta, noise, converged = gauss_newton(crop, pixels, theta, lines, levels, mean, precision, 15, 1e-2)
    if converged:
        covariance = sandwich(crop, pixels, theta, lines, levels, noise, precision)
    theta[0] += left
    theta[1] += top
    return theta, covariance, noise, converged


@kernel
def soft_fit(level, center, size, lines, levels, extent, precision, samples, template, shapes):
    """Return the parameters (11,) of the best fit to the softened image.

    Starts from the best of all shapes, if that does not explain the image from the best of those that are
    hardly foreshortened, and each rotated by 30° and 60° too: the rotation is what blur hides. A pattern seen so
    obliquely that softening leaves too few pixels clear of its surround is fitted to the sharp image.
    """
    soft, blur = softened(level), 0.5
    if size > _LEVEL_SIDE:
        soft, blur = softened(soft), 1.0
    start = np.zeros(PARAMETERS)
    start[:2] = center
    start[8], start[9] = soft.max() - soft.min(), soft.min()
    precision = precision.copy()
    precision[:2], precision[2:6] = 1 / (_CENTER_SPREAD * size) ** 2, 1 / (_SHAPE_SPREAD * size) ** 2
    best, best_ratio = start.copy(), np.inf
    for candidates in (len(shapes), len(shapes) // 3):
        shape = shapes[coarse_shape(soft, center[0], center[1], size, samples, template, shapes[:candidates])]
        for third in range(3):
            c, s = size * cos(third * pi / 6), size * sin(third * pi / 6)
            start[2], start[3] = shape[0, 0] * c + shape[0, 1] * s, shape[0, 1] * c - shape[0, 0] * s
            start[4], start[5] = shape[1, 0] * c + shape[1, 1] * s, shape[1, 1] * c - shape[1, 0] * s
            image, start[10] = soft, blur
            pixels = chosen_pixels(soft, start, lines, extent, _SOFT_PIXELS)
            if len(pixels) < _MIN_PIXELS:
                image, start[10] = level, _SHARP
                pixels = chosen_pixels(level, start, lines, extent, _SOFT_PIXELS)
            theta, noise, _ = gauss_newton(image, pixels, start, lines, levels, start, precision, 12, 0.3)
            if noise > 0 and theta[8] > 0 and noise / theta[8] ** 2 < best_ratio:
                best, best_ratio = theta, noise / theta[8] ** 2
        if best_ratio < _CLEAR:
            break
    return best


@kernel
def block_means(image, block):
    """Return the means of block × block pixels, without an incomplete last row or column."""
    height, width = image.shape[0] // block, image.shape[1] // block
    means = np.zeros((height, width), np.float32)
    for y in range(height * block):
        for x in range(width * block):
            means[y // block, x // block] += image[y, x]
    return means / np.float32(block * block)


@kernel
def softened(image):
    """Return the image filtered by (1, 2, 1) / 4 along both axes, edges repeated: variance ½ px²."""
    height, width = image.shape
    rows, result = np.empty_like(image), np.empty_like(image)
    for y in range(height):
        for x in range(width):
            rows[y, x] = (image[y, max(x - 1, 0)] + 2 * image[y, x] + image[y, min(x + 1, width - 1)]) / 4
    for y in range(height):
        for x in range(width):
            result[y, x] = (rows[max(y - 1, 0), x] + 2 * rows[y, x] + rows[min(y + 1, height - 1), x]) / 4
    return result


@kernel
def chosen_pixels(image, theta, lines, extent, wanted):
    """Return the pixels (n, 2) to compare, at most about `wanted` of them."""
    height, width = image.shape
    pixels = select_pixels(theta, lines, extent, width, height, 1)
    stride = (len(pixels) + wanted - 1) // wanted
    return pixels if stride <= 1 else select_pixels(theta, lines, extent, width, height, stride)


@kernel
def gauss_newton(gray, pixels, start, lines, levels, mean, precision, steps, done):
    """Solve Jᵀr / noise = precision (θ − mean), the noise being the residuals' own mean square.

    Stops when a step is shorter than √done standard deviations. J leaves out how A and g change the blur, so
    the solution is that of an unbiased estimating equation; Σ r² is a safeguard, not what is minimised.
    Returns parameters (11,), noise (grey levels²) and whether it converged within `steps`.
    """
    theta, n = start.copy(), len(pixels)
    if n < _MIN_PIXELS:
        return theta, 0.0, False
    damping, converged = 1e-3, False
    r, J = residuals(gray, pixels, theta, lines, levels)
    squares = np.sum(r * r)
    noise = max(squares / (n - PARAMETERS), _NOISE_FLOOR)
    for _ in range(steps):
        slope = (J * r).sum(axis=1) / noise + precision * (mean - theta)
        if not np.isfinite(slope).all():
            return theta, noise, False
        step, decrement = damped_step(gram(J) / noise + np.diag(precision), slope, damping, theta[10])
        new_r, new_J = residuals(gray, pixels, theta + step, lines, levels)
        new_squares = np.sum(new_r * new_r)
        if new_squares > 1.2 * squares:
            damping *= 30
            continue
        theta, r, J, squares = theta + step, new_r, new_J, new_squares
        noise = max(squares / (n - PARAMETERS), _NOISE_FLOOR)
        damping /= 30
        converged = decrement < done
        if converged:
            break
    return theta, noise, converged


@kernel
def damped_step(hessian, slope, damping, blur):
    """Return the step (11,) of a damped Newton iteration, with the blur held at its least, and its length in σ²."""
    for k in range(PARAMETERS):
        hessian[k, k] = hessian[k, k] * (1 + damping) + _RIDGE
    step = np.linalg.solve(hessian, slope)
    if blur + step[10] >= _MIN_BLUR:
        return step, np.sum(step * slope)
    slope = slope.copy()
    hessian[10, 10] += _HELD
    slope[10] = _HELD * (_MIN_BLUR - blur)
    step = np.linalg.solve(hessian, slope)
    return step, np.sum(step[:10] * slope[:10])


@kernel
def sandwich(gray, pixels, theta, lines, levels, noise, precision):
    """Return the covariance (11, 11) as H⁻¹ (Σ e² j jᵀ + prior) H⁻¹, H = JᵀJ / noise + prior.

    It stays right where the noise depends on the grey level or is cut at black and white. e is a pixel's residual
    from a fit without that pixel, r / (1 − leverage): the few pixels at edges decide the centre and draw the fit to
    themselves, so that r alone would promise too much (MacKinnon & White 1985, doi:10.1016/0304-4076(85)90158-7).
    """
    r, J = residuals(gray, pixels, theta, lines, levels)
    inverse = np.linalg.inv(gram(J) / noise + np.diag(precision + _RIDGE))
    leverage = (J * (inverse @ J)).sum(axis=0) / noise
    middle = gram(J * (r / np.sqrt(1 - leverage))) / noise**2 + np.diag(precision)
    return inverse @ middle @ inverse


@kernel
def level_between(image, x, y):
    """Return the level at (x, y) between four pixels, which all lie in the image."""
    left, top = int(x), int(y)
    fx, fy = x - left, y - top
    upper = image[top, left] * (1 - fx) + image[top, left + 1] * fx
    lower = image[top + 1, left] * (1 - fx) + image[top + 1, left + 1] * fx
    return upper * (1 - fy) + lower * fy


@kernel
def coarse_shape(image, cx, cy, size, samples, template, shapes):
    """Return the index of the shape whose view of the pattern correlates best with the image.

    `samples` (m, 2) are pattern points and `template` (m,) their levels, of mean 0; `shapes` (k, 2, 2) map
    sides to multiples of `size`. Samples outside the image take its nearest pixel.
    """
    height, width = image.shape
    best, best_score = 0, -np.inf
    for k in range(len(shapes)):
        total, squares, product = 0.0, 0.0, 0.0
        for i in range(len(samples)):
            u, v = samples[i, 0] * size, samples[i, 1] * size
            x = min(max(cx + shapes[k, 0, 0] * u + shapes[k, 0, 1] * v, 0.0), width - 1.001)
            y = min(max(cy + shapes[k, 1, 0] * u + shapes[k, 1, 1] * v, 0.0), height - 1.001)
            value = level_between(image, x, y)
            total += value
            squares += value * value
            product += value * template[i]
        score = product / sqrt(max(squares - total * total / len(samples), 1e-9))
        if score > best_score:
            best, best_score = k, score
    return best


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
