"""Fly-throughs end to end on a small scene: files, figures, resuming, determinism, bad input."""

import csv
import json
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from peaksim.geometry.trajectory_file import load_trajectory
from pyarrow import parquet

from peakmark.errors import InputError
from peakmark.experiments.floor import flight_results
from peakmark.experiments.floor.flight import FlightConfig, open_flight, shoot
from peakmark.experiments.floor.flight_course import identity_faults
from peakmark.score.poses import trajectory_errors

SCENE = """
[camera]
width = 480
height = 360
fx = 400.0
[sensor]
read_noise = 2.0
[[trajectory]]
eye_m = [0.0, 0.3, 0.6]
target_m = [0.0, 1.3, 0.0]
[textures.floor]
variants = { gravel = "textures/gravel.png", brick = "textures/brick.png" }
contrast = 0.5
[room]
min_m = [-1.5, 0.0, 0.0]
max_m = [1.5, 5.0, 2.0]
floor = "floor"
[[marker_paths]]
name = "t"
kind = "surf-dark"
count = 12
side_m = 0.08
border_m = 0.01
waypoints_m = [[0.0, 0.8], [0.25, 1.7], [-0.2, 2.6], [0.1, 3.6]]
"""
RIDE = """
scene = "{scene}"
frames_per_second = 10
[drive]
path = "t"
height_m = 0.6
pitch_deg = 36
speed_m_s = 0.6
start_m = -0.4
end_m = {end}
[light]
low = 0.7
high = 1.1
period_s = 2
"""
FILES = {
    "frames.csv",
    "detections.parquet",
    "flight.mp4",
    "truth.tum",
    "map.tum",
    "motion.tum",
    "top_view.png",
    "report.html",
    "result.json",
}


