"""Pooling over flights on a small sample, and where a detection counts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peakmark.experiments.floor.flight_figures import FlightResult
from peakmark.experiments.floor.flight_results import fly_and_keep
from peakmark.experiments.floor.flight_tracking import Flown, distances
from peakmark.experiments.floor.flights import PooledFigures, breakdown, detected_values, flight_config, pooled
from peakmark.experiments.floor.flights_results import FlightsResult, headline, run_flights, sections
from peakmark.experiments.floor.stretch_sweep import stretch_row
from peakmark.plain import to_plain


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Flown, FlightResult]]:
    out = tmp_path_factory.mktemp("flights")
    sample = (("stroll", "brick", 1), ("bumpy", "coins", 2))
    return [fly_and_keep(flight_config(*one, 3), out / one[1])[:2] for one in sample]


@pytest.fixture(scope="module")
def result(finished: list[tuple[Flown, FlightResult]]) -> PooledFigures:
    return pooled([flown for flown, _ in finished], [result for _, result in finished])


def test_counts_add_up_over_the_flights(result: PooledFigures, finished: list[tuple[Flown, FlightResult]]) -> None:
    found = result.detection
    assert found.frames == 6
    assert found.recall.of == sum(one.detection.recall.of for _, one in finished)
    assert found.recall.value == found.precision.value == 1
    assert found.false == found.false_per_megapixel == 0
    assert result.pose.wrong == 0
    assert result.distance["refined"].of <= found.precision.of
    for rows in result.breakdown.values():
        assert sum(row.precision.of for row in rows) <= found.precision.of
        assert all(row.stands_out.of == row.precision.of for row in rows)
    assert [row.flight for row in result.flights] == ["brick", "coins"]


def test_one_flight_pooled_has_its_own_figures(finished: list[tuple[Flown, FlightResult]]) -> None:
    flown, own = finished[0]
    alone = pooled([flown], [own])
    assert (alone.detection, alone.pose) == (own.detection, own.pose)
    for quantity, rows in own.recall_by.items():
        assert [(r.low, r.high, r.recall) for r in alone.breakdown[quantity]] == [
            (r.low, r.high, r.recall) for r in rows
        ]


def test_a_false_detection_counts_where_its_size_puts_it(finished: list[tuple[Flown, FlightResult]]) -> None:
    flown = finished[0][0]
    frame, height_m = flown.frames[0], float(flown.heights_m[0])
    first, *others = frame.record.detections
    record = replace(frame.record, detections=(replace(first, marker=None), *others))
    changed = replace(flown, frames=[replace(frame, record=record), *flown.frames[1:]])
    by_scale = distances(record, flown.camera, flown.floor_map, height_m)["scale"]
    assert detected_values(changed, record, height_m, "distance_m")[0] == by_scale[0]
    tilts = detected_values(flown, frame.record, height_m, "tilt_deg")
    assert ((tilts > 30) & (tilts < 80)).all()
    rows = breakdown([changed], "side_px")
    assert sum(row.precision.of for row in rows) - sum(row.stands_out.of for row in rows) == 1


def test_tables_and_result_have_what_was_pooled(result: PooledFigures) -> None:
    whole = FlightsResult(result, {}, [stretch_row("2", [])])
    assert headline(whole)[0][1] == 1
    assert all(len(row) == len(s.table.head) for s in sections(whole) if s.table for row in s.table.rows)
    plain = to_plain(whole)
    assert list(plain) == ["detection", "breakdown", "distance", "pose", "flights", "blank", "stretch"]
    assert "localisation_px" not in plain["detection"]
    assert np.isfinite(plain["detection"]["response_drop"]["p50"])


def test_an_interrupted_evaluation_does_not_fly_its_finished_flights_again(tmp_path: Path) -> None:
    def give_up(stage: str) -> None:
        if not stage.startswith("fly"):
            raise KeyboardInterrupt

    kept = []
    for is_resumed in (False, True):
        with pytest.raises(KeyboardInterrupt):
            run_flights(tmp_path, 2, is_resumed, (("stroll", "brick", 1),), give_up)
        journal = tmp_path / "stroll-brick-1" / "journal.jsonl"
        kept.append(journal.read_text())
        assert not (journal.parent / "journal").exists()
    assert kept[0] == kept[1]
    assert len(kept[0].splitlines()) == 1 + 2 + 1
