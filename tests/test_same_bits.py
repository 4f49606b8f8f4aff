"""Every build of the kernels gives the same bytes: of gcc and zig, with wide registers and without, on any threads."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from peaksim.native_library import library_folder

from tests.places import ROOT, SOURCES

KNOWN = {
    "elementary": "46ca43aa5d4324293b7598187c680568ab0b33c055391b306b633bcb7274dde4",
    "surf": "84ed166074b83bee8943bff5c472c605121a7fcff0cecc217684eb4ca3f36be0",
}
"""Of every processor: what goes into these kernels passes no function that NumPy picks by processor."""


def hashes_with(folder: Path, name: str, threads: int = 2) -> dict[str, str]:
    """Return the hashes that one library of a folder gives, in a process of its own."""
    build = json.loads((folder / "build.json").read_text())
    (folder / "build.json").write_text(json.dumps({**build, "files": {name: build["files"][name]}}))
    environment = {**os.environ, "PEAKSIM_NATIVE": str(folder), "PYTHONPATH": os.pathsep.join([SOURCES, str(ROOT)])}
    environment["PEAKMARK_THREADS"] = str(threads)
    command = [sys.executable, "-m", "tests.same_bits"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True, timeout=600)
    (folder / "build.json").write_text(json.dumps(build))
    return dict(line.split() for line in done.stdout.splitlines())


@pytest.mark.slow
def test_every_build_and_number_of_threads_gives_the_same_bytes(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(library_folder(), tmp_path / "system"))
    names = sorted(json.loads((folder / "build.json").read_text())["files"])
    expected = hashes_with(folder, names[0], threads=1)
    assert len(expected) == 5
    assert expected.items() >= KNOWN.items()
    for name in names:
        assert hashes_with(folder, name) == expected


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs zig from pip")
def test_another_compiler_gives_the_same_bytes(tmp_path: Path) -> None:
    command = [sys.executable, "tools/build_native.py", "--zig", "--out", str(tmp_path / "zig")]
    subprocess.run(command, cwd=ROOT, check=True, timeout=600)
    names = sorted(json.loads((tmp_path / "zig" / "build.json").read_text())["files"])
    system = Path(shutil.copytree(library_folder(), tmp_path / "system"))
    expected = hashes_with(system, sorted(json.loads((system / "build.json").read_text())["files"])[0])
    for name in names:
        assert hashes_with(tmp_path / "zig", name) == expected
