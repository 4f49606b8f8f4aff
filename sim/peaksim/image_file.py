"""Reading images and films from outside: any of them may be hostile, so size and format are checked before decoding.

Images come upright, as `cv2.imread` and viewers show them: the rotation that a camera notes in EXIF is applied, unless
the sensor's own pixels are asked for.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from peaksim.errors import ImageError

MAX_PIXELS = 200_000_000
"""Larger images are refused before they are decoded: 200 megapixels."""

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM", "WEBP")
"""Formats that are read. Others that Pillow knows are refused: some of them run programs."""

_ORIENTATION = 0x0112  # the tag of EXIF and TIFF
_BITS, _PHOTOMETRIC, _SAMPLE_FORMAT = 0x0102, 0x0106, 0x0153  # of TIFF
_WHITE_IS_ZERO, _SIGNED = 0, 2  # their values


def read_image(
    source: str | Path | BinaryIO,
    name: str | None = None,
    *,
    is_upright: bool = True,
    largest: int = MAX_PIXELS,
    unit: str = "pixels",
) -> NDArray[Any]:
    """Return an image file as (H, W) or (H, W, 3) RGB uint8, or uint16 where it has 16 bits.

    `source` is a path or an open file; errors call it `name`, by default the path. Palettes are resolved, transparency
    is dropped, and only the first of several images is read. Floating point in 0…1 (TIFF) is multiplied by 255 and
    rounded. `is_upright` applies the file's EXIF orientation; without it the pixels are as the sensor read them out.
    More than `largest` pixels (called `unit` in the message) are refused.

    Raises
    ------
    ImageError
        One line that names the file: it is missing, not an image, damaged, truncated, too large, or its grey levels
        have no known range (integers of 32 bits, floating point outside 0…1).
    """
    with _one_line(name or source, largest, unit), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of metadata, and of sizes: our own limit is the lower one
        # a path would be mapped into memory, where Pillow (13.0) takes a rotated TIFF's width for its height
        with _opened(source) as file, Image.open(file, formats=FORMATS) as image:
            return _checked_array(image, is_upright, largest, unit)


def check_is_image(path: Path) -> None:
    """Refuse a file that is no image of a format that is read, before anything is decoded.

    Raises
    ------
    ImageError
        As `read_image`.
    """
    with _one_line(path, MAX_PIXELS, "pixels"), path.open("rb") as file, Image.open(file, formats=FORMATS):
        pass


def from_pillow(image: Any, name: str, largest: int = MAX_PIXELS, unit: str = "texels") -> NDArray[Any]:
    """Return an image that another library has opened with Pillow, as `read_image`; it need not be decoded yet.

    Raises
    ------
    ImageError
        As `read_image`; the message starts with `name`.
    """
    with _one_line(name, largest, unit), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if image.format not in (None, *FORMATS):
            raise ImageError(f"expected an image ({', '.join(FORMATS)}), got {image.format}")
        return _checked_array(image, True, largest, unit)


def _checked_array(image: Any, is_upright: bool, largest: int, unit: str) -> NDArray[Any]:
    width, height = image.size
    if width * height > largest:
        raise ImageError(f"expected at most {largest} {unit}, got {width}×{height}")
    return _as_array(image, is_upright)


@contextmanager
def _one_line(path: str | Path | BinaryIO, largest: int, unit: str) -> Iterator[None]:
    """Turn whatever Pillow raises into one line that names the file."""
    try:
        yield
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error
    except UnidentifiedImageError as error:
        expected = f"expected an image ({', '.join(FORMATS)}; in TIFF of 8 or 16 bits, or grey of 32-bit floats)"
        raise ImageError(f"{path}: {expected}, found none") from error
    except Image.DecompressionBombError as error:
        raise ImageError(f"{path}: expected at most {largest} {unit}: {error}") from error
    except (OSError, ValueError, SyntaxError, EOFError, TypeError, KeyError, IndexError, ArithmeticError) as error:
        reason = getattr(error, "strerror", None) or f"damaged: {error}"  # Pillow raises any of these on odd bytes
        raise ImageError(f"{path}: cannot be read: {reason}") from error


def to_8_bits(levels: NDArray[Any]) -> NDArray[np.uint8]:
    """Return grey levels of 16 bits divided by 257 and rounded; those of 8 bits as they are."""
    if levels.dtype == np.uint8:
        return levels
    return ((levels.astype(np.uint32) + 128) // 257).astype(np.uint8)


def read_image_8_bits(source: str | Path | BinaryIO, name: str | None = None) -> NDArray[np.uint8]:
    """Return `read_image` with 16 bits scaled to 8."""
    return to_8_bits(read_image(source, name))


@contextmanager
def _opened(source: str | Path | BinaryIO) -> Iterator[BinaryIO]:
    if isinstance(source, str | Path):
        with Path(source).open("rb") as file:
            yield file
    else:
        yield source


def _as_array(image: Any, is_upright: bool) -> NDArray[Any]:
    """Return a Pillow image as grey (8 or 16 bits) or RGB."""
    deep = _deep_content(image)
    before = _orientation(image)
    levels = _levels(image) if deep is None else _deep_colors(image, deep)
    is_turned = before != 1 and _orientation(image) == 1  # Pillow turns TIFF itself
    if is_upright and not is_turned:
        levels = _turned(levels, before)
    elif is_turned and not is_upright:
        levels = _turned(levels, {6: 8, 8: 6}.get(before, before))
    return np.ascontiguousarray(levels)


def _orientation(image: Any) -> int:
    """Return EXIF's orientation 1…8; 1 where the metadata cannot be read."""
    try:
        return int(image.getexif().get(_ORIENTATION, 1))
    except Exception:  # odd metadata raises anything, and does not spoil the pixels
        return 1


