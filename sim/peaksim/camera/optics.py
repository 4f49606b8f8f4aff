"""What a lens does to linear grey levels: blur, vignetting, and colours of different magnification."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.native import function

Levels = NDArray[np.float32]

LUMA = (0.299, 0.587, 0.114)
"""Shares of red, green and blue in a grey level (ITU-R BT.601), as OpenCV takes them."""


_filter_columns = function(
    "void filter_columns(const f4[height,width] levels, const f8[n] weights, i8[2,n] reach, f4[height,width] out)"
)
_filter_rows = function(
    "void filter_rows(const f4[height,width,channels] levels, const f8[n] weights, i8[2,n] reach, f4[longest] line, "
    "f4[height,width,channels] out)"
)


def gaussian_blur(levels: Levels, sigma_px: float) -> Levels:
    """Return the levels blurred by a Gaussian that is cut at 4 σ; the image is mirrored at its border."""
    weights = gaussian_weights(sigma_px)
    image = np.atleast_3d(levels)
    height, width, channels = image.shape
    down, both = (np.empty(image.shape, np.float32) for _ in range(2))
    reach, line = np.empty((2, len(weights)), np.int64), np.empty((width + 2 * len(weights)) * channels, np.float32)
    _filter_columns(image.reshape(height, -1), weights, reach, down.reshape(height, -1))
    _filter_rows(down, weights, reach, line, both)
    return both.reshape(levels.shape)


def gaussian_weights(sigma_px: float) -> NDArray[np.float64]:
    """Return the (n,) weights of a Gaussian at distances n − 1 … 0 px, cut at 4 σ; those of both sides sum to 1."""
    radius = int(4 * sigma_px + 0.5)
    weights = np.exp(-0.5 / sigma_px**2 * np.arange(-radius, radius + 1) ** 2)
    return np.asarray((weights / weights.sum())[: radius + 1])


def disc_blur(levels: Levels, radius_px: float) -> Levels:
    """Return the levels blurred by a disc, a defocused lens's image of a point."""
    kernel = disc_kernel(radius_px)
    return np.asarray(cv2.filter2D(levels, -1, kernel, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)


@lru_cache(maxsize=8)
def disc_kernel(radius_px: float) -> Levels:
    """Return the (2r+1, 2r+1) shares of a centred disc in each pixel, by 32×32 samples a pixel; they sum to 1."""
    fine = 32
    half = int(np.ceil(radius_px - 0.5)) if radius_px > 0.5 else 0
    offsets = (np.arange((2 * half + 1) * fine) + 0.5) / fine - half - 0.5
    inside = offsets[:, None] ** 2 + offsets[None, :] ** 2 <= max(radius_px, 1e-3) ** 2
    shares = inside.reshape(2 * half + 1, fine, 2 * half + 1, fine).mean(axis=(1, 3))
    if shares.sum() == 0:  # a disc that falls between the samples is a point
        shares[half, half] = 1
    return np.asarray(shares / shares.sum(), dtype=np.float32)


def vignette(height: int, width: int, corner_loss: float) -> Levels:
    """Return the (height, width) share of light that passes: 1 in the middle, 1 − `corner_loss` in the corners."""
    return np.float32(1) - np.float32(corner_loss) * _falloff(height, width)


@lru_cache(maxsize=2)
def _falloff(height: int, width: int) -> Levels:
    """Return the fourth power of the (height, width) distance from the middle, 1 in the corners."""
    y, x = np.ogrid[:height, :width]
    radius2 = (x - (width - 1) / 2) ** 2 + (y - (height - 1) / 2) ** 2
    corner2 = max(((width - 1) ** 2 + (height - 1) ** 2) / 4, 1.0)
    return np.asarray((radius2 / corner2) ** 2, dtype=np.float32)


def shift_colours(levels: Levels, corner_px: float) -> Levels:
    """Return (H, W, 3) levels with red magnified and blue reduced about the middle: lateral chromatic aberration.

    Red and blue part by `corner_px` in the corners, green lies half-way between them, and the three are placed so that
    grey levels, their sum by `LUMA`, stay where they are.
    """
    height, width = levels.shape[:2]
    corner = max(np.hypot(height - 1, width - 1) / 2, 1.0)
    middle = (LUMA[2] - LUMA[0]) / 2
    shares = (middle + 0.5, middle, middle - 0.5)
    channels = [_magnified(levels[:, :, k], 1 + corner_px / corner * share) for k, share in enumerate(shares)]
    return np.stack(channels, axis=2)


def _magnified(channel: Levels, scale: float) -> Levels:
    """Return an image (H, W) magnified about its middle, by cubic convolution along each axis."""
    for axis in (0, 1):
        length = channel.shape[axis]
        middle = (length - 1) / 2
        index, weights = _cubic_taps(middle + (np.arange(length) - middle) / scale, length)
        shape = (-1, 1) if axis == 0 else (1, -1)
        parts = [np.take(channel, i, axis=axis) * w.reshape(shape) for i, w in zip(index, weights, strict=True)]
        channel = np.asarray(sum(parts), dtype=np.float32)
    return channel


def _cubic_taps(at: NDArray[np.float64], length: int) -> tuple[NDArray[np.int64], Levels]:
    """Return (4, n) indices and weights that interpolate at (n,) positions (Keys 1981, a = −½), clamped at the ends."""
    first = np.floor(at).astype(np.int64)
    t = at - first
    weights = [
        ((-0.5 * t + 1) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1,
        ((-1.5 * t + 2) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    ]
    index = np.clip(first + np.arange(-1, 3)[:, None], 0, length - 1)
    return index, np.asarray(weights, dtype=np.float32)
