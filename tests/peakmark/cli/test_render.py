"""`peakmark render`: images, truth, calibration and poses that agree with the library's own, and feed `identify`."""

import json
from pathlib import Path

import numpy as np
import pytest
from peaksim import Camera, load_scene, load_trajectory, render
from peaksim.camera.sensor import apply_sensor
from PIL import Image

from tests.peakmark.cli.running import runner
from tests.peaksim.corpus.helpers import write_tiny_scene


def test_what_it_writes_is_what_the_library_renders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = write_tiny_scene(tmp_path / "specs") / "tiny.toml"
    done = runner(tmp_path, monkeypatch, capfd)("render", scene, "--frames", 2, "--renderer", "exact", "--seed", 3)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "2 images by exact\nResults: out/render\n"
    setup = load_scene(scene)
    folder = tmp_path / "out" / "render"
    times = setup.trajectory.times_s
    poses = load_trajectory(folder / "poses.tum")
    assert poses.times_s.tolist() == [times[0], times[-1]]
    lines = [json.loads(line) for line in (folder / "truth.jsonl").read_text(encoding="utf-8").splitlines()]
    frame = render(setup.scene, setup.camera, poses.world_from_camera[1], "exact", float(times[-1]), seed=(3, 1))
    frame = apply_sensor(frame, setup.sensor, np.random.default_rng((3, 1)))
    assert np.array_equal(np.asarray(Image.open(folder / lines[1]["image"])), frame.image)
    for line, marker in zip(lines[1]["markers"], frame.truth, strict=True):
        assert line["name"] == marker.name
        seen = [np.nan if x is None else x for x in line["center_xy"]]
        assert np.allclose(seen, marker.center_xy, equal_nan=True)
    assert np.allclose(Camera.load(folder / "camera.yaml").matrix, setup.camera.matrix)


def test_bad_input_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    run = runner(tmp_path, monkeypatch, capfd)
    for arguments, words in (
        (["none"], "none: cannot be read"),
        (["cave", "--frames", "0"], "--frames: expected 1…100000, got 0"),
        (["cave", "--renderer", "blender"], "--renderer: expected auto, exact, gl, pyrender or traced, got blender"),
    ):
        done = run("render", *arguments)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert words in done.stderr
    assert list(tmp_path.iterdir()) == []
