"""Alignment of a printed pattern in any light: planes of gain and offset, a tone exponent, clipped pixels left out.

The model is `refine.model`'s with three things that photographs add. *Tone*: a level l of the print shows as l^γ, for a
camera's tone curve and a printer's together. *Light*: gain and offset vary over the marker as planes. *Clipping*:
where model and image are both at white, nothing is compared. Tone is fitted first; planes second, and kept only where
they explain a fifth of what was left, for planes from the start let blur explain a pattern away.

Parameters: the eleven of `refine.model`, then the slopes of gain along x and y, those of the offset, and ln γ. Slopes
are shares of the gain a side, measured from the anchor: its x, y and the side, px.
"""

from math import cos, exp, log, pi, sin, sqrt

import numpy as np
from peaksim.kernel import kernel

from peakmark.refine.align import block_means, chosen_pixels, level_between, softened
from peakmark.refine.model import pattern_point, smoothed_shares

PARAMETERS = 16
"""Number of parameters."""

TONE_SPREAD = 0.5
"""Standard deviation of the prior on ln γ: fitted exponents of photographs are 1.0…2.4 (ln 0…0.9)."""

GAIN_SPREAD, OFFSET_SPREAD = 0.5, 0.3
"""Standard deviations of the priors on the slopes of gain and offset, shares of the gain a side."""

_WORTH = 0.8
"""Planes are kept if they leave less than this share of the noise that tone alone leaves."""

_CLIPPED = 253.5
"""Grey level from which a pixel counts as white."""

_HELD = 1e12
_RIDGE = 1e-9
_SHARP, _MIN_BLUR = 0.1, 1e-3
_NOISE_FLOOR = 1 / 12
_LEVEL_SIDE = 18.0
_CENTER_SPREAD, _SHAPE_SPREAD = 0.1, 0.25
_MIN_PIXELS = 24
"""As in `refine.align`."""

_PERFECT = 1e-4
"""Noise over gain² of a fit that is at its minimum: clean edges there make every step look wrong."""

_CLEAR = 0.01
"""Noise over gain² at which the softened image is explained, and no further shapes are tried."""


@kernel
def fit_levels(theta, base, levels, slopes):
    """Fill in how printed levels (k,) show under the tone exponent, and the derivative by its logarithm."""
    exponent = exp(theta[15])
    for k in range(len(base)):
        if base[k] <= 0.0 or base[k] >= 1.0:
            levels[k], slopes[k] = base[k], 0.0
        else:
            levels[k] = base[k] ** exponent
            slopes[k] = levels[k] * log(base[k]) * exponent


@kernel
def lit_residuals(gray, pixels, theta, anchor, lines, index, base):
    """Return image − prediction (n,) at pixels (n, 2) and the prediction's derivatives (16, n).

    `index` (k, k) says which of the printed levels `base` each cell of the pattern has. Beyond the pattern's horizon
    the residual is 255; where image and prediction are both white it is 0, without derivatives.
    """
    n = len(pixels)
    difference, jacobian = np.full(n, 255.0), np.zeros((PARAMETERS, n))
    levels, slopes = np.zeros(len(base)), np.zeros(len(base))
    fit_levels(theta, base, levels, slopes)
    gain, offset, blur = theta[8], theta[9], theta[10]
    shares, seen_of = np.empty((6, lines.size + 1)), np.zeros(len(base))
    for i in range(n):
        x, y = pixels[i, 0], pixels[i, 1]
        u, v, w, ux, uy, vx, vy = pattern_point(theta, x, y)
        if w <= 0.05:
            continue
        blur_u, blur_v = blur * (ux * ux + uy * uy), blur * (vx * vx + vy * vy)
        u_first, u_last = smoothed_shares(u, abs(ux), abs(uy), blur_u, lines, shares[0], shares[1], shares[2])
        v_first, v_last = smoothed_shares(v, abs(vx), abs(vy), blur_v, lines, shares[3], shares[4], shares[5])
        seen_of[:] = 0.0
        seen, du, dv, db, dt = 0.0, 0.0, 0.0, 0.0, 0.0
        for row in range(v_first, v_last + 1):
            across, slope, bend = 0.0, 0.0, 0.0
            for column in range(u_first, u_last + 1):
                k = index[row, column]
                seen_of[k] += shares[3, row] * shares[0, column]
                across += levels[k] * shares[0, column]
                slope += levels[k] * shares[1, column]
                bend += levels[k] * shares[2, column]
            du += shares[3, row] * slope
            dv += shares[4, row] * across
            db += shares[3, row] * bend * blur_u + shares[5, row] * across * blur_v
        for k in range(len(base)):
            seen += seen_of[k] * levels[k]
            dt += seen_of[k] * slopes[k]
        p, q = (x - anchor[0]) / anchor[2], (y - anchor[1]) / anchor[2]
        light, shade = 1 + theta[11] * p + theta[12] * q, theta[13] * p + theta[14] * q
        value = offset + gain * (light * seen + shade)
        if value >= _CLIPPED and gray[y, x] >= _CLIPPED:
            difference[i] = 0.0
            continue
        difference[i] = gray[y, x] - value
        px, py = gain * light * (du * ux + dv * vx), gain * light * (du * uy + dv * vy)
        along = px * (x - theta[0]) + py * (y - theta[1])
        jacobian[0, i], jacobian[1, i] = -px, -py
        jacobian[2, i], jacobian[3, i] = -px * u / w, -px * v / w
        jacobian[4, i], jacobian[5, i] = -py * u / w, -py * v / w
        jacobian[6, i], jacobian[7, i] = along * u / w, along * v / w
        jacobian[8, i], jacobian[9, i], jacobian[10, i] = light * seen + shade, 1.0, gain * light * db / (2 * blur)
        jacobian[11, i], jacobian[12, i] = gain * p * seen, gain * q * seen
        jacobian[13, i], jacobian[14, i], jacobian[15, i] = gain * p, gain * q, gain * light * dt
    return difference, jacobian


