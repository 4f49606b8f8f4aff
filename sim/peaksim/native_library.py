"""Finding, checking and opening the shared library of kernels; standard library only, as the build uses it too."""

import ctypes
import hashlib
import json
import os
import platform
import sys
from pathlib import Path

from peaksim.errors import NativeError

_PACKAGE = Path(__file__).resolve().parent
_SOURCES = _PACKAGE.parent.parent / "native"
"""Where the sources are in a checkout; an installed package has none."""

_REBUILD = "run `python tools/build_native.py` in the checkout"
_REINSTALL = "reinstall peakmark, with `pip install --force-reinstall --no-binary peakmark peakmark` to compile it here"


def system_name() -> str:
    """Return what a library is built for: linux-x86_64, linux-aarch64, macos-arm64, windows-x86_64 …."""
    system = {"darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
    machine = {"AMD64": "x86_64"}.get(platform.machine(), platform.machine())
    return f"{system}-{machine}"


def sources_hash(folder: Path) -> str:
    """Return the SHA-256 of names and contents of the C files of a folder, in hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted([*folder.glob("*.c"), *folder.glob("*.h")]):
        digest.update(f"{path.name}\0{path.stat().st_size}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def library_folder() -> Path:
    """Return where the library is: inside the package, or where the environment variable PEAKSIM_NATIVE says."""
    return Path(os.environ.get("PEAKSIM_NATIVE") or _PACKAGE / "_native")


def open_library(folder: Path, sources: Path = _SOURCES) -> ctypes.CDLL:
    """Load the library of a folder, in the build for this processor.

    `build.json` beside it says what it was built for and from: {"system", "sources", "files": {name: SHA-256}}, the
    files from the plainest to the one with most instructions. `sources` are compared only where they exist.

    Raises
    ------
    NativeError
        If there is none, it is damaged, for another system or processor, or not of the sources as they are now.
    """
    what_to_do = _REBUILD if sources.is_dir() else _REINSTALL
    try:
        build = json.loads((folder / "build.json").read_text(encoding="utf-8"))
        system, built_from, files = build["system"], build["sources"], dict(build["files"])
        whole = all(hashlib.sha256((folder / name).read_bytes()).hexdigest() == seal for name, seal in files.items())
    except OSError as error:
        raise NativeError(f"{folder}: expected the library of kernels, found none: {what_to_do}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise NativeError(f"{folder / 'build.json'}: damaged: {what_to_do}") from error
    if not whole or not files:
        raise NativeError(f"{folder}: the library of kernels is damaged: {what_to_do}")
    if system != system_name():
        raise NativeError(f"{folder}: expected a library for {system_name()}, got one for {system}: {what_to_do}")
    if sources.is_dir() and built_from != sources_hash(sources):
        raise NativeError(f"{folder}: the library is not of the sources in {sources.name}/: {what_to_do}")
    return _for_this_cpu([folder / name for name in files], what_to_do)


def _for_this_cpu(paths: list[Path], what_to_do: str) -> ctypes.CDLL:
    try:
        plain = ctypes.CDLL(str(paths[0]))
        level = plain.cpu_level()
        if level < 1:
            raise NativeError(
                "expected a processor with SSE 4.2 and POPCNT (x86-64-v2), which all have since about 2009"
            )
        return plain if level == 1 or len(paths) == 1 else ctypes.CDLL(str(paths[1]))
    except (OSError, AttributeError) as error:
        reason = " ".join(str(error).split())
        raise NativeError(f"{paths[0]}: cannot be loaded ({reason}): {what_to_do}") from error
