"""What a photograph's EXIF says of its camera: how it was held, and how long the lens is."""

from pathlib import Path

from PIL import Image

_ORIENTATION, _EXIF, _FOCAL_35_MM = 0x0112, 0x8769, 0xA405  # CIPA DC-008, 4.6


def orientation_of(path: str | Path) -> int:
    """Return EXIF's orientation 1…8; 1, upright, where a file says nothing or is no photograph."""
    value = _tag(path, _ORIENTATION)
    return value if 1 <= value <= 8 else 1


def focal_35mm_of(path: str | Path) -> float | None:
    """Return the focal length in mm that shows as much on a film frame of 36×24 mm; None where a file does not say."""
    return _tag(path, _FOCAL_35_MM) or None


def _tag(path: str | Path, tag: int) -> int:
    """Return a whole number, 0 where there is none: odd metadata raises anything, and is no reason to end."""
    try:
        with Image.open(path) as image:
            exif = image.getexif()
            return int(exif.get(tag) or exif.get_ifd(_EXIF).get(tag) or 0)
    except Exception:
        return 0