@kernel
def lit_gram(rows, used):
    """Return rows @ rowsᵀ of (k, n) over the rows that are used; the others are 0."""
    k, n = rows.shape
    result = np.zeros((k, k))
    for a in range(k):
        if not used[a]:
            continue
        for b in range(a + 1):
            if not used[b]:
                continue
            total = 0.0
            for i in range(n):
                total += rows[a, i] * rows[b, i]
            result[a, b] = result[b, a] = total
    return result


@kernel
def lit_fit(gray, pixels, start, anchor, lines, index, base, mean, precision, steps, enough):
    """Minimise residuals² / noise + prior by Levenberg–Marquardt; return parameters, noise, whether it converged."""
    theta, n = start.copy(), len(pixels)
    if n < _MIN_PIXELS:
        return theta, 0.0, False
    used = precision < 0.5 * _HELD
    damping, converged = 1e-3, False
    r, jacobian = lit_residuals(gray, pixels, theta, anchor, lines, index, base)
    squares = np.sum(r * r)
    noise = max(squares / max(n - 11, 1), _NOISE_FLOOR)
    for _ in range(steps):
        slope = (jacobian * r).sum(axis=1) / noise + precision * (mean - theta)
        if not np.isfinite(slope).all():
            return theta, noise, False
        hessian = lit_gram(jacobian, used) / noise + np.diag(precision)
        for k in range(PARAMETERS):
            hessian[k, k] = hessian[k, k] * (1 + damping) + _RIDGE
            if not used[k]:
                slope[k] = 0.0
        step = np.linalg.solve(hessian, slope)
        decrement = np.sum(step * slope)
        if used[10] and theta[10] + step[10] < _MIN_BLUR:
            bounded = slope.copy()
            hessian[10, 10] += _HELD
            bounded[10] = _HELD * (_MIN_BLUR - theta[10])
            step = np.linalg.solve(hessian, bounded)
            decrement = np.sum(step * slope) - step[10] * slope[10]
        new_r, new_jacobian = lit_residuals(gray, pixels, theta + step, anchor, lines, index, base)
        new_squares = np.sum(new_r * new_r)
        if not new_squares <= 1.2 * squares:
            damping *= 30
            converged = False
            continue
        theta, r, jacobian, squares = theta + step, new_r, new_jacobian, new_squares
        noise = max(squares / max(n - 11, 1), _NOISE_FLOOR)
        damping /= 30
        converged = decrement < 1.0
        if decrement < enough:
            break
    return theta, noise, converged or noise < _PERFECT * theta[8] ** 2


@kernel
def correlate_shapes(image, cx, cy, size, samples, template, shapes):
    """Return the shape (k, 2, 2) under which the image correlates best with the template, and the correlation.

    A plane over the samples is taken out of the image first, so that a ramp of light costs nothing.
    """
    height, width = image.shape
    best, best_score, m = 0, -np.inf, len(samples)
    spread = 0.0
    for i in range(m):
        spread += samples[i, 0] ** 2
    for k in range(len(shapes)):
        total, squares, product, along, down = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(m):
            u, v = samples[i, 0] * size, samples[i, 1] * size
            x = min(max(cx + shapes[k, 0, 0] * u + shapes[k, 0, 1] * v, 0.0), width - 1.001)
            y = min(max(cy + shapes[k, 1, 0] * u + shapes[k, 1, 1] * v, 0.0), height - 1.001)
            value = level_between(image, x, y)
            total += value
            squares += value * value
            product += value * template[i]
            along += value * samples[i, 0]
            down += value * samples[i, 1]
        variance = squares - total * total / m - (along * along + down * down) / spread
        score = product / sqrt(max(variance, 1e-6))
        if score > best_score:
            best, best_score = k, score
    return best, best_score


