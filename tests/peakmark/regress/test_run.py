"""Running a suite: real frames, real detectors; planted faults are caught, and bad detectors cost frames at most."""

from dataclasses import replace
from pathlib import Path

import pytest

from peakmark.errors import InputError
from peakmark.regress.compare import compare_records
from peakmark.regress.record import Record, to_text
from peakmark.regress.run import Run, run_suite
from peakmark.regress.suite import Suite, load_suite
from tests.peakmark.regress.helpers import make_small_corpus
from tests.peakmark.regress.planted_faults import records_of, rendered
from tests.peaksim.corpus.helpers import child_environment
from tests.user_detectors import FAULTS

PARAMETERS = {"name": "markers", "stretch": 1.5}


@pytest.fixture(autouse=True)
def children_find_this_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", child_environment()["PYTHONPATH"])


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    return load_suite(make_small_corpus(tmp_path_factory.mktemp("a corpus's place")))


@pytest.fixture(scope="module")
def baseline(suite: Suite) -> Record:
    return run_suite(suite, suite.detector(**PARAMETERS)).record


def run(suite: Suite, quick: bool = False, **settings: object) -> Run:
    return run_suite(suite, suite.detector(**{**PARAMETERS, **settings}), quick=quick)


def faults(after: Record, before: Record) -> set[str]:
    return {change.metric.key for change in compare_records(after, before).faults}


def test_the_sound_detector_finds_nearly_everything_and_is_the_same_again(suite: Suite, baseline: Record) -> None:
    assert len(baseline.results) == 20
    found = [m.xy is not None for result in baseline.results for m in result.markers.values()]
    assert sum(found) / len(found) > 0.9
    assert to_text(run(suite).record) == to_text(baseline)
    assert faults(baseline, baseline) == set()


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"parameters": {"threshold": 200.0}}, "features"),
        ({"parameters": {"octaves": 3}}, "recall"),
        ({"name": "tests.user_detectors:half_pixel_shift"}, "bias in x"),
        ({"name": "tests.user_detectors:polarity_swapped"}, "wrong polarity"),
    ],
    ids=["threshold × 2", "one octave missing", "half a pixel", "polarity swapped"],
)
def test_a_planted_fault_is_caught(suite: Suite, baseline: Record, settings: dict[str, object], expected: str) -> None:
    assert expected in faults(run(suite, **settings).record, baseline)


@pytest.mark.slow
def test_20_seeds_raise_no_false_alarm_and_every_fault_is_caught_in_each() -> None:
    floor = load_suite("floor")
    scenes = rendered(floor, floor.frames(quick=True))
    before = records_of(floor, scenes, seed=1)["sound"]
    for seed in range(2, 22):
        after = records_of(floor, scenes, seed)
        assert faults(after["sound"], before) == set(), seed
        assert all(faults(after[fault], before) for fault in FAULTS), seed


def test_a_fault_of_the_detector_costs_its_frame(suite: Suite) -> None:
    record = run(suite, name="tests.user_detectors:fails_on_every_third", quick=True).record
    failed = [result for result in record.results if result.failure]
    assert 0 < len(failed) <= len(record.results) / 2
    assert all("RuntimeError: not today" in (result.failure or "") for result in failed)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        ("wrong_type", "expected answers, got none on 5 frames in a row: error: InputError: .*got dict"),
        ("always_nan", "expected answers, got none on 5 frames in a row: error: InputError: expected finite"),
        ("always_dies", "expected answers, got none on 5 frames in a row: crash: it ended with status 7"),
    ],
)
def test_a_detector_that_gives_no_answers_stops_the_run_in_one_line(suite: Suite, function: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        run(suite, name=f"tests.user_detectors:{function}")
    assert "\n" not in str(caught.value)


def test_an_empty_answer_of_a_detector_of_markers_is_no_detection(suite: Suite) -> None:
    results = run(suite, name="tests.user_detectors:detection_or_nothing").record.results
    assert {len(result.false_xy or ()) for result in results} == {0, 1}
    assert all(result.false_xy is not None for result in results)


def test_frames_of_a_corpus_have_their_noise(suite: Suite) -> None:
    with pytest.raises(InputError, match="--seed 5: expected none for frames that are read from a corpus"):
        run_suite(suite, suite.detector(**PARAMETERS), seed=5)


def test_reading_a_corpus_is_rendering_it(suite: Suite, baseline: Record, tmp_path: Path) -> None:
    table = suite.table.model_copy(update={"quick_frames": 3})
    quick = run_suite(Suite(table, Path()), suite.detector(**PARAMETERS), quick=True, images=tmp_path).record
    by_frame = {result.frame: result for result in baseline.results}
    assert [by_frame[result.frame] for result in quick.results] == list(quick.results)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{r.frame:08d}.jpg" for r in quick.results]


def test_another_seed_is_other_noise_on_the_same_views(suite: Suite) -> None:
    table = suite.table.model_copy(update={"quick_frames": 2})
    one, two = (
        run_suite(Suite(table, Path()), suite.detector(**PARAMETERS), quick=True, seed=seed).record for seed in (1, 2)
    )
    for a, b in zip(one.results, two.results, strict=True):
        assert a.picture != b.picture
        assert {name: m.true_xy for name, m in a.markers.items()} == {name: m.true_xy for name, m in b.markers.items()}
    assert replace(one, seed=0, results=()) == replace(two, seed=0, results=())
