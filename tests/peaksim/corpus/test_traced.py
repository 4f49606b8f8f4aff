"""A corpus of path-traced frames: lamps of the scene file, and the same bytes whoever draws them."""

import json
from pathlib import Path

from peaksim.corpus import make_corpus
from peaksim.corpus.backends import processes

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
    make_corpus(spec, folder, str(tmp_path / "shared"), processes(2))
    assert contents(tmp_path / "alone") == contents(tmp_path / "shared")
    assert made.configuration.renderer == "traced"
    assert {"mitsuba", "drjit"} <= set(made.configuration.versions)
    record = json.loads(next((tmp_path / "alone" / "frames").rglob("*.json")).read_text())
    assert [light["kind"] for light in record["lights"]] == ["area", "environment"]
