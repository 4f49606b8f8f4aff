"""Any image as the 8-bit grey image that the detectors work on; bad input is refused here."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.image_file import to_8_bits

from peakmark.errors import InputError


def as_gray(image: ArrayLike) -> NDArray[np.uint8]:
    """Return an image as contiguous 8-bit grey levels.

    Parameters
    ----------
    image : (H, W) grey, (H, W, 1) grey, (H, W, 3) RGB or (H, W, 4) RGBA array of any strides, H and W at least 1:
        uint8; uint16, divided by 257 and rounded; or floating point in 0…1, multiplied by 255 and rounded (ties to
        even). RGB (not BGR) becomes grey as OpenCV does it, 0.299 R + 0.587 G + 0.114 B; alpha is ignored.

    Raises
    ------
    InputError
        If the shape is not an image's, the dtype is another, or a floating-point value is not in 0…1.
    """
    pixels = np.asarray(image)
    if pixels.ndim not in (2, 3) or 0 in pixels.shape or (pixels.ndim == 3 and pixels.shape[2] not in (1, 3, 4)):
        expected = "shape (H, W), (H, W, 1), (H, W, 3) or (H, W, 4), H and W at least 1"
        raise InputError(f"image: expected {expected}, got {pixels.shape}")
    levels = _as_uint8(pixels)
    if levels.ndim == 3:
        levels = levels[:, :, 0] if levels.shape[2] == 1 else _rgb_to_gray(levels[:, :, :3])
    return np.ascontiguousarray(levels)


def _as_uint8(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Scale to 8 bits by the dtype's stated range."""
    if pixels.dtype == np.uint8:
        return pixels
    if pixels.dtype == np.uint16:
        return to_8_bits(pixels)
    if not np.issubdtype(pixels.dtype, np.floating):
        raise InputError(f"image: expected dtype uint8, uint16 or floating point, got {pixels.dtype}")
    lowest, highest = pixels.min(), pixels.max()
    if not (lowest >= 0 and highest <= 1):
        raise InputError(f"image: expected floating-point values in 0…1, got {lowest}…{highest}")
    return np.rint(pixels * np.float32(255)).astype(np.uint8)


def _rgb_to_gray(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(levels), cv2.COLOR_RGB2GRAY), dtype=np.uint8)
