"""The tools that set our images beside those of another renderer: a scene of ours comes back as it was."""

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture, render
from peaksim.corpus import make_corpus
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.scene.scene import Mark

from tests.peaksim.corpus.helpers import tiny_spec, write_tiny_scene
from tests.places import ROOT


def tool(name: str) -> ModuleType:
    """Import one of the tools, which are no package."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def row_of_ours() -> tuple[dict[str, Any], Camera]:
    """Return a line of truth.json of five markers on a floor, of two sizes, seen at 50° of tilt."""
    camera = Camera(640, 480, 600.0)
    white = Texture.from_array(np.full((2, 2), 255, np.uint8))
    quads = tuple(
        Quad(name, white, (side, side), compose(rotation_about("z", 37.0 * k), [x, y, 0]), Mark(name, "dark", side))
        for k, (name, side, x, y) in enumerate(
            [
                ("a", 0.1, 0, 0),
                ("b", 0.1, 0.2, 0.1),
                ("c", 0.15, -0.25, 0.2),
                ("d", 0.1, 0.1, 0.4),
                ("e", 0.15, -0.2, -0.1),
            ]
        )
    )
    truth = render(Scene(quads), camera, look_at([0.1, -0.9, 0.8], [0, 0.1, 0]), "exact").truth
    markers = [
        {"polarity": "dark", "xy": m.center_xy.tolist(), "corners": m.corners_xy.tolist(), "side_px": m.side_px}
        | {"tilt_deg": m.tilt_deg, "visible": 1.0, "inside": 1.0, "bent": None, "code": None, "group": m.name}
        for m in truth
    ]
    row = {"file": "traced/x.srgb.png", "kind": "floor", "condition": "plain", "version": "srgb", "focal_px": 600.0}
    return {**row, "markers": markers, "tags": []}, camera


def test_a_scene_is_rebuilt_where_it_was_seen() -> None:
    twins = tool("twin_scenes")
    row, camera = row_of_ours()
    plane = twins.plane_of(row, camera)
    scene = twins.scene_of(row, plane, 0)
    frame = render(scene, camera, plane.world_from_camera, "exact", bake=False)
    again = twins.truth_row(row, frame, "srgb", "x.png")["markers"]
    assert len(again) == 5
    for before, after in zip(row["markers"], again, strict=True):
        assert np.allclose(after["corners"], before["corners"], atol=0.5)  # prints lie half a millimetre on their plane
        assert after["side_px"] == pytest.approx(before["side_px"], rel=0.005)
        assert after["tilt_deg"] == pytest.approx(before["tilt_deg"], abs=0.1)


def test_a_corpus_becomes_truth_of_the_same_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_tiny_scene(tmp_path / "specs")
    spec = tiny_spec(frames=2, sensor={"presets": ["dslr"]}, store={"shard_frames": 2, "part_frames": 2})
    make_corpus(spec, folder, str(tmp_path / "corpus"))
    monkeypatch.setattr(sys, "argv", ["corpus_truth.py", str(tmp_path / "corpus"), "--out", str(tmp_path / "out")])
    tool("corpus_truth").main()
    rows = json.loads((tmp_path / "out" / "truth.json").read_text())
    assert [(row["condition"], row["version"]) for row in rows] == [("tiny.toml", "dslr")] * 2
    assert all((tmp_path / "out" / row["file"]).is_file() and row["markers"] for row in rows)
    assert {"polarity", "xy", "side_px", "tilt_deg", "visible", "inside", "bent"} <= set(rows[0]["markers"][0])
