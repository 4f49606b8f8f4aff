"""Where scenes and assets are: beside the sources, or inside the installed package."""

import os
from pathlib import Path

from peaksim.errors import SceneError

_PACKAGE = Path(__file__).resolve().parent
_INSTALLED = _PACKAGE / "data"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent.parent

SCENES = _ROOT / "scenes"
ASSETS = _ROOT / "assets"


def path_inside(root: Path, relative: str, name: str) -> Path:
    """Return `root / relative`, refusing a path that leaves `root`; a file has named it, which may be hostile.

    Raises
    ------
    SceneError
        The message starts with `name`, the field.
    """
    try:
        root, path = root.resolve(), (root / relative).resolve()
    except (OSError, ValueError) as error:  # a null character
        raise SceneError(f"{name}: expected a path, got {relative!r:.80}") from error
    if not path.is_relative_to(root):
        raise SceneError(f"{name}: expected a path inside {root.name}/, got {relative!r:.80}")
    return path


def file_inside(root: Path, relative: str, name: str) -> Path:
    """Return `root / relative` as `path_inside`, refusing also what is not a file.

    Raises
    ------
    SceneError
        The message starts with `name`, the field.
    """
    path = path_inside(root, relative, name)
    if not os.path.isfile(path):  # false for a path that is too long, where Path.is_file raises
        raise SceneError(f"{name}: expected a file, {relative!r:.80} is not in {root.resolve().name}/")
    return path


def file_beside(folder: Path, relative: str, name: str) -> Path:
    """Return a file that lies in `folder`, or else among the shipped assets.

    Raises
    ------
    SceneError
        The message starts with `name`, the field.
    """
    return file_inside(folder if os.path.isfile(folder / relative) else ASSETS, relative, name)
