"""Reading images: every kind we take, bit for bit, and hostile ones as one line."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from peaksim.errors import ImageError
from peaksim.image_file import read_image, read_image_8_bits
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


def save_oriented(path: Path, orientation: int) -> None:
    """Write RGB enlarged, with EXIF's orientation, in the format of the path's ending."""
    image = Image.fromarray(RGB.repeat(8, axis=0).repeat(8, axis=1))
    exif = Image.Exif()
    exif[0x0112] = orientation
    if path.suffix == ".tif":
        image.save(path, tiffinfo={0x0112: orientation})
    else:
        image.save(path, exif=exif, quality=95)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("ending", ["jpg", "png", "tif"])
def test_images_come_upright_as_opencv_reads_them(tmp_path: Path, ending: str, orientation: int) -> None:
    save_oriented(tmp_path / f"p.{ending}", orientation)
    upright = read_image(tmp_path / f"p.{ending}")
    content = np.fromfile(tmp_path / f"p.{ending}", dtype=np.uint8)  # OpenCV 4.14's imread cannot turn a TIFF by 90°
    assert np.array_equal(upright, cv2.imdecode(content, cv2.IMREAD_COLOR)[:, :, ::-1])
    assert upright.shape[:2] == ((64, 48) if orientation > 4 else (48, 64))
    save_oriented(tmp_path / f"stored.{ending}", 1)
    stored = read_image(tmp_path / f"p.{ending}", is_upright=False)
    assert np.array_equal(stored, read_image(tmp_path / f"stored.{ending}"))


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize("kind", ["grey", "rgb"])
def test_sixteen_bits_are_rotated_too(tmp_path: Path, kind: str, orientation: int) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (5, 7, 3), dtype=np.uint16)
    levels = deep[:, :, 0] if kind == "grey" else deep
    tifffile.imwrite(tmp_path / "p.tif", levels, extratags=[(0x0112, 3, 1, orientation, True)])
    quarters = {1: 0, 3: 2, 6: -1, 8: 1}[orientation]
    assert np.array_equal(read_image(tmp_path / "p.tif"), np.rot90(levels, quarters))
    assert np.array_equal(read_image(tmp_path / "p.tif", is_upright=False), levels)


@pytest.mark.parametrize("ending", ["png", "tif"])
def test_colours_keep_their_sixteen_bits(tmp_path: Path, ending: str) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (5, 7, 3), dtype=np.uint16)
    assert cv2.imwrite(str(tmp_path / f"p.{ending}"), deep[:, :, ::-1])
    got = read_image(tmp_path / f"p.{ending}")
    assert got.dtype == np.uint16
    assert np.array_equal(got, deep)
    assert np.array_equal(read_image_8_bits(tmp_path / f"p.{ending}"), np.floor(deep / 257 + 0.5))


def test_floating_point_is_scaled(tmp_path: Path) -> None:
    Image.fromarray(GRAY.astype(np.float32) / np.float32(255)).save(tmp_path / "p.tif")
    assert np.array_equal(read_image(tmp_path / "p.tif"), GRAY)


@pytest.mark.parametrize(
    ("levels", "message"),
    [
        (GRAY.astype(np.float32), "expected floating-point grey levels in 0…1, got 0…235"),
        (np.where(GRAY > 9, np.float32(np.nan), np.float32(0)), "expected floating-point grey levels in 0…1, got nan"),
        (GRAY.astype(np.int32), "expected grey levels of 8 or 16 bits, or floating point in 0…1, got integers of 32"),
        (GRAY.astype(np.int32) * 999, "got integers of 32 bits"),
    ],
)
def test_levels_of_no_known_range_are_refused_with_the_files_name(
    tmp_path: Path, levels: np.ndarray, message: str
) -> None:
    Image.fromarray(levels).save(tmp_path / "p.tif")
    with pytest.raises(ImageError) as caught:
        read_image(tmp_path / "p.tif")
    assert str(caught.value).startswith(f"{tmp_path / 'p.tif'}: ")
    assert message in str(caught.value)


def test_odd_metadata_does_not_spoil_the_pixels(tmp_path: Path) -> None:
    Image.fromarray(RGB).save(tmp_path / "p.png", exif=b"Exif\0\0II*\0\xff\xff\xff\xff" + b"\xff" * 40)
    assert np.array_equal(read_image(tmp_path / "p.png"), RGB)


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32])
def test_signed_integers_are_refused_rather_than_read_as_black(tmp_path: Path, dtype: type) -> None:
    tifffile.imwrite(tmp_path / "p.tif", (GRAY // 2).astype(dtype))
    with pytest.raises(ImageError, match=r"p\.tif: expected grey levels of 8 or 16 bits, .* got (signed )?integers"):
        read_image(tmp_path / "p.tif")


@pytest.mark.parametrize("factor", [1, 257])
def test_white_may_be_zero(tmp_path: Path, factor: int) -> None:
    levels = GRAY if factor == 1 else GRAY.astype(np.uint16) * np.uint16(factor)
    tifffile.imwrite(tmp_path / "p.tif", levels, photometric="miniswhite")
    assert np.array_equal(read_image(tmp_path / "p.tif"), 255 * factor - levels.astype(int))


@pytest.mark.parametrize("image", [GRAY / 255, np.dstack([GRAY / np.float32(255)] * 3)], ids=["double", "RGB floats"])
def test_tiffs_of_other_kinds_are_told_what_is_read(tmp_path: Path, image: np.ndarray) -> None:
    tifffile.imwrite(tmp_path / "p.tif", image, photometric="rgb" if image.ndim == 3 else "minisblack")
    with pytest.raises(ImageError, match=r"p\.tif: expected an image \(.* in TIFF of 8 or 16 bits, or grey of 32-bit"):
        read_image(tmp_path / "p.tif")


def test_levels_of_ten_bits_are_scaled_to_sixteen(tmp_path: Path) -> None:
    levels = GRAY.astype(int) * 4
    (tmp_path / "p.pgm").write_bytes(b"P5 8 6 1023\n" + levels.astype(">u2").tobytes())
    assert np.abs(read_image(tmp_path / "p.pgm") - levels * 65535 / 1023).max() <= 0.5001
