"""Kernel: the summed-area tables of textures, in one pass over the texels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.kernel import kernel


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
    add_texels(pixels.reshape(*pixels.shape[:2], -1), out)


@kernel
def add_texels(pixels, out):
    """Write the sums of (h, w, channels) pixels to (channels, h + 3, w + 3); see `write_sums`."""
    height, width, channels = pixels.shape
    out[:, 0] = 0.0
    for channel in range(channels):
        for y in range(height + 2):
            row, total = min(max(y - 1, 0), height - 1), 0
            out[channel, y + 1, 0] = 0.0
            for x in range(width + 2):
                total += pixels[row, min(max(x - 1, 0), width - 1), channel]
                out[channel, y + 1, x + 1] = out[channel, y, x + 1] + total
