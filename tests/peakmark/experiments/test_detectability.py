import json

import pytest

from peakmark.errors import InputError
from peakmark.experiments.detectability import measure, run
from peakmark.experiments.detectability_journal import Journal
from peakmark.experiments.detectability_points import EXPERIMENTS, Config, points

SMALL = Config(trials=2, every=100, only=("noise", "turn"))


def test_points_have_unique_names_and_every_thins_them():
    everything = points(Config())
    assert len({point.name for point in everything}) == len(everything)
    assert {point.experiment for point in everything} == set(EXPERIMENTS)
    assert len(points(Config(every=4))) < len(everything) / 3


def test_paper_mode_looks_once_at_centred_markers():
    assert all(point.condition.is_centred for point in points(Config(is_paper=True)))


def test_measure_finds_the_undistorted_markers_with_both_presets():
    for point in points(Config(every=100, only=("noise",))):
        rows = measure(point, trials=4, seed=0)
        assert [row["detector"] for row in rows] == list(point.detectors)
        for row in rows:
            assert (row["detected"], row["unique"]) == (1, 1)
            assert row["response_ratio"] == pytest.approx(1, abs=0.1)
            assert 0.1 < row["size_per_side"] < 1.3


def test_the_same_seed_gives_the_same_rows_in_any_process_and_an_interrupted_run_goes_on(tmp_path):
    whole = Journal(tmp_path / "whole" / "points.jsonl", SMALL)
    rows = run(SMALL, whole, workers=1)
    assert len(rows) == 2 * (2 + 2 + 1 + 1)

    lines = whole.path.read_text().splitlines()
    broken = tmp_path / "broken" / "points.jsonl"
    broken.parent.mkdir()
    broken.write_text("\n".join(lines[:4]) + "\n" + lines[4][:50])  # as a killed run leaves it
    seen = []
    again = run(SMALL, Journal(broken, SMALL), workers=1, on_point=lambda done, of: seen.append((done, of)))
    assert again == rows
    assert seen[0] == (3, 8)
    assert seen[-1] == (8, 8)

    first = points(SMALL)[0]
    assert json.loads(json.dumps(measure(first, SMALL.trials, SMALL.seed))) == rows[: len(first.detectors)]


def test_a_run_of_another_configuration_is_not_mixed_in(tmp_path):
    Journal(tmp_path / "points.jsonl", SMALL).open()
    with pytest.raises(InputError, match=r"expected a run of .* found one of "):
        Journal(tmp_path / "points.jsonl", Config(trials=3)).open()


def test_a_faulty_detector_is_counted_and_the_run_goes_on():
    config = Config(trials=2, every=100, only=("noise",), extra=("builtins:len",))
    row = measure(points(config)[0], 2, 0)[-1]
    assert row["detector"] == "builtins:len"
    assert row["failures"] == 2
    assert row["first_failure"].startswith("InputError: detector: expected Keypoints")
    assert row["detected"] == 0


@pytest.mark.parametrize(
    "changes", [{"trials": 0}, {"every": 0}, {"seed": -1}, {"only": ("luck",)}, {"extra": ("orb",)}]
)
def test_bad_configurations_are_refused(changes):
    with pytest.raises(InputError, match=r"expected .* got "):
        Config(**changes)
