"""Records: written, read, and the same; made for diffs; what is no record is one line."""

import json
from pathlib import Path

import pytest

from peakmark.errors import InputError
from peakmark.regress.record import from_text, read_record, to_text
from tests.peakmark.regress.helpers import frame, marker, missed, record, sound

MIXED = record(frame(0, marker(), missed()), frame(1, failure="timeout: no answer", drop=None, false_xy=None))


@pytest.mark.parametrize("whole", [MIXED, sound()], ids=["mixed", "sound"])
def test_what_is_written_is_read(whole: object) -> None:
    assert from_text(to_text(whole), "x") == whole  # type: ignore[arg-type]


def test_a_change_in_one_frame_is_a_change_in_its_line_and_in_those_of_its_figures() -> None:
    lines = [to_text(record(frame(0, marker()), frame(1, marker(error=e)))).splitlines() for e in (0.1, 0.2)]
    changed = [a for a, b in zip(*lines, strict=True) if a != b]
    assert [a for a in changed if '"frame": 1' in a]
    assert not [a for a in changed if '"frame": 0' in a]
    assert {a.split('"')[1] for a in changed} <= {"error, rms", "bias in x", "frame"}


def test_the_text_is_json_with_value_unit_direction_tolerance_and_interval() -> None:
    metrics = json.loads(to_text(sound()))["metrics"]
    assert all(set(m) == {"value", "unit", "direction", "tolerance", "relative", "interval"} for m in metrics.values())
    low, high = metrics["error, rms"]["interval"]
    assert low < metrics["error, rms"]["value"] < high


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected the record of a run"),
        ("[1]", "expected the record of a run"),
        ("{}", "expected the record of a run: KeyError"),
        ('{"format": "peakmark-regress-0"}', "expected a record of version 'peakmark-regress-1', got '.*-0'"),
        (to_text(sound()).replace('"frames": [', '"frames": [5,'), "expected the record of a run"),
        (to_text(sound()).replace('"xy": [50.0,', '"xy": ["left",'), "expected the record of a run"),
        (to_text(sound()).replace('"tolerances": {}', '"tolerances": 5'), "expected the record of a run"),
        (to_text(sound()).replace('"name": "markers", ', ""), "expected frames, and a detector with name"),
        (to_text(sound()).replace('"versions": {', '"versions": 5, "other": {'), "expected the record of a run"),
    ],
)
def test_what_is_no_record_is_one_line(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        from_text(text, "old run.json")
    assert str(caught.value).startswith("old run.json: ")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_or_no_text_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"run\.json: cannot be read: No such file"):
        read_record(tmp_path / "run.json")
    (tmp_path / "run.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"run\.json: expected the record of a run"):
        read_record(tmp_path / "run.json")
