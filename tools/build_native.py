"""Compiles `native/*.c` into the library that `peaksim.native` loads.

    python tools/build_native.py                        for this machine, into sim/peaksim/_native/
    python tools/build_native.py --target linux-aarch64 --out DIR
    python tools/build_native.py --sanitize --out DIR   with address and undefined-behaviour sanitizers

The compiler is `CC` if set; else `cc`, `gcc` or `clang` of the system; else zig's, from `pip install ziglang`. Objects
are kept in build/native/ and made again where their sources, headers or commands changed. Standard library only.
"""

import argparse
import hashlib
import importlib.util
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "sim"))

from peaksim.native_library import sources_hash, system_name  # noqa: E402

SOURCES, OBJECTS, LIBRARY = ROOT / "native", ROOT / "build" / "native", ROOT / "sim" / "peaksim" / "_native"
ZIG = "ziglang==0.14.1"
"""The compiler from pip that is used where the system has none, and for other systems."""

FLAGS = ["-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fvisibility=hidden"]
"""No contraction to fused multiply-add, which rounds otherwise: the same bytes on every processor."""

SANITIZE = [
    "-g",
    "-fno-omit-frame-pointer",
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
]
BUILDS = {"x86_64": {"": ["-msse4.2", "-mpopcnt"], "-avx2": ["-msse4.2", "-mpopcnt", "-mavx2"]}}
"""Machine → the builds for it, from the plainest on; wider registers, never fused multiply-add."""

TARGETS = {
    "linux-x86_64": ("x86_64-linux-gnu.2.17", "manylinux_2_17_x86_64.manylinux2014_x86_64"),
    "linux-aarch64": ("aarch64-linux-gnu.2.17", "manylinux_2_17_aarch64.manylinux2014_aarch64"),
    "macos-arm64": ("aarch64-macos.11.0", "macosx_11_0_arm64"),
    "windows-x86_64": ("x86_64-windows-gnu", "win_amd64"),
}
"""System that wheels are made for → zig's name of it, and the wheel's tag."""

SUFFIXES = {"macos": ".dylib", "windows": ".dll"}


class BuildError(Exception):
    """The library cannot be built; the message is one line."""


def zig_compiler() -> list[str] | None:
    """Return zig's C compiler, if it is installed for this Python."""
    return [sys.executable, "-m", "ziglang", "cc"] if importlib.util.find_spec("ziglang") else None


def system_compiler() -> list[str] | None:
    """Return `CC`, or the first C compiler of the system that makes a shared library; None if none does.

    Raises
    ------
    BuildError
        If `CC` is set and does not.
    """
    named = os.environ.get("CC", "").strip()
    try:
        candidates = [shlex.split(named)] if named else [["cc"], ["gcc"], ["clang"]]
    except ValueError as error:
        raise BuildError(f"CC: expected a command, got {named!r}: {error}") from error
    for words in candidates:
        if shutil.which(words[0]) and _compiles(words):
            return words
    if named:
        raise BuildError(
            f"CC: expected a C compiler, {named!r} compiles no C11 for {system_name()}; unset it or name another"
        )
    return None


def _compiles(compiler: list[str]) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "probe.c")
        source.write_text("#include <stdlib.h>\n#include <string.h>\nint probe(void) { return !malloc(1); }\n", "ascii")
        flags = [flag for options in builds_for(system_name()).values() for flag in options]
        command = [*compiler, *FLAGS, *flags, "-fPIC", "-shared", str(source), "-o", str(Path(folder, "probe"))]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0


def chosen_compiler(target: str, with_zig: bool) -> tuple[list[str], list[str]]:
    """Return the compiler for a target, and the flags that name the target to it."""
    compiler = system_compiler() if target == system_name() and not with_zig else None
    if compiler:
        return compiler, []
    zig = zig_compiler()
    if zig is None:
        raise BuildError(f"no C compiler found: install gcc or clang, set CC, or `pip install {ZIG}`")
    if target not in TARGETS:
        raise BuildError(f"target: expected one of {', '.join(TARGETS)}, got {target}")
    return zig, ["-target", TARGETS[target][0], "-fno-sanitize=undefined"]


def builds_for(target: str) -> dict[str, list[str]]:
    """Return the builds of a target's processor: the end of the library's name → flags."""
    return BUILDS.get(target.partition("-")[2], {"": []})


def build(folder: Path, target: str, sanitize: bool = False, with_zig: bool = False) -> None:
    """Compile the sources for a target into a folder, with the `build.json` that `peaksim.native_library` reads."""
    compiler, flags = chosen_compiler(target, with_zig)
    system = target.partition("-")[0]
    command = [*compiler, *flags, *FLAGS, *(SANITIZE if sanitize else []), *([] if system == "windows" else ["-fPIC"])]
    folder.mkdir(parents=True, exist_ok=True)
    OBJECTS.mkdir(parents=True, exist_ok=True)
    built_from, seals = sources_hash(SOURCES), {}
    for end, options in builds_for(target).items():
        name = f"peaknative{end}{SUFFIXES.get(system, '.so')}"
        _link([*command, *options], folder / name, system, sanitize)
        seals[name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    text = json.dumps({"system": target, "sources": built_from, "files": seals}, indent=1)
    _replace(folder / "build.json", lambda path: path.write_text(text + "\n", "utf-8"))


def _link(command: list[str], library: Path, system: str, sanitize: bool) -> None:
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        objects = list(threads.map(lambda source: _object(command, source), sorted(SOURCES.glob("*.c"))))
    extra = [] if sanitize or system == "macos" else ["-s"]
    _replace(library, lambda path: _run([*command, "-shared", *extra, *map(str, objects), "-o", str(path)]))


def _object(command: list[str], source: Path) -> Path:
    """Compile one source, unless the same one was compiled with the same headers by the same command."""
    parts = [shlex.join(command).encode(), source.read_bytes(), *(p.read_bytes() for p in sorted(SOURCES.glob("*.h")))]
    made = OBJECTS / f"{source.stem}-{hashlib.sha256(bytes(1).join(parts)).hexdigest()[:16]}.o"
    if not made.is_file():
        _replace(made, lambda path: _run([*command, "-c", str(source), "-o", str(path)]))
    return made


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.stderr.write(done.stderr)
        raise BuildError(f"the C compiler failed: {shlex.join(command)}")


def _replace(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file beside the path, then give it the name."""
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        made = Path(folder, path.name)
        write(made)
        os.replace(made, path)


def main() -> int:
    """Build as the command line says; 2 with one line where that is not possible."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", default=system_name(), help=f"one of {', '.join(TARGETS)}; default: this machine")
    parser.add_argument("--out", type=Path, default=LIBRARY, help="folder of the library")
    parser.add_argument("--sanitize", action="store_true", help="with address and undefined-behaviour sanitizers")
    parser.add_argument("--zig", action="store_true", help="with zig, whatever compiler the system has")
    asked = parser.parse_args()
    try:
        build(asked.out, asked.target, asked.sanitize, asked.zig)
    except BuildError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
