"""Reading images: every kind we take, bit for bit, and hostile ones as one line."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from peaksim.errors import ImageError
from peaksim.image_file import read_image
from PIL import Image

GRAY = np.arange(48, dtype=np.uint8).reshape(6, 8) * 5
RGB = np.stack([GRAY, 255 - GRAY, GRAY // 2], axis=2)


@pytest.mark.parametrize("ending", ["png", "tiff", "bmp"])
@pytest.mark.parametrize("image", [GRAY, RGB], ids=["grey", "rgb"])
def test_lossless_formats_come_back_bit_for_bit(tmp_path: Path, ending: str, image: np.ndarray) -> None:
    Image.fromarray(image).save(tmp_path / f"p.{ending}")
    assert np.array_equal(read_image(tmp_path / f"p.{ending}"), image)


@pytest.mark.parametrize("ending", ["png", "tiff"])
def test_sixteen_bits_stay_sixteen_bits(tmp_path: Path, ending: str) -> None:
    deep = GRAY.astype(np.uint16) * 257
    Image.fromarray(deep).save(tmp_path / f"p.{ending}")
    got = read_image(tmp_path / f"p.{ending}")
    assert got.dtype == np.uint16
    assert np.array_equal(got, deep)


def test_palettes_and_transparency_become_plain_rgb(tmp_path: Path) -> None:
    Image.fromarray(RGB).quantize(48).save(tmp_path / "palette.png")
    assert np.abs(read_image(tmp_path / "palette.png").astype(int) - RGB).max() <= 2
    Image.fromarray(np.dstack([RGB, GRAY])).save(tmp_path / "alpha.png")
    assert np.array_equal(read_image(tmp_path / "alpha.png"), RGB)


def bomb(width: int, height: int) -> bytes:
    """Return a PNG that claims a huge size in a few bytes."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 100)) + chunk(b"IEND", b"")
    )


def test_hostile_files_are_one_line_that_names_them(tmp_path: Path) -> None:
    whole = tmp_path / "whole.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8)).save(whole)
    cases = {
        "bomb.png": (bomb(30_000, 30_000), "expected at most"),
        "cut.png": (whole.read_bytes()[:1500], "cannot be read"),
        "empty.png": (b"", "expected an image"),
        "text.jpg": (b"I am no image", "expected an image"),
        "ps.eps": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "expected an image"),
    }
    for name, (content, message) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ImageError) as caught:
            read_image(tmp_path / name)
        assert str(caught.value).startswith(str(tmp_path / name))
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(ImageError, match="No such file"):
        read_image(tmp_path / "nowhere.png")