@pytest.fixture(scope="module")
def ride(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ride")
    (folder / "scene.toml").write_text(SCENE)
    path = folder / "ride.toml"
    path.write_text(RIDE.format(scene=folder / "scene.toml", end=0.1))
    return path


@pytest.fixture(scope="module")
def flown(ride: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    out = tmp_path_factory.mktemp("flight") / "out"
    return out, flight_results.run(FlightConfig(str(ride), texture="brick", frames=8), out)


def test_the_figures_are_good_on_a_floor_never_tuned_for(flown: tuple[Path, dict[str, Any]]) -> None:
    _, result = flown
    found = result["detection"]
    assert found["recall"]["value"] == 1
    assert found["precision"]["value"] == 1
    assert found["localisation_px"]["p95"] < 0.2
    assert result["distance"]["scale"]["p50"] < 0.05
    assert result["distance"]["scale"]["p95"] < 0.12
    assert result["distance"]["refined"]["p50"] < 0.01
    assert result["pose"]["located"]["value"] > 0.7
    assert result["pose"]["wrong"] == 0
    assert result["pose"]["position_mm"]["p95"] < 20
    assert result["motion"]["track_swaps"] == result["motion"]["track_changes"] == 0
    assert result["remarks"] == []


def test_every_promised_file_is_there_and_agrees_with_the_others(flown: tuple[Path, dict[str, Any]]) -> None:
    out, result = flown
    assert {p.name for p in out.iterdir()} == FILES
    assert json.loads((out / "result.json").read_text()) == json.loads(json.dumps(result))
    rows = list(csv.DictReader((out / "frames.csv").open()))
    assert [int(row["frame"]) for row in rows] == list(range(8))
    table = parquet.read_table(out / "detections.parquet").to_pydict()
    assert len(table["x"]) == result["detection"]["precision"]["of"]
    known = [(a, b) for a, b in zip(table["truth"], table["map_marker"], strict=True) if b is not None]
    assert known
    assert all(a == b for a, b in known)
    assert len(load_trajectory(out / "truth.tum")) == 8
    assert np.allclose(load_trajectory(out / "map.tum").at(0.7), load_trajectory(out / "truth.tum").at(0.7), atol=0.02)
    with av.open(str(out / "flight.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 8


def test_an_interrupted_flight_goes_on_and_ends_the_same(
    ride: Path, tmp_path: Path, flown: tuple[Path, dict[str, Any]]
) -> None:
    config, taken = FlightConfig(str(ride), texture="brick", frames=8), []

    def give_up(total: int) -> None:
        taken.append(total)
        if len(taken) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        flight_results.run(config, tmp_path, on_step=give_up)
    assert len(list((tmp_path / "frames").glob("0*.json"))) == 4
    with pytest.raises(InputError, match="holds frames of another flight: seed was 0, is 1"):
        flight_results.run(FlightConfig(str(ride), texture="brick", frames=8, seed=1), tmp_path, is_resumed=True)
    result = flight_results.run(config, tmp_path, is_resumed=True)
    for part in ("detection", "distance", "pose", "motion", "recall_by"):
        assert result[part] == flown[1][part]
    assert not (tmp_path / "frames").exists()


def test_a_frame_depends_on_its_index_alone(ride: Path) -> None:
    flight = open_flight(FlightConfig(str(ride), frames=4))
    once, again = shoot(flight, 2), shoot(flight, 2)
    del once.record["time_s"], again.record["time_s"]
    assert once.record == again.record
    assert np.array_equal(once.frame.image, again.frame.image)


def test_a_flight_without_markers_in_view_gives_none_not_a_crash(ride: Path, tmp_path: Path) -> None:
    text = ride.read_text().replace("pitch_deg = 36", "pitch_deg = -50")
    up = tmp_path / "up.toml"
    up.write_text(text)
    result = flight_results.run(FlightConfig(str(up), frames=2), tmp_path / "out")
    assert result["detection"]["recall"]["of"] == 0
    assert result["detection"]["silent_without_markers"]["value"] == 1
    assert result["pose"]["located"]["value"] is None
    assert result["remarks"] == ["no marker was in view in any frame"]


def test_a_map_of_another_place_is_reported(ride: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text(SCENE.replace("[0.25, 1.7], [-0.2, 2.6], [0.1, 3.6]", "[0.9, 1.1], [0.2, 2.2], [-0.9, 2.9]"))
    result = flight_results.run(FlightConfig(str(ride), frames=2, map=str(other)), tmp_path / "out")
    assert result["detection"]["recall"]["value"] == 1
    assert len(result["remarks"]) == 1
    assert result["remarks"][0].startswith("the map does not fit what is seen")


def test_too_fast_a_ride_is_remarked_on(ride: Path, tmp_path: Path) -> None:
    fast = tmp_path / "fast.toml"
    fast.write_text(ride.read_text().replace("speed_m_s = 0.6", "speed_m_s = 3.0\nacceleration_m_s2 = 9.0"))
    remark = flight_results.remarks(open_flight(FlightConfig(str(fast))))
    assert len(remark) == 1
    assert "more than half the markers' spacing" in remark[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": 0}, "--frames: expected 1…1000000, got 0"),
        ({"seed": -1}, "--seed: expected 0 or more, got -1"),
        ({"stretch": 9.0}, r"--stretch: expected 0\.25…8, got 9\.0"),
        ({"rule": "guess"}, "--rule: expected joint or paper, got guess"),
        ({"texture": "marble"}, r"textures\.floor: expected one of gravel, brick, got 'marble'"),
    ],
)
def test_bad_input_is_one_line(ride: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        open_flight(FlightConfig(str(ride), **change))


def test_identity_faults_count_changes_and_swaps() -> None:
    def record(*names: str) -> dict[str, Any]:
        return {"truth": [{"name": n} for n in names], "detections": [{"truth": n} for n in names]}

    frames = [record("a", "b"), record("a", "b"), record("b")]
    assert identity_faults(frames, [np.array([0, 1]), np.array([0, 1]), np.array([1])]) == (0, 0)
    assert identity_faults(frames, [np.array([0, 1]), np.array([1, 0]), np.array([0])]) == (2, 2)
    assert identity_faults([record("a"), record(), record("a")], [np.array([0]), np.array([]), np.array([5])]) == (0, 0)


def test_evo_agrees_with_errors_put_in_by_hand() -> None:
    pytest.importorskip("evo")
    poses = [np.eye(4) for _ in range(5)]
    for k, pose in enumerate(poses):
        pose[0, 3] = k
    shifted = [pose.copy() for pose in poses]
    for pose in shifted:
        pose[1, 3] += 0.003
    errors = trajectory_errors(np.arange(5.0), poses, [*shifted[:4], None], is_aligned=False)
    assert errors is not None
    assert errors["ate_rmse_mm"] == pytest.approx(3.0)
    assert errors["rpe_rmse_mm"] == pytest.approx(0.0, abs=1e-9)
    aligned = trajectory_errors(np.arange(5.0), poses, shifted, is_aligned=True)
    assert aligned is not None
    assert aligned["ate_rmse_mm"] == pytest.approx(0.0, abs=1e-6)
    assert trajectory_errors(np.arange(5.0), poses, [None] * 5, is_aligned=False) is None
