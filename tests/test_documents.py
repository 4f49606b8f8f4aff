"""Every example in the documentation runs: the blocks of each page in their order, in a folder of their own.

Blocks of `python` share their names, as a reader's session would; blocks of `sh` are run command by command. What
would take minutes is made smaller by options that `--help` lists.
"""

import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peaksim import Camera, traced
from peaksim.corpus import open_corpus

from peakmark.cli.marker import sheet_tiles
from peakmark.maps.files import load_map
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
    "peakmark calibrate": "needs photographs of a printed board; tests/peakmark/cli/test_calibrate.py has its own",
    "peakmark map": "needs photographs of a room; tests/peakmark/cli/test_calibrate.py has its own",
    "peakmark identify walk.mp4": "needs what those two write",
    "make": "sets this checkout up, or runs these tests",
    "git": "fetches this checkout",
    "cd": "goes into it",
    "dask": "starts servers that never end; tests/peaksim/corpus/test_backends.py has its own",
    "CMAKE_ARGS": "builds OpenCV for an hour",
    "peakmark corpus make spec.toml": "needs those servers and a bucket; test_bucket.py has its own",
}
"""First words of a command → why it is not run."""

SMALLER = {
    "peakmark corpus make": "--frames 8",
    "python scripts/render_floor.py": "--frames 2",
    "python scripts/evaluate_flights.py": "--first 1 --frames 2",
    "python scripts/drive_floor.py": "--paths 1 --length 2",
}
"""First words of a command → options that make it smaller."""

SLOW = ("python scripts/", "peakmark regress")
"""First words of commands that take more than some seconds; `make test-all` runs them."""


@dataclass(frozen=True)
class Step:
    """One block of Python, or one command."""

    language: str
    text: str
    line: int

    @property
    def is_slow(self) -> bool:
        return self.language == "sh" and self.text.startswith(SLOW)


def steps_of(page: str) -> Iterator[Step]:
    """Yield the examples of a page in their order."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for block in re.finditer(r"^```(\w*)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE):
        line = text[: block.start()].count("\n") + 2
        if block[1] != "sh":
            yield Step(block[1], block[2], line)
            continue
        for i, command in enumerate(block[2].replace("\\\n", " ").splitlines()):
            for part in re.split(r"&&", command.split(" # ")[0]):
                if part.strip():
                    yield Step("sh", part.strip(), line + i)


STEPS = {page: list(steps_of(page)) for page in PAGES}


def run_command(command: str, folder: Path) -> None:
    """Run a command of a page as a user would, made smaller."""
    smaller = next((options for words, options in SMALLER.items() if command.startswith(words)), "")
    words = [*shlex.split(command), *shlex.split(smaller)]
    program = {"peakmark": [sys.executable, "-m", "peakmark.cli"], "python": [sys.executable]}[words[0]]
    environment = {**child_environment(), "BROWSER": "true", "COLUMNS": "120"}
    done = subprocess.run(
        [*program, *words[1:]], cwd=folder, env=environment, capture_output=True, text=True, timeout=800
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr


def wanted(page: str, *, slow: bool) -> list[Step]:
    """Return a page's slow commands, or everything else that is run."""
    return [
        step
        for step in STEPS[page]
        if step.language in ("sh", "python") and step.is_slow == slow and not step.text.startswith(tuple(NOT_RUN))
        if traced.is_available() or 'renderer="traced"' not in step.text
    ]


def run_page(page: str, folder: Path, *, slow: bool) -> dict[str, Any]:
    """Run a page's slow commands, or everything else; return the names that its Python left."""
    for name in ("scenes", "scripts"):
        (folder / name).symlink_to(ROOT / name)
    names: dict[str, Any] = {"__name__": "__example__"}
    with chdir(folder):
        for step in wanted(page, slow=slow):
            if step.language == "sh":
                run_command(step.text, folder)
            else:
                exec(compile("\n" * (step.line - 1) + step.text, page, "exec"), names)
    return names


RUN = (
    "CORPUS.md",
    "README.md",
    "docs/figures/cave.md",
    "docs/figures/detectability.md",
    "docs/figures/driving.md",
    "docs/how-to/find-surf-key-points.md",
    "docs/how-to/localise-a-robot.md",
    "docs/how-to/use-your-own-detector.md",
    "docs/reference/sensors.md",
    "docs/understand/rendering.md",
)
"""Pages with examples that the default tests run."""

RUN_SLOWLY = ("docs/figures/cave.md", "docs/figures/driving.md", "docs/how-to/keep-a-detector-from-getting-worse.md")
"""Pages with long commands."""


def test_these_are_the_pages_with_examples() -> None:
    assert tuple(page for page in PAGES if wanted(page, slow=False)) == RUN
    assert tuple(page for page in PAGES if wanted(page, slow=True)) == RUN_SLOWLY


@pytest.mark.parametrize("page", PAGES)
def test_a_block_says_what_it_is(page: str) -> None:
    """A command in a block of another language would not be run."""
    for step in STEPS[page]:
        assert step.language in ("", "sh", "python", "toml"), f"{page}:{step.line}"
        if step.language == "toml":
            tomllib.loads(step.text)
        if step.language == "":
            commands = re.findall(r"^(?:peakmark|python|make|pip|git|dask) .*", step.text, flags=re.MULTILINE)
            assert commands == [], f"{page}:{step.line}"


