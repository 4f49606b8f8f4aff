"""Fly-throughs end to end on a small scene: files, figures, resuming, remarks."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from peaksim.geometry.trajectory_file import load_trajectory
from pyarrow import parquet

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import FlightConfig, open_flight
from peakmark.experiments.floor.flight_figures import FlightResult, remarks
from peakmark.experiments.floor.flight_results import fly_and_keep, run_flight
from peakmark.plain import to_plain
from peakmark.report.trajectory_view import has_trajectory_view
from tests.peakmark.experiments.floor.conftest import SCENE

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
    *(["trajectory.html"] if has_trajectory_view() else []),
}


@pytest.fixture(scope="module")
def flown(ride: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FlightResult]:
    out = tmp_path_factory.mktemp("flight") / "out"
    return out, run_flight(FlightConfig(str(ride), texture="brick", frames=8), out)


def test_the_figures_are_good_on_a_floor_never_tuned_for(flown: tuple[Path, FlightResult]) -> None:
    _, result = flown
    found, distance, pose, motion = result.detection, result.distance, result.pose, result.motion
    assert found.recall.value == 1
    assert found.precision.value == 1
    assert found.localisation_px.values[95] < 0.2
    assert distance is not None
    assert distance["scale"].values[50] < 0.05
    assert distance["scale"].values[95] < 0.12
    assert distance["refined"].values[50] < 0.01
    assert pose is not None
    assert pose.located.count > 0.7 * pose.located.of
    assert pose.wrong == 0
    assert pose.position_mm.values[95] < 20
    assert motion is not None
    assert motion.track_swaps == motion.track_changes == 0
    assert result.remarks == []


def test_every_promised_file_is_there_and_agrees_with_the_others(flown: tuple[Path, FlightResult]) -> None:
    out, result = flown
    assert {p.name for p in out.iterdir()} == FILES
    assert json.loads((out / "result.json").read_text()) == json.loads(json.dumps(to_plain(result)))
    rows = list(csv.DictReader((out / "frames.csv").open()))
    assert [int(row["frame"]) for row in rows] == list(range(8))
    table = parquet.read_table(out / "detections.parquet").to_pydict()
    assert len(table["x"]) == result.detection.precision.of
    known = [(a, b) for a, b in zip(table["truth"], table["map_marker"], strict=True) if b is not None]
    assert known
    assert all(a == b for a, b in known)
    assert len(load_trajectory(out / "truth.tum")) == 8
    assert np.allclose(load_trajectory(out / "map.tum").at(0.7), load_trajectory(out / "truth.tum").at(0.7), atol=0.02)
    with av.open(str(out / "flight.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 8


def test_an_interrupted_flight_resumes_and_ends_the_same(
    ride: Path, tmp_path: Path, flown: tuple[Path, FlightResult]
) -> None:
    config = FlightConfig(str(ride), texture="brick", frames=8)

    def give_up(done: int, of: int) -> None:
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_flight(config, tmp_path, on_step=give_up)
    assert len((tmp_path / "journal.jsonl").read_text().splitlines()) == 1 + 4
    with pytest.raises(InputError, match="holds a run of another configuration: seed was 0, is 1"):
        run_flight(replace(config, seed=1), tmp_path, is_resumed=True)
    steps: list[tuple[int, int]] = []
    result = run_flight(config, tmp_path, is_resumed=True, on_step=lambda *step: steps.append(step))
    assert steps == [(done, 8) for done in range(4, 9)]
    for part in ("detection", "distance", "pose", "motion", "recall_by"):
        assert getattr(result, part) == getattr(flown[1], part)
    assert {p.name for p in tmp_path.iterdir()} == FILES


def test_a_flight_that_is_kept_is_not_flown_or_written_again(ride: Path, tmp_path: Path) -> None:
    config = FlightConfig(str(ride), frames=2)
    _, result, journal = fly_and_keep(config, tmp_path)
    (tmp_path / "frames.csv").unlink()
    steps: list[tuple[int, int]] = []
    _, again, _ = fly_and_keep(config, tmp_path, is_resumed=True, on_step=lambda *step: steps.append(step))
    assert steps == [(2, 2)]
    assert (again.detection, again.time_s) == (result.detection, result.time_s)
    assert not (tmp_path / "frames.csv").exists()
    journal.remove()
    assert not (tmp_path / "journal.jsonl").exists()


def test_a_flight_without_markers_in_view_gives_none_not_a_crash(ride: Path, tmp_path: Path) -> None:
    text = ride.read_text().replace("pitch_deg = 36", "pitch_deg = -50")
    up = ride.parent / "up.toml"
    up.write_text(text)
    result = run_flight(FlightConfig(str(up), frames=2), tmp_path / "out")
    assert result.detection.recall.of == 0
    assert result.detection.silent_without_markers.value == 1
    assert result.pose is not None
    assert result.pose.located.value is None
    assert result.remarks == ["no marker was in view in any frame"]


def test_on_request_a_recording_and_the_drawing_of_each_frame(ride: Path, tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    decoder, reader = pytest.importorskip("mcap_ros2.decoder"), pytest.importorskip("mcap.reader")
    out, path = tmp_path / "out", tmp_path / "flight.mcap"
    run_flight(FlightConfig(str(ride), frames=2), out, record=path, overlays=True)
    assert sorted(each.name for each in (out / "frames").iterdir()) == ["000000.jpg", "000001.jpg"]
    assert 'href="frames/000001.jpg">largest' in (out / "report.html").read_text(encoding="utf-8")
    true = load_trajectory(out / "truth.tum").world_from_camera
    with path.open("rb") as file:
        messages = list(reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages())
    told = [value.pose.position for _, channel, _, value in messages if channel.topic == "/pose_truth"]
    assert np.allclose([(each.x, each.y, each.z) for each in told], true[:, :3, 3])
    found = [value.pose.pose.position for _, channel, _, value in messages if channel.topic == "/pose"]
    assert np.allclose([(each.x, each.y, each.z) for each in found], true[:, :3, 3], atol=0.02)


def test_a_map_of_another_floor_is_reported(ride: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text(SCENE.replace("[0.25, 1.7], [-0.2, 2.6], [0.1, 3.6]", "[0.9, 1.1], [0.2, 2.2], [-0.9, 2.9]"))
    result = run_flight(FlightConfig(str(ride), frames=2, map=str(other)), tmp_path / "out")
    assert result.detection.recall.value == 1
    assert len(result.remarks) == 1
    assert result.remarks[0].startswith("the map does not fit what is seen")


def test_too_fast_a_ride_is_remarked_on(ride: Path, tmp_path: Path) -> None:
    fast = ride.parent / "fast.toml"
    fast.write_text(ride.read_text().replace("speed_m_s = 0.6", "speed_m_s = 3.0\nacceleration_m_s2 = 9.0"))
    remark = remarks(open_flight(FlightConfig(str(fast))))
    assert len(remark) == 1
    assert "more than half the markers' spacing" in remark[0]
