"""`peakmark corpus`: what it says while it works, when it is interrupted, and about damage."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from peaksim.corpus import make_corpus
from typer.testing import CliRunner

from peakmark.cli import corpus as command
from tests.peaksim.corpus.helpers import child_environment, contents, tiny_spec, wait_until, write_tiny_scene

SPEC = """
name = "tiny"
frames = {frames}
seed = 5
sequence_frames = 4
renderer = "exact"
store = {{ shard_frames = 3, part_frames = 6000 }}
scenes = [{{ file = "tiny.toml" }}]
cameras = [{{ name = "cam", width = 64, height = 48, fx = [50, 60] }}]
views = [{{ kind = "marker", distance_m = [0.5, 1.0] }}]
sensor = {{ read_noise = [0, 2] }}
"""


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    """A specification with its scene."""
    file = write_tiny_scene(tmp_path / "specs") / "tiny-corpus.toml"
    file.write_text(SPEC.format(frames=6))
    return file


@pytest.mark.parametrize("workers", [pytest.param("1", marks=pytest.mark.slow), "2"])
def test_ctrl_c_says_that_the_same_command_resumes(spec: Path, tmp_path: Path, workers: str) -> None:
    spec.write_text(SPEC.format(frames=3000))
    arguments = ["corpus", "make", str(spec), "--out", str(tmp_path / "c"), "--workers", workers]
    program = subprocess.Popen(
        [sys.executable, "-m", "peakmark.cli", *arguments],
        env=child_environment(),
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    try:
        wait_until(lambda: any((tmp_path / "c").glob("sums/*")) or program.poll() is not None)
        os.killpg(program.pid, signal.SIGINT)  # as a terminal does: to the workers too
        _, errors = program.communicate(timeout=60)
    finally:
        program.kill()
    assert (errors, program.returncode) == ("interrupted: the same command resumes\n", 130)


def test_damage_is_named_by_check_and_by_the_run_that_makes_it_again(spec: Path, tmp_path: Path) -> None:
    dest = tmp_path / "c"
    make_corpus(tiny_spec(frames=6, store={"shard_frames": 3, "part_frames": 6000}), spec.parent, str(dest))
    whole = contents(dest)
    (dest / "shards" / "000001.tar").write_bytes(b"rot")
    done = CliRunner().invoke(command.app, ["check", str(dest)])
    assert (done.exit_code, done.output.strip()) == (1, "'shards/000001.tar': is not what was written")
    (dest / "manifest.json").unlink()
    done = CliRunner().invoke(command.app, ["make", str(spec), "--out", str(dest), "--workers", "1"])
    assert (done.exit_code, done.output.strip().splitlines()[0]) == (
        0,
        "made again: 'shards/000001.tar': is not what was written",
    )
    assert contents(dest) == whole


def test_check_names_the_inputs_that_it_could_not_compare(spec: Path, tmp_path: Path) -> None:
    make_corpus(tiny_spec(frames=3), spec.parent, str(tmp_path / "c"))
    first = CliRunner().invoke(command.app, ["check", str(tmp_path / "c")])
    assert (
        "Input files that are not here, and were not compared: 'plain.png', 'striped.png', 'tiny.toml'" in first.output
    )
    second = CliRunner().invoke(command.app, ["check", str(tmp_path / "c"), "--inputs", str(spec.parent)])
    assert (second.exit_code, "not compared" in second.output) == (0, False)
