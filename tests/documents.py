"""The examples of the documentation, page by page, and how they are run."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from peaksim import Camera, traced
from peaksim.geometry.pose import look_at
from typer.testing import CliRunner

from peakmark.cli.app import app
from peakmark.cli.marker import sheet_tiles
from peakmark.markers.board import board_page
from peakmark.markers.sheet import pages, paper_size
from tests.peaksim.corpus.helpers import child_environment
from tests.photographs import Paper, photograph, pose_over, save_photograph
from tests.places import ROOT

PAGES = sorted(
    page.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "docs/**/*.md", "scenes/*.md", "assets/*.md", "benchmarks/*.md")
    for page in ROOT.glob(pattern)
)

NOT_RUN = {
    "pip": "installs",
    "peakmark identify walk.mp4": "needs a film of a mapped room; tests/peakmark/cli/test_identify.py has its own",
    "make": "sets this checkout up, or runs these tests",
    "git": "fetches this checkout",
    "cd": "goes into it",
    "dask": "starts servers that never end; tests/peaksim/corpus/test_backends.py has its own",
    "CMAKE_ARGS": "builds OpenCV for an hour",
    "peakmark corpus make spec.toml": "needs those servers and a bucket; test_bucket.py has its own",
}
"""First words of a command → why it is not run."""

SMALLER = {
    "peakmark corpus make": "--frames 8 --workers 1",
    "python scripts/render_floor.py": "--frames 2",
    "python scripts/evaluate_flights.py": "--first 1 --frames 2",
    "python scripts/drive_floor.py": "--paths 1 --length 2",
    "python scripts/compare_kinds.py": "--frames 1",
}
"""First words of a command → options that make it smaller."""

FEWER = {"samples=4": "samples=1"}
"""What blocks of Python say → what they do in tests."""

AS_SEEN = {"BROWSER": "true", "COLUMNS": "120"}
"""Environment of all commands: what opens pages does nothing, and a terminal has 120 columns."""

SLOW = ("python scripts/", "peakmark regress")
"""First words of commands that take more than some seconds; `make test-all` runs them."""

SLOW_PAGES = (
    "docs/how-to/calibrate-a-camera.md",
    "docs/how-to/choose-a-size.md",
    "docs/how-to/make-a-training-set.md",
    "docs/how-to/map-a-room.md",
    "docs/how-to/print-markers.md",
    "docs/how-to/use-sift-from-colmap.md",
    "docs/how-to/write-a-scene.md",
    "docs/index.md",
    "docs/start/install.md",
    "docs/start/without-a-printer.md",
)
"""Pages of which `make test-all` runs everything."""


@dataclass(frozen=True)
class Step:
    """One block of Python, or one command."""

    language: str
    text: str
    line: int
    is_slow: bool


def steps_of(page: str) -> Iterator[Step]:
    """Yield the examples of a page in their order."""
    text = (ROOT / page).read_text(encoding="utf-8")
    is_slow = page in SLOW_PAGES
    for block in re.finditer(r"^```(\w*)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE):
        line = text[: block.start()].count("\n") + 2
        if block[1] != "sh":
            yield Step(block[1], block[2], line, is_slow)
            continue
        for i, command in enumerate(block[2].replace("\\\n", " ").splitlines()):
            for part in re.split(r"&&", command.split(" # ")[0]):
                if part.strip():
                    yield Step("sh", part.strip(), line + i, is_slow or part.strip().startswith(SLOW))


STEPS = {page: list(steps_of(page)) for page in PAGES}


def workflow_commands(page: str) -> list[str]:
    """Return the commands of peakmark that a page's CI file runs."""
    files = [yaml.safe_load(step.text) for step in STEPS[page] if step.language == "yaml"]
    steps = [step for file in files for job in file["jobs"].values() for step in job["steps"]]
    return [step["run"] for step in steps if step.get("run", "").startswith("peakmark ")]


