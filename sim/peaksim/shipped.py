"""Where scenes and assets are: beside the sources, or inside the installed package."""

from pathlib import Path

from peaksim.errors import SceneError

_PACKAGE = Path(__file__).resolve().parent
_INSTALLED = _PACKAGE / "data"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent.parent

SCENES = _ROOT / "scenes"
ASSETS = _ROOT / "assets"


def file_inside(root: Path, relative: str, name: str) -> Path:
    """Return `root / relative`, refusing a path that leaves `root` or is not a file.

    Raises
    ------
    SceneError
        The message starts with `name`, the field.
    """
    path = (root / relative).resolve()
    if not path.is_relative_to(root.resolve()):
        raise SceneError(f"{name}: expected a path inside {root.name}/, got {relative!r}")
    if not path.is_file():
        raise SceneError(f"{name}: expected a file, {relative!r} is not in {root.name}/")
    return path
