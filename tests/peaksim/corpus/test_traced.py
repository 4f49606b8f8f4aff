"""A corpus of path-traced frames: lamps of the scene file, and the same bytes whoever draws them."""

import json
from pathlib import Path

import numpy as np
from peaksim import render
from peaksim.camera import apply_sensor
from peaksim.corpus import make_corpus, open_corpus
from peaksim.corpus.backends import processes
from peaksim.corpus.plan import plan_frame

from tests.peaksim.corpus.helpers import SCENE, contents, tiny_spec
from tests.peaksim.traced.helpers import needs_tracing

LAMP = """
[[lights]]
kind = "area"
center_m = [0.0, 0.0, 2.0]
size_m = [0.6, 0.6]
radiance = 30.0

[[lights]]
kind = "environment"
radiance = 0.2
"""


@needs_tracing
def test_traced_frames_are_the_same_from_every_process(folder: Path, tmp_path: Path) -> None:
    (folder / "tiny.toml").write_text(SCENE + LAMP, encoding="utf-8")
    spec = tiny_spec(renderer="traced", samples=4, frames=6)
    made = make_corpus(spec, folder, str(tmp_path / "alone"))
    make_corpus(spec, folder, str(tmp_path / "shared"), processes(1))
    assert contents(tmp_path / "alone") == contents(tmp_path / "shared")
    assert made.configuration.renderer == "traced"
    assert {"mitsuba", "drjit"} <= set(made.configuration.versions)
    record = json.loads(next((tmp_path / "alone" / "frames").rglob("*.json")).read_text())
    assert [light["kind"] for light in record["lights"]] == ["area", "environment"]


@needs_tracing
def test_other_renderers_bake_the_lamps_of_a_corpus_unless_told_not_to(folder: Path, tmp_path: Path) -> None:
    (folder / "tiny.toml").write_text(SCENE + LAMP, encoding="utf-8")
    spec = tiny_spec(frames=3, sensor={})
    made = make_corpus(spec, folder, str(tmp_path / "baked"))
    left_out = make_corpus(tiny_spec(frames=3, sensor={}, bake=False), folder, str(tmp_path / "plain"))
    assert {"mitsuba", "drjit"} <= set(made.configuration.versions)
    assert "mitsuba" not in left_out.configuration.versions
    plan = plan_frame(spec, folder, 1)
    for name, bake in (("baked", True), ("plain", False)):
        own = render(plan.scene, plan.camera, plan.world_from_camera, "exact", bake=bake)
        expected = apply_sensor(own, plan.sensor, plan.noise()).image
        assert np.array_equal(open_corpus(str(tmp_path / name)).picture(1), expected)
    assert not np.array_equal(*(open_corpus(str(tmp_path / name)).picture(1) for name in ("baked", "plain")))
    make_corpus(spec, folder, str(tmp_path / "again"), processes(1))
    assert contents(tmp_path / "again") == contents(tmp_path / "baked")