@kernel
def correlate_candidates(gray, xy, sides, samples, template, shapes, shifts):
    """Return (n,) the best correlation of each candidate over shapes, then over shifts of its centre in sides."""
    found = np.zeros(len(xy))
    for i in range(len(xy)):
        side = sides[i]
        reach = 1.2 * side + 4
        left, top = int(max(0.0, xy[i, 0] - reach)), int(max(0.0, xy[i, 1] - reach))
        crop = gray[top : int(xy[i, 1] + reach) + 1, left : int(xy[i, 0] + reach) + 1].astype(np.float32)
        block = max(1, int(side / 12.0))
        level = block_means(crop, block)
        if min(level.shape) < 4:
            continue
        soft = softened(level)
        cx, cy = (xy[i, 0] - left - (block - 1) / 2) / block, (xy[i, 1] - top - (block - 1) / 2) / block
        best, found[i] = correlate_shapes(soft, cx, cy, side / block, samples, template, shapes)
        for j in range(len(shifts)):
            x, y = cx + shifts[j, 0] * side / block, cy + shifts[j, 1] * side / block
            _, score = correlate_shapes(soft, x, y, side / block, samples, template, shapes[best : best + 1])
            found[i] = max(found[i], score)
    return found


@kernel
def lit_soft_fit(
    level, center, size, anchor, lines, index, base, extent, precision, samples, template, shapes, hopeless
):
    """Return the parameters (16,) of the best fit to the softened image, and its noise over gain².

    As `refine.align.soft_fit`, and stopped where the first three rotations leave more than `hopeless`.
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
        chosen, _ = correlate_shapes(soft, center[0], center[1], size, samples, template, shapes[:candidates])
        shape = shapes[chosen]
        for rotation in range(3):
            c, s = size * cos(rotation * pi / 6), size * sin(rotation * pi / 6)
            start[2], start[3] = shape[0, 0] * c + shape[0, 1] * s, shape[0, 1] * c - shape[0, 0] * s
            start[4], start[5] = shape[1, 0] * c + shape[1, 1] * s, shape[1, 1] * c - shape[1, 0] * s
            image, start[10] = soft, blur
            pixels = chosen_pixels(soft, start, lines, extent, 250)
            if len(pixels) < _MIN_PIXELS:
                image, start[10] = level, _SHARP
                pixels = chosen_pixels(level, start, lines, extent, 250)
            theta, noise, _ = lit_fit(image, pixels, start, anchor, lines, index, base, start, precision, 12, 0.3)
            if noise > 0 and theta[8] > 0 and noise / theta[8] ** 2 < best_ratio:
                best, best_ratio = theta, noise / theta[8] ** 2
        if best_ratio < _CLEAR or best_ratio > hopeless:
            break
    return best, best_ratio


@kernel
def align_in_light(gray, center, size, lines, index, base, extent, focal, samples, template, shapes, hopeless):
    """Align the pattern near a position; return parameters (16,), noise, whether it converged, and the soft ratio.

    The anchor of the planes is the centre and size that were given.
    """
    reach = 1.2 * size + 4
    left, top = int(max(0.0, center[0] - reach)), int(max(0.0, center[1] - reach))
    crop = gray[top : int(center[1] + reach) + 1, left : int(center[0] + reach) + 1].astype(np.float32)
    block = max(1, int(size / _LEVEL_SIDE))
    level = block_means(crop, block)
    theta = np.zeros(PARAMETERS)
    if min(level.shape) < 4:
        return theta, 0.0, False, np.inf
    shift = np.array([left + (block - 1) / 2, top + (block - 1) / 2])
    mean, precision = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    precision[6] = precision[7] = (focal / size) ** 2
    precision[10] = precision[11] = precision[12] = precision[13] = precision[14] = _HELD
    precision[15] = 1 / TONE_SPREAD**2
    local = (center - shift) / block
    anchor = np.array([local[0], local[1], size / block])
    theta, ratio = lit_soft_fit(
        level, local, size / block, anchor, lines, index, base, extent, precision, samples, template, shapes, hopeless
    )
    if ratio > hopeless:
        return theta, 0.0, False, ratio
    mean[10] = theta[10] = _SHARP
    if block > 1:
        pixels = chosen_pixels(level, theta, lines, extent, 600)
        theta, noise, converged = lit_fit(level, pixels, theta, anchor, lines, index, base, mean, precision, 8, 1.0)
    theta[:2] = block * theta[:2] + (block - 1) / 2
    theta[2:6] *= block
    anchor = np.array([center[0] - left, center[1] - top, size])
    precision[10] = 1 / 25
    pixels = chosen_pixels(crop, theta, lines, extent, 3000)
    theta, noise, converged = lit_fit(crop, pixels, theta, anchor, lines, index, base, mean, precision, 15, 1e-2)
    precision[11] = precision[12] = 1 / GAIN_SPREAD**2
    precision[13] = precision[14] = 1 / OFFSET_SPREAD**2
    lit, lit_noise, lit_converged = lit_fit(crop, pixels, theta, anchor, lines, index, base, mean, precision, 15, 1e-2)
    if lit_converged and lit[8] > 0 and (not converged or lit_noise < _WORTH * noise):
        theta, noise, converged = lit, lit_noise, lit_converged
    theta[0] += left
    theta[1] += top
    return theta, noise, converged and theta[8] > 0, ratio
