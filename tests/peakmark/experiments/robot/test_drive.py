"""The robot in the simulator, image by image; the 10 m drives are slow."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.experiments.robot.drive import FIRST_M, DriveConfig, build_path, moved, winding_path
from peakmark.experiments.robot.drive_figures import coasted_m, gaps_of
from peakmark.experiments.robot.drive_results import DriveResult, run_drives
from peakmark.experiments.robot.robot import STOP, Command, Robot, State
from peakmark.plain import to_plain
from peakmark.score.wanted import IN_VIEW
from tests.peakmark.experiments.floor.records import frame_record

FILES = {"paths.csv", "top_view.png", "drive.mp4", "report.html", "result.json"}
SHORT = DriveConfig(paths=1, length_m=1.2, texture="brick", seed=3, frames_per_second=4)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, DriveResult]:
    out = tmp_path_factory.mktemp("drive") / "out"
    return out, run_drives(SHORT, out)


def test_it_drives_the_path_to_its_end_and_stops(driven: tuple[Path, DriveResult]) -> None:
    _, result = driven
    figures = result.overall
    assert figures.completed.value == figures.stopped.value == 1
    assert figures.cross_track_rms_m < 0.05
    assert figures.coasted_max_m < 0.3
    assert figures.recall.value == figures.precision.value == 1
    assert figures.gaps == figures.wrong_poses == 0
    assert result.paths[0].position_mm.values[95] < 20


def test_every_promised_file_is_there(driven: tuple[Path, DriveResult]) -> None:
    out, result = driven
    assert {p.name for p in out.iterdir()} == FILES
    assert json.loads((out / "result.json").read_text()) == json.loads(json.dumps(to_plain(result)))
    (row,) = csv.DictReader((out / "paths.csv").open())
    assert row["completed"] == "True"
    with av.open(str(out / "drive.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == result.paths[0].frames


def test_it_stops_where_the_markers_end(tmp_path: Path) -> None:
    config = DriveConfig(paths=1, length_m=2.0, line_ends_m=0.6, seed=3, frames_per_second=4)
    result = run_drives(config, tmp_path)
    assert result.overall.completed.value == 0
    assert result.overall.stopped.value == 1
    assert result.paths[0].reached_m < 1.2
    assert result.overall.coasted_max_m < 0.3


def test_an_interrupted_run_keeps_its_finished_paths(tmp_path: Path) -> None:
    config = DriveConfig(paths=2, length_m=1.0, line_ends_m=0.6, seed=1, frames_per_second=2)

    def give_up(done: int, of: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_drives(config, tmp_path, on_step=give_up)
    with pytest.raises(InputError, match=r"holds a run of another configuration: paths was 2, is 3"):
        run_drives(replace(config, paths=3), tmp_path, is_resumed=True)
    steps: list[tuple[int, int]] = []
    result = run_drives(config, tmp_path, is_resumed=True, on_step=lambda *step: steps.append(step))
    assert steps == [(1, 2), (2, 2)]
    assert len(result.paths) == 2
    assert {p.name for p in tmp_path.iterdir()} == FILES


@pytest.mark.slow
@pytest.mark.parametrize("texture", ["grass", "coins"])
def test_ten_metres_are_driven(texture: str, tmp_path: Path) -> None:
    result = run_drives(DriveConfig(paths=2, texture=texture, seed=100), tmp_path)
    assert result.overall.completed.value == 1
    assert result.overall.cross_track_worst_rms_m < 0.05


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), length=st.floats(1, 15))
def test_paths_have_their_length_and_no_sharp_bend(seed: int, length: float) -> None:
    path = winding_path(length, np.random.default_rng(seed))
    assert path.length_m == pytest.approx(length, rel=1e-3)
    heading = np.unwrap(path.heading_rad(np.linspace(0, length, 400)))
    assert np.abs(np.diff(heading) / (length / 399)).max() < 1.2


def test_markers_lie_on_the_path_from_its_start_to_beyond_its_end() -> None:
    config = DriveConfig(length_m=4.0)
    drive_path = build_path(config, 5)
    centers = np.array([quad.world_from_quad[:2, 3] for quad in drive_path.setup.scene.quads if quad.marks])
    at, left = drive_path.path.nearest(centers)
    assert np.abs(left).max() < 0.005
    assert at[0] == pytest.approx(FIRST_M, abs=0.01)
    assert at[-1] > 4.3
    assert np.allclose(np.diff(at), 0.3, atol=0.01)
    assert np.array_equal(build_path(config, 5).path.waypoints_m, drive_path.path.waypoints_m)
    assert not np.array_equal(build_path(config, 6).path.waypoints_m, drive_path.path.waypoints_m)


def test_a_command_takes_effect_after_the_latency() -> None:
    config = DriveConfig(frames_per_second=5, robot=Robot(wheel_noise=0, latency_s=0.1))
    rng, still = np.random.default_rng(0), State(0, 0, 0)
    assert moved(config, still, [Command(1.0)], np.zeros(2), rng).x_m == pytest.approx(0.1)
    assert moved(config, still, [Command(1.0), STOP], np.zeros(2), rng).x_m == pytest.approx(0.1)
    assert moved(config, still, [Command(1.0), Command(1.0)], np.zeros(2), rng).x_m == pytest.approx(0.2)


def test_what_is_lost_and_found_again_is_counted() -> None:
    frames = (("ab", "a"), ("ab", "ab"), ("ab", "b"), ("ab", ""), ("ab", "a"))
    assert gaps_of([frame_record(*frame) for frame in frames], IN_VIEW) == (2, 1)
    assert coasted_m(np.array([[0, 0], [1, 0], [1, 2.0]]), [1, 1, 0]) == 2.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"paths": 0}, "--paths: expected 1…10000, got 0"),
        ({"length_m": 0.5}, "--length: expected 1…100 m, got 0.5"),
        ({"spacing_m": 9.0}, "--spacing: expected 0.15…8 m, got 9.0"),
        ({"line_ends_m": 0.5}, "--line-ends: expected 0.6…10 m, got 0.5"),
        ({"frames_per_second": 0.0}, "--rate: expected 1…50 frames a second, got 0.0"),
        ({"renderer": "ray"}, "--renderer: expected auto, exact, gl, pyrender or traced, got ray"),
    ],
)
def test_bad_input_is_one_line(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        DriveConfig(**change)


def test_a_scene_without_a_line_of_markers_is_refused() -> None:
    with pytest.raises(InputError, match="cave: expected one entry in marker_paths, found 0"):
        build_path(DriveConfig(scene="cave"), 0)
