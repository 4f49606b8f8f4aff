"""Printed sheets in a photograph: lit, blurred and grainy as it is, with the exact truth of where they are."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.camera.frame import Frame
from peaksim.camera.optics import gaussian_blur
from peaksim.camera.tone import coded
from peaksim.image_file import read_image_8_bits
from peaksim.scene.material import WHITE, linear_from_srgb

Levels = NDArray[np.float32]

REFLECTANCE = 0.35
"""Share of the light that what photographs show reflects on average: their local brightness over it is their light."""
_LIGHT_SHARE = 0.08
"""Standard deviation of the blur that takes light from brightness, in widths of the image."""
_LOCAL = 0.6
"""Weight of the local light beside that of the whole image, in the logarithm: dark things are not all in the shade."""
_TINT = 0.3
"""Weight of the brightness's colour, in the logarithm: things are coloured more than light is."""
_LEAST_LIGHT, _MOST_LIGHT = 0.08, 1.15
_LEAST_BLUR_PX, _MOST_BLUR_PX = 0.1, 3.0
_PIXEL_VARIANCE = 1 / 12
"""Of a pixel's square along an axis, px²: the renderer has it in the sheets, as a camera has in its photograph."""


def into_photograph(over_black: Frame, over_white: Frame, photo: Path, rng: np.random.Generator) -> Frame:
    """Return a frame of sheets with a photograph behind them; its levels are coded as those of the photograph.

    Parameters
    ----------
    over_black, over_white
        The same sheets before backgrounds of levels 0 and 255, which tells how much of each pixel they cover.
    photo
        Image file, sRGB; it is cropped to the frame's aspect and scaled to its size.
    rng
        Source of the sheets' noise.
    """
    behind = fitted(read_image_8_bits(photo), over_black.camera.width, over_black.camera.height)
    behind = np.repeat(behind[:, :, None], 3, axis=2) if behind.ndim == 2 else behind
    grey = cv2.cvtColor(behind, cv2.COLOR_RGB2GRAY).astype(np.float32)
    linear = np.asarray(WHITE * linear_from_srgb(behind / WHITE), dtype=np.float32)
    cover = 1 - (over_white.linear - over_black.linear) / np.float32(WHITE)
    sheets = over_black.linear[:, :, None] * light_of(linear)
    blur_px = max(float(np.sqrt(max(edge_blur_px(grey) ** 2 - _PIXEL_VARIANCE, 0))), _LEAST_BLUR_PX)
    cover, sheets = gaussian_blur(cover, blur_px), gaussian_blur(sheets, blur_px)
    mixed = sheets + (1 - cover[:, :, None]) * linear
    grain = noise_sigma(grey) * rng.standard_normal(grey.shape, dtype=np.float32)
    levels = np.float32(WHITE) * coded(mixed / np.float32(WHITE), "srgb") + (cover * grain)[:, :, None]
    return replace(over_black, linear=np.asarray(levels, dtype=np.float32))


def fitted(photo: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Return the middle of a photograph in the aspect of an image, scaled to its size."""
    rows, columns = photo.shape[:2]
    scale = min(rows / height, columns / width)
    tall, wide = max(1, round(height * scale)), max(1, round(width * scale))
    top, left = (rows - tall) // 2, (columns - wide) // 2
    method = cv2.INTER_AREA if scale > 1 else cv2.INTER_CUBIC
    cropped = np.ascontiguousarray(photo[top : top + tall, left : left + wide])
    return np.asarray(cv2.resize(cropped, (width, height), interpolation=method), dtype=np.uint8)


def light_of(linear: Levels) -> Levels:
    """Return the (H, W, 3) multiplier of light that the brightness of a photograph (H, W, 3), linear, stands for."""
    local = gaussian_blur(linear, _LIGHT_SHARE * linear.shape[1]) / (WHITE * REFLECTANCE)
    whole = linear.mean(axis=(0, 1)) / (WHITE * REFLECTANCE)
    light = np.maximum(local, 1e-3) ** _LOCAL * np.maximum(whole, 1e-3) ** (1 - _LOCAL)
    grey = light.mean(axis=2, keepdims=True)
    light = grey * (light / grey) ** _TINT
    return np.asarray(np.clip(light, _LEAST_LIGHT, _MOST_LIGHT), dtype=np.float32)


def edge_blur_px(grey: Levels) -> float:
    """Return the σ by which a photograph's sharpest edges are blurred, 0.1…3 px.

    An edge blurred once more by σ₀ = 1 px loses slope by the ratio R = √(σ² + σ₀²)/σ (Zhuo and Sim 2011,
    doi:10.1016/j.patcog.2011.03.009); the median over the two per cent of steepest pixels.
    """
    slope, again = (_slope(image) for image in (grey, gaussian_blur(grey, 1.0)))
    steep = slope >= max(float(np.quantile(slope, 0.98)), 1e-3)
    if not steep.any():
        return _LEAST_BLUR_PX
    ratio = float(np.median(slope[steep] / np.maximum(again[steep], 1e-6)))
    variance = 1 / max(ratio**2 - 1, 1e-6) - _PIXEL_VARIANCE  # a difference of neighbours is a slope over a pixel
    return float(np.clip(np.sqrt(max(variance, 0.0)), _LEAST_BLUR_PX, _MOST_BLUR_PX))


def _slope(image: Levels) -> Levels:
    across, down = image[:-1, 1:] - image[:-1, :-1], image[1:, :-1] - image[:-1, :-1]
    return np.asarray(np.hypot(across, down), dtype=np.float32)


def noise_sigma(grey: Levels) -> float:
    """Return the σ of a photograph's noise, grey levels.

    Immerkær 1996 (doi:10.1006/cviu.1996.0060), with the median in place of the mean, which texture raises less.
    """
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
    return float(np.median(np.abs(cv2.filter2D(grey, -1, kernel))) / (6 * 0.6745))