def _turned(levels: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Return a sensor's pixels upright, by EXIF's orientation (CIPA DC-008); an unknown one changes nothing."""
    turned = levels.swapaxes(0, 1) if orientation in (5, 6, 7, 8) else levels
    turned = turned[:, ::-1] if orientation in (2, 3, 6, 7) else turned
    return turned[::-1] if orientation in (3, 4, 7, 8) else turned


def _levels(image: Any) -> NDArray[Any]:
    """Return a Pillow image's grey levels or colours, rotated as Pillow decodes them."""
    tags = image.tag_v2 if image.format == "TIFF" else {}
    if image.mode == "I" and max(tags.get(_BITS, (8,))) > 16:
        raise ImageError("expected grey levels of 8 or 16 bits, or floating point in 0…1, got integers of 32 bits")
    if _SIGNED in tags.get(_SAMPLE_FORMAT, ()):
        raise ImageError("expected grey levels of 8 or 16 bits, or floating point in 0…1, got signed integers")
    if image.mode == "F":
        return _from_floats(np.asarray(image))
    if image.mode in ("I;16", "I;16L", "I;16B", "I;16N", "I"):
        levels = np.asarray(image).astype(np.int64)
        if levels.min() < 0 or levels.max() > 65535:
            raise ImageError(f"expected grey levels of 16 bits, got {levels.min()}…{levels.max()}")
        # Pillow (13.0) turns white-is-zero round for 8 bits only
        return (65535 - levels if tags.get(_PHOTOMETRIC) == _WHITE_IS_ZERO else levels).astype(np.uint16)
    return np.asarray(image.convert("L" if image.mode in ("1", "L", "LA") else "RGB"))


def _from_floats(levels: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    lowest, highest = levels.min(), levels.max()
    if not (lowest >= 0 and highest <= 1):  # nan too
        raise ImageError(f"expected floating-point grey levels in 0…1, got {lowest:g}…{highest:g}")
    return np.asarray(np.rint(levels * np.float32(255)), dtype=np.uint8)


def _deep_content(image: Any) -> bytes | None:
    """Return the bytes of a file with colours of 16 bits, which Pillow cuts to 8; None for others."""
    if image.mode not in ("RGB", "RGBA", "LA") or not any(";16" in str(tile[3]) for tile in image.tile):
        return None
    start = image.fp.tell()
    image.fp.seek(0)
    content: bytes = image.fp.read()
    image.fp.seek(start)
    return content


def _deep_colors(image: Any, content: bytes) -> NDArray[Any]:
    """Return colours of 16 bits from OpenCV, and grey levels where they are grey; Pillow has found the file whole."""
    pillow = _levels(image)
    deep = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if deep is None or deep.dtype != np.uint16 or deep.ndim != 3:
        return pillow
    return np.asarray(deep[:, :, 0] if image.mode == "LA" else deep[:, :, 2::-1])
