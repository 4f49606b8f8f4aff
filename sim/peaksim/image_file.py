"""Reading image files from outside: any of them may be hostile, so size and format are checked before decoding."""

import warnings
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from peaksim.errors import ImageError

MAX_PIXELS = 200_000_000
"""Larger images are refused before they are decoded: 200 megapixels."""

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM", "WEBP")
"""Formats that are read. Others that Pillow knows are refused: some of them run programs."""


def read_image(source: str | Path | BinaryIO, name: str | None = None) -> NDArray[Any]:
    """Return an image file as (H, W) or (H, W, 3) RGB uint8, or (H, W) uint16.

    `source` is a path or an open file; errors call it `name`, by default the path. Palettes are resolved, transparency
    is dropped, and only the first of several images is read.

    Raises
    ------
    ImageError
        One line that names the file: it is missing, not an image, damaged, truncated, or larger than `MAX_PIXELS`.
    """
    path = name or source
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is the lower one
            with Image.open(source, formats=FORMATS) as image:
                width, height = image.size
                if width * height > MAX_PIXELS:
                    raise ImageError(f"{path}: expected at most {MAX_PIXELS} pixels, got {width}×{height}")
                return _as_array(image)
    except UnidentifiedImageError as error:
        raise ImageError(f"{path}: expected an image ({', '.join(FORMATS)}), found none") from error
    except Image.DecompressionBombError as error:
        raise ImageError(f"{path}: expected at most {MAX_PIXELS} pixels: {error}") from error
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        if isinstance(error, ImageError):
            raise
        reason = getattr(error, "strerror", None) or f"damaged: {error}"
        raise ImageError(f"{path}: cannot be read: {reason}") from error


def _as_array(image: Any) -> NDArray[Any]:
    """Return a Pillow image as grey (8 or 16 bits) or RGB."""
    if image.mode in ("I;16", "I;16L", "I;16B", "I;16N", "I"):
        levels = np.asarray(image).astype(np.int64)
        if levels.min() < 0 or levels.max() > 65535:
            raise ImageError(f"expected grey levels of 16 bits, got {levels.min()}…{levels.max()}")
        return levels.astype(np.uint16)
    return np.asarray(image.convert("L" if image.mode in ("1", "L", "LA") else "RGB"))