def run_command(command: str, folder: Path) -> None:
    """Run a command of a page as a user would, made smaller."""
    words = made_smaller(command)
    program = {"peakmark": [sys.executable, "-m", "peakmark.cli"], "python": [sys.executable]}[words[0]]
    environment = {**child_environment(), **AS_SEEN}
    done = subprocess.run(
        [*program, *words[1:]], cwd=folder, env=environment, capture_output=True, text=True, timeout=800
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr


def run_command_here(command: str) -> None:
    """Run a command of a page in this process and folder, made smaller; that starts in a third of the time."""
    done = CliRunner().invoke(app, made_smaller(command)[1:], env=AS_SEEN, catch_exceptions=False)
    assert done.exit_code == 0, f"{command}\n{done.output}"


def made_smaller(command: str) -> list[str]:
    """Return a command's words, and the options that make it smaller."""
    smaller = next((options for words, options in SMALLER.items() if command.startswith(words)), "")
    return [*shlex.split(command), *shlex.split(smaller)]


def wanted(page: str, *, slow: bool) -> list[Step]:
    """Return a page's slow commands, or everything else that is run."""
    return [
        step
        for step in STEPS[page]
        if step.language in ("sh", "python") and step.is_slow == slow and not step.text.startswith(tuple(NOT_RUN))
        if traced.is_available() or 'renderer="traced"' not in step.text
    ]


def lay_out_files(page: str, folder: Path) -> None:
    """Write the files that a page tells its reader to save."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for name, content in re.findall(
        r"[Ss]ave this as `([\w.-]+)`[^`]*```\w+\n(.*?)^```$", text, re.DOTALL | re.MULTILINE
    ):
        (folder / name).write_text(content, encoding="utf-8")


def run_page(page: str, folder: Path, *, slow: bool) -> dict[str, Any]:
    """Run a page's slow commands, or everything else; return the names that its Python left."""
    for name in ("scenes", "scripts"):
        (folder / name).symlink_to(ROOT / name)
    lay_out_files(page, folder)
    names: dict[str, Any] = {"__name__": "__example__"}
    with chdir(folder):
        for step in wanted(page, slow=slow):
            if step.language == "python":
                exec(compile("\n" * (step.line - 1) + with_fewer(step.text), page, "exec"), names)
            elif slow:
                run_command(step.text, folder)
            else:
                run_command_here(step.text)
    return names


def with_fewer(code: str) -> str:
    """Return a block of Python that does less."""
    for stated, done in FEWER.items():
        code = code.replace(stated, done)
    return code


def lay_out_a_photograph(folder: Path) -> None:
    """Write what a reader has in hand: photo.jpg of the printed sheet, and cam.yaml."""
    page = pages(sheet_tiles("array-5", 60.0, "dark", "energy", None, 1), paper_size("a4"))[0]
    camera = Camera(960, 720, 690.0)
    image = photograph(Paper.of(page), camera, pose_over(0.6, 30, 20, 10), np.random.default_rng(0))
    save_photograph(folder / "photo.jpg", image)
    camera.save(folder / "cam.yaml")


def lay_out_photographs_of_a_board(folder: Path) -> None:
    """Write photographs of a board of A3, as a board's and as a room's, and the camera as cam.yaml."""
    page, _ = board_page(paper_size("a3"))
    paper, camera, rng = Paper.of(page), Camera(1280, 960, 1000.0), np.random.default_rng(0)
    eyes = ((0.1, 0.25, 0.4), (-0.2, 0.1, 0.42), (0.24, -0.12, 0.38), (-0.05, -0.26, 0.4), (0.18, 0.18, 0.4))
    for name in ("board", "room"):
        (folder / name).mkdir()
        for number, eye in enumerate(eyes):
            image = photograph(paper, camera, look_at(eye, (0.0, 0.0, 0.0), [0, 1, 0.1]), rng, sigma=1.5)
            save_photograph(folder / name / f"p{number}.jpg", image)
    camera.save(folder / "cam.yaml")
