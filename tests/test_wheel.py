"""A wheel in an empty environment, away from the checkout: the core alone, then with an extra missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.places import ROOT
from tests.refine_golden import drawn_views

JOBS = """
import sys, numpy as np, peakmark
from peaksim import Camera, Quad, Scene, Texture, render
from peakmark import surf
gray = np.load(sys.argv[1])
print(len(peakmark.identify(gray)), len(surf.detect_and_describe(gray)) > 100)
quad = Quad("wall", Texture.from_array(np.full((4, 4), 200, np.uint8)), (2.0, 2.0), np.eye(4))
pose = np.diag([1.0, -1, -1, 1])
pose[2, 3] = 2
frame = render(Scene((quad,)), Camera(64, 48, 60.0, 60.0, 31.5, 23.5), pose, renderer="exact")
print(int(np.asarray(frame.image)[24, 32].max()))
print("numba" in sys.modules, peakmark.__file__)
"""


@pytest.fixture(scope="module")
def bin_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the programs of a new environment that holds the wheel and what it depends on."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = ["-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([sys.executable, *pip, "wheel", "--no-deps", "--wheel-dir", folder, ROOT], check=True, timeout=600)
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True, timeout=600)
    (wheel,) = folder.glob("peakmark-*-py3-none-*.whl")
    assert wheel.stat().st_size < 2e6
    python = folder / "venv" / "bin" / "python"
    subprocess.run([python, *pip, "install", wheel], check=True, timeout=1200)
    return python.parent


def run(folder: Path, *command: object) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PEAKSIM_NATIVE")}
    words = [str(word) for word in command]
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=600)


@pytest.mark.slow
def test_a_wheel_in_an_empty_environment_does_the_core_jobs(bin_folder: Path, tmp_path: Path) -> None:
    gray = np.pad(drawn_views().image, 40, mode="edge")
    np.save(tmp_path / "gray.npy", gray)
    Image.fromarray(gray).save(tmp_path / "image.png")
    done = run(tmp_path, bin_folder / "python", "-c", JOBS, "gray.npy")
    assert done.returncode == 0, done.stderr
    markers, has_key_points, level, has_numba, where = done.stdout.split()
    assert int(markers) >= 10
    assert (has_key_points, has_numba) == ("True", "False")
    assert int(level) == 200
    assert str(ROOT) not in where
    identified = run(tmp_path, bin_folder / "peakmark", "identify", "image.png", "--out", "found.csv")
    assert identified.returncode == 0, identified.stderr
    assert len((tmp_path / "found.csv").read_text().splitlines()) > 10
    sheet = run(tmp_path, bin_folder / "peakmark", "marker", "surf", "--format", "pdf", "--out", "sheet")
    assert sheet.returncode == 0, sheet.stderr


@pytest.mark.slow
def test_its_types_are_read_by_mypy_and_pyright(bin_folder: Path, tmp_path: Path) -> None:
    """`py.typed` is in the wheel: without it, both would take everything of the installed packages for unknown."""
    shutil.copy(ROOT / "tests" / "public_types.py", tmp_path / "use.py")
    python = bin_folder / "python"
    mypy = [sys.executable, "-m", "mypy", "--strict", "--python-executable", python, "--config-file", os.devnull]
    cache = ["--cache-dir", tmp_path / "cache", "--ignore-missing-imports"]
    said = run(tmp_path, *mypy, *cache, "use.py")
    assert said.returncode == 0, said.stdout
    pytest.importorskip("basedpyright")  # pyright's engine with the node that it runs on, both in wheels
    said = run(tmp_path, sys.executable, "-m", "basedpyright", "--level", "error", "--pythonpath", python, "use.py")
    assert said.returncode == 0, said.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "library"),
    [
        ("render floor --frames 1 --renderer gl", "pyrender"),
        ("floor", "matplotlib"),
        (f"corpus make {ROOT / 'scenes/experiments/corpus_small.toml'} --frames 2", "pyarrow"),
    ],
)
def test_what_needs_an_extra_says_which(bin_folder: Path, tmp_path: Path, command: str, library: str) -> None:
    done = run(tmp_path, bin_folder / "peakmark", *command.split(), "--out", "out")
    assert (done.returncode, done.stderr) == (2, f"error: this needs {library}: pip install 'peakmark[sim]'\n")
