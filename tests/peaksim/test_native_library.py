"""A library that is missing, damaged, stale or for another machine is refused in one line that says what to do."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from peaksim.errors import NativeError
from peaksim.native_library import library_folder, open_library, sources_hash, system_name

from tests.places import ROOT

NOWHERE = Path("no such folder")


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Return a folder with a copy of the library."""
    return Path(shutil.copytree(library_folder(), tmp_path / "library"))


def change(folder: Path, **fields: object) -> None:
    path = folder / "build.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **fields}))


def test_a_copy_of_the_library_works(library: Path) -> None:
    assert open_library(library, NOWHERE).cpu_level() in (1, 2)


def test_the_library_of_a_checkout_is_of_its_sources() -> None:
    build = json.loads((library_folder() / "build.json").read_text())
    assert build["sources"] == sources_hash(ROOT / "native")
    assert build["system"] == system_name()


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:5000])


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda folder: shutil.rmtree(folder), "found none"),
        (lambda folder: (folder / "build.json").unlink(), "found none"),
        (lambda folder: (folder / "build.json").write_text("{"), "damaged"),
        (lambda folder: (folder / "build.json").write_text("[]"), "damaged"),
        (lambda folder: change(folder, files={}), "damaged"),
        (lambda folder: [truncate(path) for path in folder.glob("peaknative*")], "damaged"),
        (lambda folder: change(folder, system="windows-x86_64"), "got one for windows-x86_64"),
    ],
)
def test_what_cannot_be_used_is_told_with_what_to_do(
    damage: Callable[[Path], object], words: str, library: Path
) -> None:
    damage(library)
    with pytest.raises(NativeError, match=words) as told:
        open_library(library, NOWHERE)
    assert "reinstall peakmark" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_library_that_is_none_is_not_loaded(library: Path) -> None:
    for path in library.glob("peaknative*"):
        path.write_bytes(b"not a library")
    files = {path.name: "cf7a48ad4cc3b1b7b7f3f9f3f6f0e0b1" for path in library.glob("peaknative*")}
    change(library, files=files)
    with pytest.raises(NativeError, match="damaged"):
        open_library(library, NOWHERE)


def test_changed_sources_make_the_library_of_a_checkout_stale(library: Path, tmp_path: Path) -> None:
    sources = Path(shutil.copytree(ROOT / "native", tmp_path / "native"))
    open_library(library, sources)
    (sources / "cpu.c").write_text("/* changed */")
    with pytest.raises(NativeError, match=r"not of the sources.*tools/build_native\.py"):
        open_library(library, sources)


def test_a_command_without_kernels_ends_with_one_line(tmp_path: Path) -> None:
    code = (
        "import sys; sys.path[:0] = ['src', 'sim']\n"
        "from peakmark.cli.command import run_command\n"
        "from peakmark.identification.suppression import suppress_non_maxima\n"
        "import numpy as np\n"
        "run_command(lambda: suppress_non_maxima(np.zeros((1, 2)), np.ones(1), np.ones(1)) and None)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={"PEAKSIM_NATIVE": str(tmp_path), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: ")


@pytest.mark.parametrize("compiler", ["false", "no-such-compiler", "cc --no-such-flag", "cc '"])
def test_a_compiler_that_compiles_nothing_is_told_in_one_line(compiler: str, tmp_path: Path) -> None:
    command = [sys.executable, "tools/build_native.py", "--out", str(tmp_path / "made")]
    done = subprocess.run(
        command, cwd=ROOT, env={"CC": compiler, "PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: CC: ")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "made").exists()


def test_a_build_is_the_same_bytes_each_time(tmp_path: Path) -> None:
    for name in ("one", "two"):
        subprocess.run([sys.executable, "tools/build_native.py", "--out", tmp_path / name], cwd=ROOT, check=True)
    assert [p.read_bytes() for p in sorted((tmp_path / "one").iterdir())] == [
        p.read_bytes() for p in sorted((tmp_path / "two").iterdir())
    ]
