"""Textures: continuous pictures with exact integrals.

A texel is a sample at its centre ((i + 0.5)/n, (j + 0.5)/n); between centres the picture is bilinear, beyond the
outermost centres it is clamped. Its double antiderivative is biquadratic between the nodes of a summed-area table
(Crow 1984, doi:10.1145/800031.808600), so that the integral over any box of the plane costs four look-ups at any
scale: no mip levels, and no error from them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.errors import ImageError
from peaksim.image_file import read_image, to_8_bits

MAX_TEXELS = 64_000_000
"""Larger textures are refused: their tables (8 bytes a texel and channel) would not fit into memory beside an image."""


@dataclass(frozen=True, eq=False)
class Texture:
    """An image to print on a quad."""

    pixels: NDArray[np.uint8]
    """(h, w) grey or (h, w, 3) RGB linear grey levels, row 0 at the top; read-only."""

    @staticmethod
    def from_array(gray_or_rgb: ArrayLike) -> "Texture":
        """Return a texture of (h, w) or (h, w, 3) uint8 grey levels, row 0 at the top.

        Raises
        ------
        ImageError
            If it has another shape or type, is empty, or is larger than `MAX_TEXELS`.
        """
        pixels = np.array(gray_or_rgb, order="C")
        if pixels.dtype != np.uint8 or pixels.ndim not in (2, 3) or (pixels.ndim == 3 and pixels.shape[2] != 3):
            raise ImageError(f"texture: expected uint8 of shape (h, w) or (h, w, 3), got {pixels.dtype} {pixels.shape}")
        _check_texels(pixels.shape[1], pixels.shape[0], "texture")
        pixels.setflags(write=False)
        return Texture(pixels)

    @staticmethod
    def from_file(path: str | Path) -> "Texture":
        """Read an image file as a grey or RGB texture, as `read_image` does; 16 bits are divided by 257 and rounded.

        Raises
        ------
        ImageError
            If it is missing, is not an image, or is larger than `MAX_TEXELS`.
        """
        return Texture.from_array(to_8_bits(read_image(path, largest=MAX_TEXELS, unit="texels")))

    @property
    def channels(self) -> int:
        """1 for grey, 3 for RGB."""
        return 1 if self.pixels.ndim == 2 else 3

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.pixels.shape[1], self.pixels.shape[0]


def _check_texels(width: int, height: int, name: str) -> None:
    if width < 1 or height < 1:
        raise ImageError(f"{name}: expected at least one texel, got {width}×{height}")
    if width * height > MAX_TEXELS:
        raise ImageError(f"{name}: expected at most {MAX_TEXELS} texels, got {width}×{height}")
