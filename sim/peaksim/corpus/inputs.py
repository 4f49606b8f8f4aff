"""The files that a corpus is made from: where they are, and whether their bytes are those that corpus.json lists.

A worker may run on another machine, and a file may change while a run lasts; every frame, shard and part is compared
before it counts as made.
"""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path

from peaksim import shipped
from peaksim.corpus.photographs import photographs
from peaksim.corpus.plan import open_sequence, read_scene
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.spec_views import FlightView
from peaksim.errors import InputError, SceneError
from peaksim.scene.file import find_scene_beside
from peaksim.scene.schema import EnvironmentTable

Signature = tuple[int, int, int, int]
"""What changes when a file is written: inode, size, times of its content and of its entry, ns."""


def input_files(spec: CorpusSpec, folder: Path, kinds: tuple[str, ...]) -> dict[str, Path]:
    """Return the scene, texture, marker and trajectory files of a specification by their names in corpus.json.

    Files beside the specification are named from its folder, shipped ones as the scenes name them.

    Raises
    ------
    SceneError
        If one is missing, or lies elsewhere.
    """
    files: dict[str, Path] = {}
    for name, file in _named_files(spec, folder, kinds):
        taken = files.setdefault(name, file) != file
        if taken:  # a shipped file beside one of the specification's with the same name
            files[f"assets/{name}"] = file
    return dict(sorted(files.items()))


def _named_files(spec: CorpusSpec, folder: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
    for choice in spec.scenes:
        yield choice.file, find_scene_beside(folder, choice.file, "scenes.file")
        table, beside = read_scene(choice.file, folder)
        for texture, values in table.textures.items():
            for name in [values.file, *values.variants.values()]:
                if name is not None:
                    file = shipped.file_beside(beside, name, f"{choice.file}: textures.{texture}")
                    yield _name(file, name, folder), file
        for i, light in enumerate(table.lights):
            if isinstance(light, EnvironmentTable) and light.file is not None:
                file = shipped.file_beside(beside, light.file, f"{choice.file}: lights[{i}].file")
                yield _name(file, light.file, folder), file
    for view in spec.views:
        if isinstance(view, FlightView) and view.file is not None:
            yield view.file, shipped.file_inside(folder, view.file, "views.file")
    if spec.warped is not None:
        for name, file in photographs(folder, spec.warped.photographs).items():
            yield f"photographs/{name}", file
    for kind in kinds:
        file = shipped.ASSETS / "markers" / f"{kind}.png"
        yield f"markers/{kind}.png", file.resolve()


def _name(file: Path, name: str, folder: Path) -> str:
    folder = folder.resolve()
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else name


def hash_file(file: Path) -> str:
    """Return a file's SHA-256.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        with file.open("rb") as content:
            return file_digest(content, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from error


def compare_inputs(
    spec: CorpusSpec, listed: dict[str, str], folder: Path | None, *, same_version: bool
) -> tuple[list[str], list[str]]:
    """Compare the input files that are here with their hashes in corpus.json.

    Parameters
    ----------
    spec, listed
        Of corpus.json.
    folder
        Where the specification's files are, None if that is not known: only shipped files are then found.
    same_version
        Whether the shipped files should be the same ones.

    Returns
    -------
    tuple
        One line for each that differs; and the names of those that cannot be compared.
    """
    only_shipped = all(re.fullmatch(r"[\w-]+", choice.file) for choice in spec.scenes)
    is_certain = folder is not None or (only_shipped and same_version)
    differing: list[str] = []
    unchecked: list[str] = []
    for name, digest in listed.items():
        found = list(_found(name, folder))
        if not any(hash_file(file) == digest for file in found):
            (differing if found and is_certain else unchecked).append(name)
    return [f"{name!r}: the input file is not the one of which the corpus was made" for name in differing], unchecked


def _found(name: str, folder: Path | None) -> Iterator[Path]:
    """Yield the files that a name in corpus.json, which may be hostile, can mean."""
    places = [(folder, name)] if folder is not None else []
    shipped_root = (shipped.ASSETS, name.removeprefix("assets/"))
    for root, relative in [*places, (shipped.SCENES, f"{name}.toml"), shipped_root]:
        with suppress(SceneError):
            yield shipped.file_inside(root, relative, name)


class Inputs:
    """The input files of a corpus on this machine, beside the hashes that corpus.json lists."""

    def __init__(self, spec: CorpusSpec, folder: Path, kinds: tuple[str, ...], listed: dict[str, str]) -> None:
        self._spec, self._folder, self._kinds = spec, folder, kinds
        self._listed = listed
        self._signatures: dict[Path, Signature] = {}

    def require_same(self) -> None:
        """Refuse files whose bytes are not those listed.

        Raises
        ------
        InputError
            One line that names the first of them.
        """
        files = input_files(self._spec, self._folder, self._kinds)
        signatures = {file: _signature(file) for file in files.values()}
        for name, file in files.items():
            if name in self._listed and hash_file(file) != self._listed[name]:
                raise InputError(
                    f"{file}: expected the bytes that the corpus was begun with, found others: "
                    f"the file has changed since, or is another one on this machine"
                )
        if changed := sorted(files.keys() ^ self._listed.keys()):
            raise InputError(f"{self._folder}: expected the input files of the corpus, not so {changed[0]!r}")
        self._signatures = signatures

    def were_touched(self) -> bool:
        """Return whether a file was written to since the last call; if so, forget what was read from them.

        Raises
        ------
        InputError
            If the bytes are now others.
        """
        if self._signatures and all(_signature(file) == was for file, was in self._signatures.items()):
            return False
        open_sequence.cache_clear()
        self.require_same()
        return True


def _signature(file: Path) -> Signature:
    try:
        status = os.stat(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from error
    return status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
