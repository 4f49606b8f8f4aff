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


def changed(old: str, new: str) -> str:
    """Return a sound record's text with its first `old` replaced."""
    text = to_text(sound())
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected the record of a run"),
        ("[1]", "expected the record of a run"),
        ("{}", "expected the record of a run: format: missing field"),
        ('{"format": "peakmark-regress-0"}', "expected a record of version 'peakmark-regress-1', got '.*-0'"),
        (to_text(sound()).replace('"frames": [', '"frames": [5,'), "expected the record of a run"),
        (to_text(sound()).replace('"xy": [50.0,', '"xy": ["left",'), "expected the record of a run"),
        (to_text(sound()).replace('"tolerances": {}', '"tolerances": 5'), "expected the record of a run"),
        (
            to_text(sound()).replace('"name": "markers", ', ""),
            r"detector: expected a detector with name, .* \['name'\]",
        ),
        (to_text(sound()).replace('"versions": {', '"versions": 5, "other": {'), "expected the record of a run"),
        ("[" * 200_000, "expected the record of a run: maximum recursion depth"),
        (changed('"xy": [50.0,', '"xy": [NaN,'), "expected the record of a run: expected numbers, got NaN"),
        (changed('"xy": [50.0,', '"xy": [Infinity,'), "expected numbers, got Infinity"),
        (changed('"xy": [50.0,', '"xy": [1e999,'), r"frames\[0\]\.markers\.a\.xy\[0\]: .*got inf"),
        (changed('"xy": [50.0,', '"xy": [1e300,'), r"frames\[0\]\.markers\.a\.xy\[0\]: .*less than or equal to 34028"),
        (changed('"xy": [50.0,', f'"xy": [{10**400},'), r"frames\[0\]\.markers\.a\.xy\[0\]: "),
        (changed('"xy": [50.0,', f'"xy": [{"9" * 5000},'), "expected the record of a run: Exceeds the limit"),
        (changed('"xy": [50.0,', '"xy": ["50",'), r"frames\[0\]\.markers\.a\.xy\[0\]: .*valid number"),
        (changed('"xy": [50.0,', '"xy": [true,'), r"frames\[0\]\.markers\.a\.xy\[0\]: .*valid number"),
        (changed('"features": 500', f'"features": {10**400}'), r"frames\[0\]\.features: .*less than"),
        (changed('"features": 500', '"features": -1'), r"frames\[0\]\.features: .*greater than or equal to 0"),
        (changed('"polarity_is_right": true', '"polarity_is_right": "yes"'), "polarity_is_right: .*valid boolean"),
        (changed('"tolerances": {}', '"tolerances": {"recall": 1e999}'), "tolerances.recall: .*finite number, got inf"),
        (changed('"tolerances": {}', '"tolerances": {"recall": -1}'), "tolerances.recall: .*got -1"),
        (changed('"parameters": {}', '"parameters": {"threshold": 1e999}'), "detector.parameters.threshold"),
        (changed('"suite": "made-up"', '"suite": "\\ud800"'), "surrogates not allowed"),
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
