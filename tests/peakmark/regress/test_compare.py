"""Comparing: every kind of change has its verdict, chance alone has none, and unlike things are not compared."""

from dataclasses import replace

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.regress.compare import Comparison, compare_records
from peakmark.regress.frame import ScoredFrame, ScoredMarker
from peakmark.regress.record import Record
from tests.peakmark.regress.helpers import frame, marker, missed, record, sound


def verdicts(comparison: Comparison) -> dict[str, str]:
    return {change.metric.key: change.verdict for change in comparison.changes if change.verdict != "same"}


def with_markers(change: dict[str, object], every: int = 1) -> Record:
    """Return the sound run with a change of the first marker of every so many frames."""
    frames = [
        replace(f, markers={**f.markers, "a": replace(f.markers["a"], **change)}) if i % every == 0 else f  # type: ignore[arg-type]
        for i, f in enumerate(sound().results)
    ]
    return replace(sound(), results=tuple(frames))


def test_a_run_is_the_same_as_itself() -> None:
    comparison = compare_records(sound(), sound())
    assert set(verdicts(comparison).values()) <= {"unknown"}
    assert comparison.faults == ()
    assert comparison.images_changed == 0


def test_missed_markers_are_worse_and_the_frames_that_show_them_are_named() -> None:
    lost = {"xy": None, "response": None, "polarity_is_right": None}
    worse = with_markers(lost, every=2)
    comparison = compare_records(worse, sound())
    assert verdicts(comparison)["recall"] == "worse"
    (recall,) = (c for c in comparison.faults if c.metric.key == "recall")
    assert len(recall.frames) == 3
    assert all(frame % 2 == 0 for frame in recall.frames)
    assert recall.change == pytest.approx(-0.25)
    better = compare_records(sound(), worse)
    assert verdicts(better)["recall"] == "better"
    assert not better.faults


@pytest.mark.parametrize(
    ("change", "key", "verdict"),
    [
        ({"xy": (50.5, 20.0)}, "bias in x", "changed"),
        ({"xy": (50.0, 19.4)}, "bias in y", "changed"),
        ({"polarity_is_right": False}, "wrong polarity", "worse"),
        ({"response": 500.0}, "response of markers", "changed"),
        ({"response": 2000.0}, "response of markers", "changed"),
    ],
)
def test_what_changed_of_markers_is_told(change: dict[str, object], key: str, verdict: str) -> None:
    assert verdicts(compare_records(with_markers(change), sound()))[key] == verdict


@pytest.mark.parametrize(
    ("change", "key", "verdict"),
    [
        ({"features": 400}, "features", "changed"),
        ({"drop": 1.1}, "drop to clutter", "worse"),
        ({"drop": 4.0}, "drop to clutter", "better"),
        ({"false_xy": ((3.0, 4.0),)}, "false detections", "worse"),
    ],
)
def test_what_changed_of_frames_is_told(change: dict[str, object], key: str, verdict: str) -> None:
    after = replace(sound(), results=tuple(replace(f, **change) for f in sound().results))  # type: ignore[arg-type]
    assert verdicts(compare_records(after, sound()))[key] == verdict


@pytest.mark.filterwarnings("error")
def test_more_than_nothing_is_a_change() -> None:
    before = replace(sound(), results=tuple(replace(f, features=0) for f in sound().results))
    assert verdicts(compare_records(sound(), before))["features"] == "changed"


def test_frames_without_an_answer_are_worse() -> None:
    after = [replace(f, failure="timeout", markers={"a": missed()}) if f.frame % 2 else f for f in sound().results]
    assert (
        verdicts(compare_records(replace(sound(), results=tuple(after)), sound()))["frames without an answer"]
        == "worse"
    )


def test_a_change_within_the_tolerance_or_in_one_frame_is_none() -> None:
    assert compare_records(with_markers({"xy": (50.05, 20.0)}), sound()).faults == ()
    assert compare_records(with_markers({"response": 100.0}, every=20), sound()).faults == ()


def test_chance_raises_no_alarm() -> None:
    """Thirty pairs of runs that differ by noise alone: errors, responses, and one miss in fifty, in each anew."""
    rng = np.random.default_rng(0)

    def noisy() -> Record:
        return record(
            *(
                frame(
                    i,
                    *(noisy_marker() for _ in range(3)),
                    features=int(rng.normal(500, 15)),
                    drop=float(rng.lognormal(1, 0.1)),
                )
                for i in range(40)
            )
        )

    def noisy_marker() -> ScoredMarker:
        found = marker(error=rng.normal(0, 0.2), response=float(rng.lognormal(7, 0.1)))
        return found if rng.random() > 0.02 else missed()

    alarms = [c for _ in range(30) for c in compare_records(noisy(), noisy()).faults]
    assert len(alarms) <= 1


def test_what_no_frame_tells_is_unknown() -> None:
    silent = record(*(ScoredFrame(i, "x", markers={"a": missed()}) for i in range(3)))
    assert verdicts(compare_records(silent, silent))["false detections"] == "unknown"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"suite": "cave"}, "baseline: expected one of suite 'made-up', got one of 'cave'"),
        ({"suite_sha256": "1" * 64}, "the suite has changed since"),
        ({"results": sound(5).results}, "expected one of the same 20 frames, got 5: quick runs need a quick baseline"),
    ],
)
def test_unlike_things_are_not_compared(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        compare_records(sound(), replace(sound(), **change))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
