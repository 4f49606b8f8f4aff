import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from peakmark.cli.app import app
from peakmark.cli.envelope import focal_length_px
from peakmark.errors import InputError


def test_the_command_says_how_far_and_draws_a_map(tmp_path):
    options = ["--camera", "2048x1536@1774", "--side-m", "0.08", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["envelope", *options])
    assert done.exit_code == 0, done.output
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["settings"]["focal_px"] == 1774
    square, *_, steepest = result["reach"]
    assert square["tilt_deg"] == 0
    assert square["farthest_m"] > steepest["farthest_m"] > 0
    assert f"{square['farthest_m']:.2f} m" in done.output
    assert (tmp_path / "envelope.png").stat().st_size > 5000
    assert (tmp_path / "envelope.svg").read_text().startswith("<?xml")


def test_twice_the_focal_length_or_the_side_is_twice_the_distance(tmp_path):
    farthest = []
    for camera, side in (("100x100@800", "0.08"), ("100x100@1600", "0.08"), ("100x100@800", "0.16")):
        out = tmp_path / f"{camera}-{side}"
        options = ["--camera", camera, "--side-m", side, "--out", str(out), "--quiet"]
        done = CliRunner().invoke(app, ["envelope", *options])
        assert done.output == ""
        farthest.append(json.loads((out / "result.json").read_text())["reach"][0]["farthest_m"])
    assert farthest[1] == pytest.approx(2 * farthest[0])
    assert farthest[2] == pytest.approx(2 * farthest[0])


def test_a_scenes_camera_is_taken_by_name():
    assert focal_length_px("floor") == pytest.approx(1774, rel=0.01)


@pytest.mark.parametrize("camera", ["no-such-scene", "2048@1774", "2048x1536@wide"])
def test_unknown_cameras_are_refused(camera):
    with pytest.raises(InputError, match=f"{camera}: cannot be read|expected a scene or .* got '{camera}'"):
        focal_length_px(camera)


@pytest.mark.parametrize("option", [["--marker", "orb"], ["--noise", "3"], ["--side-m", "0"], ["--required", "2"]])
def test_bad_options_are_refused_before_anything_is_written(tmp_path, option):
    done = CliRunner().invoke(app, ["envelope", "--out", str(tmp_path / "out"), *option])
    assert isinstance(done.exception, InputError)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("camera", ["2048x1536", "2048×1536", "640.0x480"])
def test_a_camera_without_focal_length_is_asked_for_it(camera: str) -> None:
    with pytest.raises(InputError, match=rf"--camera: expected .* WIDTHxHEIGHT@FOCAL_PX .*, got '{camera}'"):
        focal_length_px(camera)


@pytest.mark.parametrize("side", ["80", "0.0001", "nan"])
def test_a_side_in_another_unit_is_asked_about(tmp_path: Path, side: str) -> None:
    done = CliRunner().invoke(app, ["envelope", "--out", str(tmp_path / "out"), "--side-m", side])
    assert isinstance(done.exception, InputError)
    expected = f"--side-m: expected the printed side in metres, 0.001…5, got {side}; is it in mm or cm?"
    assert str(done.exception) == expected
    assert not (tmp_path / "out").exists()
