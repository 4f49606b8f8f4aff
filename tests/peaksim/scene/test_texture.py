"""Textures: pixels as they came, read-only, and refused input."""

from pathlib import Path

import numpy as np
import pytest
from peaksim import Texture
from peaksim.errors import ImageError
from PIL import Image


def test_a_texture_that_is_too_large_is_refused() -> None:
    with pytest.raises(ImageError, match="expected at most 64000000 texels, got 16000×16000"):
        Texture.from_array(np.broadcast_to(np.uint8(1), (16_000, 16_000)))


@pytest.mark.parametrize("pixels", [np.zeros((3, 4)), np.zeros(5, np.uint8), np.zeros((3, 4, 2), np.uint8)])
def test_other_types_and_shapes_are_refused(pixels: np.ndarray) -> None:
    with pytest.raises(ImageError, match="texture: expected uint8 of shape"):
        Texture.from_array(pixels)


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 3)])
def test_a_texture_holds_a_copy_of_its_pixels_from_an_array_or_a_file(tmp_path: Path, shape: tuple[int, ...]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "p.png")
    for texture in (Texture.from_array(pixels), Texture.from_file(tmp_path / "p.png")):
        assert np.array_equal(texture.pixels, pixels)
        assert (texture.size, texture.channels) == ((4, 3), 1 if pixels.ndim == 2 else 3)
        assert not texture.pixels.flags.writeable


def test_a_file_that_is_missing_or_no_image_is_named(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no image")
    for name in ("nowhere.png", "text.png"):
        with pytest.raises(ImageError, match=f"{name}: (expected an image|cannot be read: No such file)"):
            Texture.from_file(tmp_path / name)


def test_sixteen_bits_and_floating_point_are_scaled_not_clipped(tmp_path: Path) -> None:
    levels = np.arange(0, 65536, 13, dtype=np.uint16)[:5040].reshape(60, 84)
    expected = np.floor(levels / 257 + 0.5)
    Image.fromarray(levels).save(tmp_path / "deep.png")
    Image.fromarray(levels).save(tmp_path / "deep.tif")
    for name in ("deep.png", "deep.tif"):
        assert np.array_equal(Texture.from_file(tmp_path / name).pixels, expected)
    Image.fromarray(levels.astype(np.float32) / np.float32(65535)).save(tmp_path / "float.tif")
    assert np.abs(Texture.from_file(tmp_path / "float.tif").pixels - levels / 257).max() < 0.5001


def test_no_format_that_runs_programs_is_opened(tmp_path: Path) -> None:
    (tmp_path / "eps.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n")
    with pytest.raises(
        ImageError, match=r"eps\.png: expected an image \(PNG, JPEG, TIFF, BMP, PPM, WEBP; .*\), found none"
    ):
        Texture.from_file(tmp_path / "eps.png")
