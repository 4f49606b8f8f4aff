import itertools

import pytest

from peakmark.errors import InputError
from peakmark.experiments.detectability.measure import (
    finished_rows,
    grouped_by_drawing,
    measure_point,
    measure_points,
    open_journal,
)
from peakmark.experiments.detectability.points import DetectabilityConfig, points

SMALL = DetectabilityConfig(trials=2, every=100, only=("noise", "exposure"))


def test_measure_finds_the_undistorted_markers_with_both_presets():
    for point in points(DetectabilityConfig(every=100, only=("noise",))):
        rows = measure_point(point, trials=4, seed=0)
        assert [row.detector for row in rows] == list(point.detectors)
        for row in rows:
            assert (row.found.detected.value, row.found.unique.value) == (1, 1)
            assert row.found.response_ratio == pytest.approx(1, abs=0.1)
            assert 0.1 < row.found.size_per_side.median < 1.3


def test_the_same_seed_gives_the_same_rows_in_any_process_and_an_interrupted_run_resumes(tmp_path):
    whole = open_journal(SMALL, tmp_path / "whole")
    rows = measure_points(SMALL, whole, workers=2)
    assert len(rows) == sum(len(point.detectors) for point in points(SMALL)) >= 2 * (2 + 2 + 1 + 1)

    lines = whole.path.read_text().splitlines()
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "journal.jsonl").write_text("\n".join(lines[:7]) + "\n" + lines[7][:50])  # as a killed run leaves it
    assert len(finished_rows(SMALL, open_journal(SMALL, broken))) < len(rows)
    seen = []
    again = measure_points(
        SMALL, open_journal(SMALL, broken), workers=1, on_point=lambda done, of: seen.append((done, of))
    )
    assert again == rows
    assert seen == [(6, 8), (7, 8), (8, 8)]

    first = points(SMALL)[0]
    assert measure_point(first, SMALL.trials, SMALL.seed) == rows[: len(first.detectors)]


def test_an_interrupt_keeps_the_finished_points(tmp_path):
    def stop(done, of):
        if done == 1:
            raise KeyboardInterrupt

    journal = open_journal(SMALL, tmp_path)
    with pytest.raises(KeyboardInterrupt):
        measure_points(SMALL, journal, workers=1, on_point=stop)
    assert len(finished_rows(SMALL, open_journal(SMALL, tmp_path))) == len(points(SMALL)[0].detectors)


def test_points_that_share_drawings_become_neighbours():
    config = DetectabilityConfig(every=3, only=("noise", "contrast", "jpeg", "defocus"))
    ordered = grouped_by_drawing(points(config))
    assert {point.name for point in ordered} == {point.name for point in points(config)}
    sceneries = [point.condition.scenery for point in ordered]
    changes = sum(a != b for a, b in itertools.pairwise(sceneries))
    assert changes + 1 == len(set(sceneries)) < len(sceneries) / 4


def test_nothing_finished_is_nothing_to_report(tmp_path):
    with pytest.raises(InputError, match="expected finished points, found none"):
        finished_rows(SMALL, open_journal(SMALL, tmp_path))


def test_a_faulty_detector_is_counted_and_the_run_continues():
    config = DetectabilityConfig(trials=2, every=100, only=("noise",), extra=("builtins:len",))
    row = measure_point(points(config)[0], 2, 0)[-1]
    assert row.detector == "builtins:len"
    assert row.found.failures == 2
    assert row.found.first_failure.startswith("InputError: detector: expected Keypoints")
    assert row.found.detected.value == 0
