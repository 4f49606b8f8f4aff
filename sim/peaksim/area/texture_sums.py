"""The summed-area tables of textures, in one pass over the texels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.native import function

_add_bytes = function("void add_bytes(const u1[height,width,channels] pixels, f8[channels,rows,columns] out)")
_add_levels = function("void add_levels(const f4[height,width,channels] pixels, f8[channels,rows,columns] out)")


def sums_shape(pixels: NDArray[Any]) -> tuple[int, int, int]:
    """Return the shape (channels, h + 3, w + 3) of the table of an (h, w) or (h, w, 3) image."""
    height, width = pixels.shape[:2]
    return pixels[0, 0].size, height + 3, width + 3


def write_sums(pixels: NDArray[Any], out: NDArray[np.float64]) -> None:
    """Write the sums of all texels above and left of each node; node (1, 1) is the top-left corner.

    One texel of clamped border lies around the image. Sums of printed levels are whole numbers, so they are exact.

    Parameters
    ----------
    pixels
        (h, w) or (h, w, channels) grey levels: uint8, or float32 where a material maps them.
    out
        (channels, h + 3, w + 3) written.
    """
    add = _add_bytes if pixels.dtype == np.uint8 else _add_levels
    add(pixels.reshape(*pixels.shape[:2], -1), out)
