"""What is said where Mitsuba or LLVM is missing; each in a process of its own, which may crash in a child."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from peaksim.traced.library import llvm_library

from tests.peaksim.traced.helpers import needs_tracing
from tests.places import ROOT

_TRY = """
import numpy as np
from peaksim import Camera, Scene, render
from peaksim.errors import InputError
try:
    render(Scene(), Camera(4, 4), np.eye(4), "traced", samples=1)
except InputError as error:
    print(error)
"""


def said(**environment: str) -> str:
    """Return what a process prints that traces an image."""
    path = f"{environment.pop('first', '')}:{ROOT / 'src'}:{ROOT / 'sim'}"
    env = {**os.environ, "PYTHONPATH": path, **environment}
    return subprocess.run([sys.executable, "-c", _TRY], env=env, capture_output=True, text=True, check=True).stdout


def test_without_mitsuba_it_is_said_how_to_install_it(tmp_path: Path) -> None:
    (tmp_path / "mitsuba.py").write_text("raise ModuleNotFoundError(\"No module named 'mitsuba'\")")
    assert said(first=str(tmp_path)) == "renderer: \"traced\" needs Mitsuba 3: pip install 'peakmark[traced]'\n"


def test_mitsuba_that_does_not_load_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "mitsuba.py").write_text("raise ImportError('libatomic.so.1: cannot open\\nsecond line')")
    expected = "needs Mitsuba 3, which does not load (libatomic.so.1: cannot open); Debian: apt-get install libatomic1"
    assert said(first=str(tmp_path)) == f'renderer: "traced" {expected}\n'


@needs_tracing
def test_an_llvm_that_fails_is_told_in_one_line(tmp_path: Path) -> None:
    broken = tmp_path / "libLLVM-19.so"
    broken.write_bytes(b"not a library")
    expected = f"needs LLVM 17 or newer, DRJIT_LIBLLVM_PATH={broken} is none; Debian: apt-get install libllvm19"
    assert said(DRJIT_LIBLLVM_PATH=str(broken)) == f'renderer: "traced" {expected}\n'


@needs_tracing
def test_an_llvm_that_would_abort_the_process_is_found_out_before() -> None:
    old = [path for path in Path("/usr/lib").glob("*-linux-gnu/libLLVM-1[56].so*") if path.is_file()]
    if not old:
        pytest.skip("no LLVM 15 or 16 here")
    assert "needs LLVM 17 or newer" in said(DRJIT_LIBLLVM_PATH=str(old[0]))


@needs_tracing
def test_the_library_that_works_is_named() -> None:
    assert Path(llvm_library() or "").exists()


@needs_tracing
def test_the_variant_that_was_set_before_is_set_again() -> None:
    check = """
import mitsuba, numpy as np
from peaksim import Camera, Scene, render
mitsuba.set_variant("scalar_rgb")
render(Scene(), Camera(4, 4), np.eye(4), "traced", samples=1)
print(mitsuba.variant())
"""
    env = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'sim'}"}
    done = subprocess.run([sys.executable, "-c", check], env=env, capture_output=True, text=True, check=True)
    assert done.stdout == "scalar_rgb\n"
