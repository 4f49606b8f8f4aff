"""Photographs that sheets are warped into: those of a folder, or the ones that scikit-image ships."""

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from peaksim.errors import SceneError

_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")
_SCIKIT_IMAGE = (
    *("astronaut.png", "brick.png", "camera.png", "chelsea.png", "coffee.png", "coins.png", "grass.png", "gravel.png"),
    *("motorcycle_left.png", "motorcycle_right.png", "rocket.jpg"),
)
"""Of its files those that show something to hang a sheet before; no microscopes, no drawings."""


def photographs(folder: Path, given: str | None) -> dict[str, Path]:
    """Return the photographs by their names, sorted.

    Parameters
    ----------
    folder
        Of the specification.
    given
        A folder, relative to it or absolute; its images count, not those of folders in it. None: scikit-image's.

    Raises
    ------
    SceneError
        If there is no image there, or scikit-image is needed and missing.
    """
    place = _scikit_image() if given is None else folder / given
    wanted = (place / name for name in _SCIKIT_IMAGE) if given is None else _images(place)
    files = {file.name: file for file in wanted if file.is_file()}
    if not files:
        raise SceneError(f"warped.photographs: expected a folder with images ({', '.join(_SUFFIXES)}), got {place}")
    return files


def _images(place: Path) -> Iterator[Path]:
    if place.is_dir():
        yield from sorted(file for file in place.iterdir() if file.suffix.lower() in _SUFFIXES)


def _scikit_image() -> Path:
    found = find_spec("skimage")
    if found is None or found.origin is None:
        raise SceneError(
            "warped.photographs: expected a folder (--photographs), or scikit-image, whose photographs are the "
            "default: pip install scikit-image"
        )
    return Path(found.origin).parent / "data"
