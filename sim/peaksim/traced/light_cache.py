"""Baked light on disk, by the hash of all that it depends on, so that a scene is baked once."""

import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.area.light_map import LightMaps
from peaksim.folder_lock import lock_folder
from peaksim.scene.scene import Scene
from peaksim.traced.bake import TEXEL_M, bake_light, is_well_formed
from peaksim.whole_file import whole_file

_FORMAT = 1
"""Raised when the same scene is to be baked otherwise."""


def cached_light(scene: Scene, texel_m: float = TEXEL_M, folder: Path | None = None) -> tuple[LightMaps, bool]:
    """Return the baked light of a scene, and whether it was on disk already.

    A file that is torn or holds something else is made again; where the folder cannot be written, nothing is kept. Of
    several processes that want the light of one scene one bakes, and the others wait for it.

    Parameters
    ----------
    scene, texel_m
        As in `bake_light`.
    folder
        Where files are; None: `light_folder`.

    Raises
    ------
    SceneError
        Where Mitsuba or LLVM is missing, and light is not on disk.
    """
    path = (folder or light_folder()) / f"{light_key(scene, texel_m)}.npz"
    found = _read(path, scene)
    if found is not None:
        return found, True
    with _alone(path):
        found = _read(path, scene)
        if found is not None:
            return found, True
        maps = bake_light(scene, texel_m)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as unfinished, unfinished.open("wb") as file:
                np.savez(file, **vars(maps))
        except OSError:
            pass  # a full disk or a folder of another user: the light is there all the same
    return maps, False


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Let one process at a time make a file, others after it; where nothing can be locked, side by side."""
    folder, lock = path.with_suffix(".baking"), None
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        lock = lock_folder(folder, wait=True)
    try:
        yield
    finally:
        with suppress(OSError):
            folder.rmdir()
        if lock is not None:
            os.close(lock)


def light_folder() -> Path:
    """Return the folder of baked light: PEAKSIM_CACHE, or else `peaksim/light` in the user's folder of caches."""
    given = os.environ.get("PEAKSIM_CACHE")
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(given) if given else base / "peaksim" / "light"


def light_key(scene: Scene, texel_m: float = TEXEL_M) -> str:
    """Return the hash of geometry, materials, prints, light and tracer of a scene; names do not count."""
    digest = sha256(repr((_FORMAT, texel_m, version("mitsuba"), version("drjit"))).encode())
    for quad in scene.quads:
        _add(digest, quad.world_from_quad, quad.size_m, quad.texture.pixels, asdict(quad.material))
        if quad.bend is not None:
            _add(digest, asdict(quad.bend))
    for mesh in scene.meshes:
        _add(digest, mesh.triangles_m, mesh.color, asdict(mesh.material))
        if mesh.skin is not None:
            skin = mesh.skin
            _add(digest, *(t.pixels for t in skin.textures), skin.textured(len(mesh.faces)), skin.uv, skin.colors)
    for light in scene.lights:
        _add(digest, type(light).__name__, *vars(light).values())
    return digest.hexdigest()


def _add(digest: Any, *values: Any) -> None:
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(repr((value.shape, value.dtype.str)).encode() + np.ascontiguousarray(value).tobytes())
        else:
            digest.update(repr(value).encode())


def _read(path: Path, scene: Scene) -> LightMaps | None:
    """Return the light that a file holds; None where there is none, or not the scene's."""
    try:
        with np.load(path, allow_pickle=False) as file:
            values: dict[str, NDArray[Any]] = dict(file)
        plain = {name: float(values[name]) for name in ("texel_m", "noise", "detail")}
        maps = LightMaps(values["shapes"], values["texels"], **plain)
        return maps if is_well_formed(maps, scene) else None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
        return None
