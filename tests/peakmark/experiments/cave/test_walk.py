"""The CAVE end to end: the paper's claim on the shipped room, files, figures, determinism, bad input."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peaksim.geometry.pose import look_at
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import load_trajectory
from peaksim.image_file import read_image
from peaksim.rendering import render
from peaksim.scene.file import Setup, load_scene
from PIL import Image

from peakmark import decode_arrays, identify
from peakmark.errors import InputError
from peakmark.experiments.cave.finding import CaveRule
from peakmark.experiments.cave.walk import CaveConfig, array_map, open_cave, render_view, render_walk
from peakmark.experiments.cave.walk_results import polarity_figure, response_figure, run_cave
from peakmark.plain import to_plain
from peakmark.report.trajectory_view import has_trajectory_view
from peakmark.score.arrays import printed_arrays
from tests.peakmark.cli.running import Run, runner
from tests.peakmark.experiments.cave.cave_scene import SMALL_CAVE

FILES = {"frame.png", "overlay.png", "response_vs_vis.png", "polarity.png", "report.html", "result.json"}
KEYS = {
    "markers_in_view",
    "markers_found",
    "polarity_errors",
    "arrays_in_view",
    "arrays_decoded",
    "wrong_codes",
    "missed",
    "pose_mm",
    "pose_deg",
}


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(SMALL_CAVE)
    return path


def seen_from(setup: Setup, eye: list[float], target: list[float]) -> Setup:
    return replace(setup, trajectory=Trajectory(np.zeros(1), look_at(np.array(eye), np.array(target))[None]))


def test_the_papers_claim_in_the_shipped_room() -> None:
    config = CaveConfig()
    view = render_view(open_cave(config), config, 0, 0.0)
    row = to_plain(view.record())
    assert (row["markers_in_view"], row["markers_found"], row["arrays_in_view"], row["arrays_decoded"]) == (6, 6, 2, 2)
    assert (row["polarity_errors"], row["polarity_errors_by_signature"]) == (0, 0)
    assert (row["wrong_codes"], row["unsure"]) == (0, 0)
    assert row["arrays_decoded_by_paper"] == 2
    assert row["codes"] == [3, 5]
    assert row["missed"] == []
    # the six markers are the six strongest: all that is stronger than the last of them lies at one of their centres
    assert view.markers.false_above_last_marker == 0
    assert row["response_drop"] > 1.5
    first, second = polarity_figure(view).axes
    assert (first.get_title(), second.get_title()) == ("array 3 = 011", "array 5 = 101")
    inside = [text for text in first.texts if first.dataLim.contains(*text.get_position())]
    assert sorted(text.get_text() for text in inside) == ["+1", "+1", "−1"]
    assert row["pose_mm"] <= 5
    assert row["pose_deg"] <= 0.1
    assert row["pose_is_certain"]


def test_the_papers_rule_reads_the_small_room(small: Path, tmp_path: Path) -> None:
    result = to_plain(run_cave(CaveConfig(str(small), rule="paper"), tmp_path / "o"))
    assert (result["markers_in_view"], result["markers_found"], result["polarity_errors"]) == (10, 10, 0)
    assert result["arrays_decoded"] == result["arrays_decoded_by_paper"]
    assert result["pose_mm"] is None


@pytest.mark.parametrize("rule", ["robust", "paper"])
def test_a_room_of_sift_markers_is_read(small: Path, tmp_path: Path, rule: CaveRule) -> None:
    result = to_plain(run_cave(CaveConfig(str(small), marker="sift", rule=rule), tmp_path / "o"))
    assert result["markers_in_view"] == 10
    assert result["markers_found"] >= (10 if rule == "robust" else 6)
    assert result["polarity_errors"] == 0
    if rule == "robust":
        assert (result["arrays_decoded"], result["wrong_codes"]) == (2, 0)


def test_figure_14_hides_no_feature(small: Path) -> None:
    view = render_view(load_scene(small), CaveConfig(str(small)), 0, 0.0)
    drawn = [points for points in response_figure(view).axes[0].collections if len(points.get_offsets())]
    assert sum(len(points.get_offsets()) for points in drawn) == len(view.reading.found.features)
    labels = {points.get_label(): len(points.get_offsets()) for points in drawn}
    assert labels["taken for markers"] == 10
    assert "wrongly taken" not in labels


def test_every_promised_file_and_figure_is_there(small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = to_plain(run_cave(CaveConfig(str(small)), out))
    assert {p.name for p in out.iterdir()} == FILES
    assert json.loads((out / "result.json").read_text()) == json.loads(json.dumps(result))
    assert set(result) >= KEYS
    assert result["codes"] == [3, 6]
    assert (result["markers_in_view"], result["markers_found"], result["arrays_decoded"]) == (10, 10, 2)
    assert (result["polarity_errors"], result["wrong_codes"], result["false_detections"]) == (0, 0, 0)
    assert set(result["time_s"]) == {"render", "detect", "identify", "decode", "localise"}
    for name in ("frame.png", "overlay.png"):
        assert Image.open(out / name).size == (640, 480)
    frame, overlay = (np.asarray(Image.open(out / name).convert("RGB")) for name in ("frame.png", "overlay.png"))
    assert (frame != overlay).any(axis=2).sum() > 500
    page = (out / "report.html").read_text()
    assert "2 of 2 arrays in view decoded, 0 wrong codes" in page
    assert "http" not in page.replace("http://www.w3.org", "")


def test_a_walk_scores_every_frame_and_makes_a_film(small: Path, tmp_path: Path) -> None:
    result = to_plain(run_cave(CaveConfig(str(small), frames=3), tmp_path / "o"))
    with (tmp_path / "o" / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["frame"] for row in rows] == ["0", "1", "2"]
    assert result["arrays_decoded"] == sum(int(row["arrays_decoded"]) for row in rows) == 6
    assert result["pose_mm"] == pytest.approx(np.median([float(row["pose_mm"]) for row in rows]))
    assert (tmp_path / "o" / "walk.mp4").stat().st_size > 1000
    truth, found = (load_trajectory(tmp_path / "o" / f"{name}.tum") for name in ("truth", "arrays"))
    assert np.array_equal(truth.times_s, found.times_s)
    off_mm = 1e3 * np.linalg.norm((found.world_from_camera - truth.world_from_camera)[:, :3, 3], axis=1)
    assert off_mm == pytest.approx([float(row["pose_mm"]) for row in rows])
    assert (tmp_path / "o" / "trajectory.html").exists() == has_trajectory_view()
    assert "arrays.tum" in (tmp_path / "o" / "report.html").read_text()


def test_a_frame_depends_on_seed_and_index_alone(small: Path) -> None:
    config = CaveConfig(str(small), seed=4, frames=2)
    setup = load_scene(small)
    views = list(render_walk(setup, config))
    again = render_view(setup, config, 1, 1.0)
    assert np.array_equal(views[1].frame.image, again.frame.image)
    assert replace(views[1].record(), time_s={}) == replace(again.record(), time_s={})
    other = render_view(setup, replace(config, seed=5), 1, 1.0)
    assert not np.array_equal(other.frame.image, again.frame.image)


def test_a_code_that_hangs_twice_is_on_no_map(small: Path) -> None:
    printed = printed_arrays(load_scene(small).scene)
    assert set(array_map(printed)) == {3, 6}
    assert set(array_map([*printed, replace(printed[0], name="copy")])) == {6}


# --- bad input: never a wrong code, never a traceback ---------------------------------------------------------


@pytest.mark.parametrize("aside", [-0.62, -0.55, -0.5, -0.45, 0.45, 0.5])
def test_an_array_that_the_border_cuts_is_never_read_wrongly(small: Path, aside: float) -> None:
    setup = seen_from(load_scene(small), [0.3 + aside, 3.2, 1.4], [0.3 + aside, 4.0, 1.4])
    view = render_view(setup, CaveConfig(str(small)), 0, 0.0)
    assert view.arrays.wrong == 0
    assert view.arrays.missed == ()


@pytest.mark.parametrize("gap_m", [0.16, 0.19, 0.22])
def test_arrays_closer_than_their_pitch_are_never_read_wrongly(small: Path, gap_m: float) -> None:
    paper, beside = f"paper_m = [{gap_m}, 0.2]\n", f"center_m = [{gap_m - 0.3:.3f}, 3.997, 1.4]"
    text = SMALL_CAVE.replace("turn_deg = 20\n", "").replace("center_m = [-0.3, 3", f"{paper}center_m = [-0.3, 3")
    small.write_text(text.replace("center_m = [0.25, 3.998, 1.5]", paper + beside))
    view = render_view(load_scene(small), CaveConfig(str(small)), 0, 0.0)
    assert view.arrays.wrong == 0
    assert view.markers.markers_found == view.markers.markers_in_view == 10


def test_blank_posters_and_full_blocks_say_nothing(small: Path) -> None:
    kept = [quad for quad in load_scene(small).scene.quads if not quad.name.startswith("array")]
    setup = load_scene(small)
    view = render_view(replace(setup, scene=replace(setup.scene, quads=tuple(kept))), CaveConfig(str(small)), 0, 0.0)
    assert [array.code for array in view.reading.arrays if array.code is not None] == []
    assert view.reading.pose is None
    assert view.pose_error is None
    polarity_figure(view)


def test_a_wall_seen_from_behind_shows_nothing(small: Path) -> None:
    setup = seen_from(load_scene(small), [0.0, 5.5, 1.4], [0.0, 4.0, 1.4])
    view = render_view(setup, CaveConfig(str(small)), 0, 0.0)
    assert view.reading.found.detections == ()
    assert (view.markers.markers_in_view, len(view.arrays.in_view), view.arrays.wrong) == (0, 0, 0)


def test_a_file_that_is_no_image_and_arrays_that_are_none_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "x.png").write_text("not an image")
    with pytest.raises(InputError, match=r"x\.png"):
        read_image(tmp_path / "x.png")
    for image in (np.zeros((0, 5), np.uint8), np.zeros((5, 5, 7), np.uint8), np.zeros(7, np.uint8)):
        with pytest.raises(InputError):
            decode_arrays(identify(image, polarity="both"), image=image)


def test_an_image_smaller_than_a_marker_holds_nothing() -> None:
    assert identify(np.zeros((3, 3), np.uint8), polarity="both") == ()


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    return runner(tmp_path, monkeypatch, capfd, "render_cave.py")


def test_the_script_prints_where_to_look(script: Run, small: Path, tmp_path: Path) -> None:
    done = script("--scene", str(small), "--out", str(tmp_path / "o"))
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[-1].endswith("o/report.html")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scene", "floor"), "--scene floor: expected posters with 3-bit arrays, found none"),
        (("--scene", "nowhere.toml"), "nowhere.toml: cannot be read"),
        (("--frames", "0"), "--frames: expected 1…100000, got 0"),
    ],
)
def test_bad_arguments_are_one_line_and_status_2_and_leave_nothing(
    script: Run, tmp_path: Path, arguments: tuple[str, str], message: str
) -> None:
    done = script("--out", str(tmp_path / "out"), *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("change", [{"seed": -1}, {"frames": 0}, {"renderer": "povray"}, {"rule": "best"}])
def test_faulty_configurations(change: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"--{next(iter(change))}: expected"):
        CaveConfig(**change)


def test_the_renderers_agree_on_what_is_read(small: Path) -> None:
    setup = load_scene(small)
    exact = render(setup.scene, setup.camera, setup.trajectory.at(0.0), renderer="exact")
    assert [a.code for a in decode_arrays(identify(exact.image, polarity="both"), image=exact.image)] == [3, 6]