def lay_out_a_photograph(folder: Path) -> None:
    """Write what a reader has in hand: photo.jpg of the printed sheet, and cam.yaml."""
    page = pages(sheet_tiles("array-5", 60.0, "dark", "energy", None, 1), paper_size("a4"))[0]
    camera = Camera(960, 720, 690.0)
    image = photograph(Paper.of(page), camera, pose_over(0.6, 30, 20, 10), np.random.default_rng(0))
    save_photograph(folder / "photo.jpg", image)
    camera.save(folder / "cam.yaml")


def test_the_readme_runs(tmp_path: Path) -> None:
    lay_out_a_photograph(tmp_path)
    names = run_page("README.md", tmp_path, slow=False)
    assert {array.code for array in names["found"].arrays} == {3, 5}
    true = names["trajectory"].at(0.0)
    assert names["where"].world_from_camera[:3, 3] == pytest.approx(true[:3, 3], abs=0.005)


def test_the_page_of_poses_runs(tmp_path: Path) -> None:
    lay_out_a_photograph(tmp_path)
    names = run_page("docs/how-to/localise-a-robot.md", tmp_path, slow=False)
    assert len(names["rows"]) == 3
    assert (tmp_path / "out/2.png").is_file()
    (toml,) = (step.text for step in STEPS["docs/how-to/localise-a-robot.md"] if step.language == "toml")
    (tmp_path / "map.toml").write_text(toml, encoding="utf-8")
    assert len(load_map(tmp_path / "map.toml")) == 4


def test_the_pages_of_driving_arrays_and_surf_run(tmp_path: Path) -> None:
    for page in ("driving", "cave", "surf", "rendering", "detectability"):
        (tmp_path / page).mkdir()
    driving = run_page("docs/figures/driving.md", tmp_path / "driving", slow=False)
    assert driving["pose"].world_from_camera[:3, 3] == pytest.approx((0.0, 0.3, 0.7), abs=0.001)
    cave = run_page("docs/figures/cave.md", tmp_path / "cave", slow=False)
    assert {array.code for array in cave["decode_arrays"](cave["markers"], image=cave["image"])} == {3, 5}
    assert len(run_page("docs/how-to/find-surf-key-points.md", tmp_path / "surf", slow=False)["points"]) == 200
    run_page("docs/understand/rendering.md", tmp_path / "rendering", slow=False)
    run_page("docs/figures/detectability.md", tmp_path / "detectability", slow=False)
    assert (tmp_path / "detectability/out/envelope/envelope.png").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN_SLOWLY)
def test_the_long_commands_of_the_pages_run(tmp_path: Path, page: str) -> None:
    run_page(page, tmp_path, slow=True)
    results = {
        "docs/figures/cave.md": "out/cave/overlay.png",
        "docs/how-to/keep-a-detector-from-getting-worse.md": "out/compare/report.html",
    }
    assert (tmp_path / results.get(page, "out")).exists()


def test_the_page_of_corpora_runs_and_its_tables_hold_frames_and_markers_apart(tmp_path: Path) -> None:
    pytest.importorskip("webdataset")
    pytest.importorskip("pycolmap")
    names = run_page("CORPUS.md", tmp_path, slow=False)
    records = list(open_corpus(str(tmp_path / "out/corpus_small")).records())
    sides = [marker["side_px"] for record in records for marker in record["markers"]]
    with chdir(tmp_path):
        assert names["frames"].count_rows() == len(records) == 8
        assert names["markers"].count_rows() == len(sides) > 8
        assert [sample["__key__"] for sample in names["samples"]] == [f"{i:08d}" for i in range(8)]
    assert names["large"].num_rows == sum(side is not None and side > 20 for side in sides)
    assert names["model"].num_images() == 8


def test_the_page_of_sensors_runs(tmp_path: Path) -> None:
    names = run_page("docs/reference/sensors.md", tmp_path, slow=False)
    assert names["phone"].dtype == "uint8"
    assert names["raw"].dtype == "uint16"


def commands_in_prose() -> list[tuple[str, str]]:
    """Return every command that a page names, in blocks or in a sentence."""
    found = []
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        spans = [*re.findall(r"`([^`\n]+)`", text), *(s.text for s in STEPS[page] if s.language == "sh")]
        found += [(page, span) for span in spans if re.match(r"peakmark [a-z]|python scripts/", span) and " --" in span]
    return sorted(set(found))


@pytest.mark.parametrize(("page", "command"), commands_in_prose())
def test_every_option_that_a_page_names_exists(page: str, command: str) -> None:
    from typer.testing import CliRunner

    from peakmark.cli.app import app

    words = shlex.split(command)
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    if words[0] == "peakmark":
        groups = words[1 : 3 if words[1] in ("corpus", "regress") else 2]
        text = CliRunner().invoke(app, [*groups, "--help"], env={"COLUMNS": "200"}).output
    else:
        program = [sys.executable, str(ROOT / words[1]), "--help"]
        environment = {**child_environment(), "COLUMNS": "200"}
        text = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=120).stdout
    assert options <= set(re.findall(r"--[a-z-]+", text)), f"{page}: {command}"
