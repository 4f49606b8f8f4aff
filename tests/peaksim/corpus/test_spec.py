"""Specifications: the shipped example, overrides, a round trip through JSON, and contradictions said in one line."""

from pathlib import Path
from typing import Any

import pytest
from peaksim import shipped
from peaksim.corpus.check_spec import check_spec
from peaksim.corpus.spec import CorpusSpec, load_spec, spec_from_json, spec_to_json
from peaksim.errors import InputError, SceneError

from tests.peaksim.corpus.helpers import BASE

EXAMPLE = shipped.SCENES / "experiments" / "corpus_small.toml"


def test_the_example_is_sound_and_as_large_as_it_says() -> None:
    spec = load_spec(EXAMPLE)
    check_spec(spec, EXAMPLE.parent)
    assert (spec.frames, {(c.width, c.height) for c in spec.cameras}) == (200, {(320, 240)})


def test_seed_and_frames_can_be_replaced() -> None:
    spec = load_spec(EXAMPLE, seed=7, frames=3)
    assert (spec.seed, spec.frames) == (7, 3)
    assert spec.model_copy(update={"seed": 2009, "frames": 200}) == load_spec(EXAMPLE)


def test_json_gives_the_specification_back() -> None:
    spec = load_spec(EXAMPLE)
    assert spec_from_json(spec_to_json(spec)) == spec
    with pytest.raises(InputError, match="specification of a corpus"):
        spec_from_json('{"name": "x"}')


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("read_noise = [5, 1]", r"sensor.read_noise: expected low ≤ high, got 5 and 1"),
        ("vignetting = [0.5, 1.5]", r"sensor: vignetting: expected a number in 0…1, got 1.5"),
        ("bits = [1, 8]", r"sensor: bits: expected whole numbers"),
        ("reed_noise = 3", r"sensor.reed_noise: unknown field \(did you mean 'read_noise'\?\)"),
        ('read_noise = "much"', r"sensor.read_noise: expected a number, a pair"),
    ],
)
def test_a_faulty_file_is_one_line_with_file_and_field(tmp_path: Path, line: str, words: str) -> None:
    text = EXAMPLE.read_text(encoding="utf-8").split("[sensor]")[0] + f"[sensor]\n{line}\n"
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=f"bad.toml: {words}") as caught:
        load_spec(tmp_path / "bad.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"frames": 0}, "frames"),
        ({"frames": 10**9}, "frames"),
        ({"seed": -1}, "seed"),
        ({"name": "../up"}, "name"),
        ({"scenes": []}, "scenes"),
        ({"scenes": [{"file": "tiny.toml", "weight": 0}]}, "scenes: expected at least one positive weight"),
        ({"views": [{"kind": "sideways"}]}, "sideways"),
        ({"views": [{"kind": "marker", "distance_m": [0, 1]}]}, "0.0001…10000, got 0…1"),
        ({"views": [{"kind": "marker", "distance_m": 1, "tilt_deg": [0, 90]}]}, "without 90"),
        ({"store": {"files": False, "shards": False}}, "neither"),
        ({"store": {"shard_frames": 3, "part_frames": 10}}, "multiple of shard_frames, got 10 and 3"),
        ({"cameras": [BASE["cameras"][0]] * 2}, "different names, got 'cam' more than once"),
        ({"cameras": [{**BASE["cameras"][0], "count": 2}, {**BASE["cameras"][0], "name": "cam-001"}]}, "got 'cam-001'"),
        ({"cameras": [{"name": "a/b", "width": 8, "height": 8, "fx": 9}]}, "name"),
        ({"light": {"ambient": 1, "elevation_deg": [-10, 20]}}, "elevation_deg: expected above 0 up to 90"),
        ({"markers": {"keep": [0, 2]}}, "expected values in 0…1, got 0…2"),
        ({"markers": {"side_factor": [0, 2]}}, "side_factor: expected positive"),
        ({"clutter": {"boxes": [0, 3]}}, "whole numbers"),
        ({"samples": 0}, "samples"),
        ({"bends": {"radius_sides": [0.2, 1]}}, "radius_sides: expected at least 0.4, got 0.2"),
        ({"warped": {}}, "scenes: expected none beside \\[warped\\]"),
        ({"warped": {}, "scenes": [], "views": [], "cameras": []}, "cameras: expected at least one beside"),
        ({"warped": {"tilt_deg": [0, 90]}}, "without 90"),
        ({"views": []}, "views: expected at least one, or \\[warped\\], got none"),
        ({"light": {"ambient": 1, "lamps": [0, 2]}}, r"lamps\n.*whole numbers"),
        ({"prints": {"black": [0.1, 0.8]}}, "expected black below white, got up to 0.8 and from 0.75 on"),
        ({"occluders": {"cover": [0.5, 1.2]}}, r"occluders.cover\n.* 0…1, got 0.5…1.2"),
        ({"sensor": {"presets": ["telephone"]}}, "preset: expected one of machine-vision-linear, .*, got 'telephone'"),
        ({"sensor": {"presets": []}}, "presets: expected at least one, got none"),
        ({"sensor": {"tone": ["srgb", "log"]}}, "tone: expected one of linear, srgb, .*, got 'log'"),
        ({"sensor": {"mosaic": ["rrgb"]}}, "mosaic: expected one of none, rggb, .*, got 'rrgb'"),
        ({"sensor": {"bits": [8, 10]}}, "bits: expected whole numbers"),
        ({"sensor": {"jpeg_quality": 101}}, "jpeg_quality: expected a whole number in 0…100, got 101"),
    ],
    ids=str,
)
def test_a_contradiction_inside_the_specification_is_refused(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        CorpusSpec.model_validate({**BASE, **fields})


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"scenes": [{"file": "nothing.toml"}]}, "nothing.toml: cannot be read"),
        (
            {"scenes": [{"file": "../../etc/passwd"}]},
            "scenes.file: expected a path inside specs/, got '../../etc/passwd'",
        ),
        ({"scenes": [{"file": "/etc/passwd"}]}, "scenes.file: expected a path inside specs/, got '/etc/passwd'"),
        ({"scenes": [{"file": "a\0b"}]}, r"scenes.file: expected a path, got 'a\\x00b'"),
        ({"views": [{"kind": "flight", "file": "../poses.txt"}]}, "views.file: expected a path inside specs/, got"),
        ({"textures": {"lawn": {"mean": 3}}}, r"textures.lawn: expected a texture of the scenes \(floor, wall\)"),
        ({"markers": {"kinds": ["sift-dark-none"]}}, "tiny.toml: markers.* expected one of .*surf-dark"),
        ({"markers": {"shift_m": [-0.9, 0.9]}}, "tiny.toml: markers: expected shifts .* keep every marker in the room"),
        (
            {"views": [{"kind": "marker", "distance_m": 1, "min_markers": 4}]},
            "views: .* at least 4 markers, this one has 3",
        ),
        ({"views": [{"kind": "marker", "distance_m": 90}]}, "frame 0: views: expected a view .* inside the room"),
        (
            {"views": [{"kind": "random", "eye_m": [0, 0, [2, 3]], "target_m": [0, 0, 0]}]},
            r"views\[0\].eye_m: expected z inside the room 0…1.5, got 2…3",
        ),
        (
            {"sensor": {"presets": ["phone"], "bits": 10}},
            "tiny.toml: sensor.jpeg_quality: expected 0 with more than 8 bits, got 90",
        ),
        (
            {"sensor": {"bits": 10}, "pictures": {"format": "jpeg"}},
            "tiny.toml: pictures.format: expected png for a sensor of 10 bits, got jpeg",
        ),
        ({"cameras": [{**BASE["cameras"][0], "fx": 0.3}]}, "cameras.cam: camera: fx: expected px, at least"),
        ({"cameras": [{**BASE["cameras"][0], "distortion": [-2, 0, 0, 0]}]}, "cameras.cam: camera: distortion"),
    ],
    ids=str,
)
def test_a_contradiction_between_specification_and_scene_is_refused(
    folder: Path, fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(SceneError, match=words):
        check_spec(CorpusSpec.model_validate({**BASE, **fields}), folder)
