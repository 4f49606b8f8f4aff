"""Every example in the documentation runs: the blocks of each page in their order, in a folder of their own.

Blocks of `python` share their names, as a reader's session would; blocks of `sh` are run command by command, the quick
ones in this process. What would take minutes is made smaller by options that `--help` lists (`tests/documents.py`).
"""

import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from contextlib import chdir
from functools import cache
from pathlib import Path

import pytest
from peaksim.corpus import open_corpus
from typer import Typer
from typer.testing import CliRunner

from peakmark.cli.app import app
from peakmark.cli.command import plain_app
from peakmark.maps.files import load_map
from tests.documents import (
    PAGES,
    SLOW_PAGES,
    STEPS,
    lay_out_a_photograph,
    lay_out_photographs_of_a_board,
    run_page,
    wanted,
    workflow_commands,
)
from tests.peaksim.corpus.helpers import child_environment
from tests.places import ROOT

RUN = (
    "CORPUS.md",
    "README.md",
    "docs/figures/cave.md",
    "docs/figures/detectability.md",
    "docs/figures/driving.md",
    "docs/how-to/find-markers.md",
    "docs/how-to/find-surf-key-points.md",
    "docs/how-to/localise-a-robot.md",
    "docs/how-to/use-your-own-detector.md",
    "docs/reference/sensors.md",
    "docs/start/first-photograph.md",
    "docs/understand/patterns.md",
    "docs/understand/rendering.md",
)
"""Pages with examples that the default tests run."""

RUN_SLOWLY = tuple(
    sorted(
        (
            "docs/figures/cave.md",
            "docs/figures/driving.md",
            "docs/figures/kinds.md",
            "docs/how-to/keep-a-detector-from-getting-worse.md",
            *SLOW_PAGES,
        )
    )
)
"""Pages with long commands."""


def test_these_are_the_pages_with_examples() -> None:
    assert tuple(page for page in PAGES if wanted(page, slow=False)) == RUN
    assert tuple(page for page in PAGES if wanted(page, slow=True)) == RUN_SLOWLY


@pytest.mark.parametrize("page", PAGES)
def test_a_block_says_what_it_is(page: str) -> None:
    """A command in a block of another language would not be run."""
    for step in STEPS[page]:
        assert step.language in ("", "sh", "python", "toml", "yaml", "text"), f"{page}:{step.line}"
        if step.language == "toml":
            tomllib.loads(step.text)
        if step.language in ("", "text"):
            commands = re.findall(r"^(?:peakmark|python|make|pip|git|dask) .*", step.text, flags=re.MULTILINE)
            assert commands == [], f"{page}:{step.line}"


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


def test_the_map_by_hand_is_a_map(tmp_path: Path) -> None:
    (toml,) = (step.text for step in STEPS["docs/how-to/map-a-room.md"] if step.language == "toml")
    (tmp_path / "map.toml").write_text(toml, encoding="utf-8")
    assert len(load_map(tmp_path / "map.toml")) == 4


def test_the_first_photograph_and_its_markers(tmp_path: Path) -> None:
    for page in ("first", "find", "patterns"):
        (tmp_path / page).mkdir()
        lay_out_a_photograph(tmp_path / page)
    first = run_page("docs/start/first-photograph.md", tmp_path / "first", slow=False)
    assert [array.code for array in first["found"].arrays] == [5]
    assert first["where"].is_certain
    find = run_page("docs/how-to/find-markers.md", tmp_path / "find", slow=False)
    assert len(find["sure"]) == len(find["rows"]) == 3
    patterns = run_page("docs/understand/patterns.md", tmp_path / "patterns", slow=False)
    assert len(set(patterns["binary"].flat)) == 2


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
    if page in SLOW_PAGES:
        lay_out_a_photograph(tmp_path)
    if page in ("docs/how-to/calibrate-a-camera.md", "docs/how-to/map-a-room.md"):
        lay_out_photographs_of_a_board(tmp_path)
    names = run_page(page, tmp_path, slow=True)
    if page == "docs/how-to/use-sift-from-colmap.md":  # a reconstruction scaled by markers, metres
        assert names["world"].errors.max() < 0.001
    results = {
        "docs/figures/cave.md": "out/cave/overlay.png",
        "docs/how-to/keep-a-detector-from-getting-worse.md": "out/compare/report.html",
        "docs/how-to/print-markers.md": "board/result.json",
        "docs/index.md": "sheet/result.json",
        "docs/start/install.md": "photo.jpg",
        "docs/how-to/use-sift-from-colmap.md": "keypoints.npz",
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
        blocks = [step.text for step in STEPS[page] if step.language == "sh"]
        spans = [*re.findall(r"`([^`\n]+)`", text), *blocks, *workflow_commands(page)]
        found += [(page, span) for span in spans if re.match(r"peakmark [a-z]|python scripts/", span) and " --" in span]
    return sorted(set(found))


@cache
def help_of(*words: str) -> str:
    """Return what a command, or a script, says of its options; a script's from the function that it calls."""
    if words[0] == "peakmark":
        return str(CliRunner().invoke(app, [*words[1:], "--help"], env={"COLUMNS": "200"}).output)
    (called,) = re.findall(r"run_command\((\w+)\)", (ROOT / words[0]).read_text(encoding="utf-8"))
    command = runpy.run_path(str(ROOT / words[0]))[called]
    own = command if isinstance(command, Typer) else plain_app()
    if own is not command:
        own.command()(command)
    return str(CliRunner().invoke(own, ["--help"], env={"COLUMNS": "200"}).output)


@pytest.mark.parametrize(("page", "command"), commands_in_prose())
def test_every_option_that_a_page_names_exists(page: str, command: str) -> None:
    words = shlex.split(command)
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    group = words[1 : 3 if words[1] in ("corpus", "regress") else 2]
    text = help_of("peakmark", *group) if words[0] == "peakmark" else help_of(words[1])
    assert options <= set(re.findall(r"--[a-z-]+", text)), f"{page}: {command}"


def test_a_script_shows_its_own_help() -> None:
    program = [sys.executable, str(ROOT / "scripts/train_search.py"), "--help"]
    environment = {**child_environment(), "COLUMNS": "200"}
    text = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=120).stdout
    assert set(re.findall(r"--[a-z-]+", text)) == set(re.findall(r"--[a-z-]+", help_of("scripts/train_search.py")))
