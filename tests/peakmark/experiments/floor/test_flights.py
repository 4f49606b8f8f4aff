"""Pooling over flights, pictures without markers, and the stretch table, each on a small sample."""

from pathlib import Path

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.floor import flight_results
from peakmark.experiments.floor.empty_images import bare_floors, photographs, silence
from peakmark.experiments.floor.flights import Flown, detected, flight_config, pooled, read_flight
from peakmark.experiments.floor.flights_results import headline, sections
from peakmark.experiments.floor.stretch_sweep import stretch_table


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> list[Flown]:
    out = tmp_path_factory.mktemp("flights")
    flights = []
    for ride, floor, seed in (("stroll", "brick", 1), ("bumpy", "coins", 2)):
        flight_results.run(flight_config(ride, floor, seed, 3), out / floor)
        flights.append(read_flight(out / floor))
    return flights


def test_counts_add_up_over_the_flights(flown: list[Flown]) -> None:
    result = pooled(flown)
    found = result["detection"]
    assert found["frames"] == 6
    assert found["recall"]["of"] == sum(f.result["detection"]["recall"]["of"] for f in flown)
    assert found["recall"]["value"] == found["precision"]["value"] == 1
    assert found["false"] == found["false_per_megapixel"] == 0
    assert result["pose"]["wrong"] == 0
    assert result["distance"]["refined"]["of"] <= found["precision"]["of"]
    for rows in result["breakdown"].values():
        assert sum(row["precision"]["of"] for row in rows) <= found["precision"]["of"]
        assert all(row["stands_out"]["of"] == row["precision"]["of"] for row in rows)
    assert [row["flight"] for row in result["flights"]] == ["brick", "coins"]
    assert headline(result)[0][1] == 1


def test_a_false_detection_counts_where_its_size_puts_it(flown: list[Flown]) -> None:
    table = dict(flown[0].detections)
    changed = {name: values.copy() for name, values in table.items()}
    changed["truth"][0], changed["true_distance_m"][0] = None, np.nan
    flight = Flown("x", flown[0].result, flown[0].frames, changed, flown[0].heights_m)
    assert detected(flight, "distance_m")[0] == changed["distance_scale_m"][0]
    tilts = detected(flown[0], "tilt_deg")
    assert ((tilts > 30) & (tilts < 80)).all()
    total = sum(row["precision"]["of"] for row in pooled([flight])["breakdown"]["side_px"])
    true = sum(row["stands_out"]["of"] for row in pooled([flight])["breakdown"]["side_px"])
    assert total - true == 1


def test_pictures_without_markers_stay_silent() -> None:
    photos, bare = silence(photographs((240,))), silence(bare_floors(1))
    assert photos["loud"] == bare["loud"] == []
    assert photos["photograph"] == {**photos["photograph"], "value": 1.0, "of": 36}
    assert bare["rendered"]["of"] == 3


def test_the_stretch_of_each_row_finds_most(flown: list[Flown]) -> None:
    rows = stretch_table(1)
    assert [row["stretch"] for row in rows] == ["1", "1.5", "2", "3", "of each row"]
    assert len({row["recall"]["of"] for row in rows}) == 1
    assert rows[-1]["recall"]["value"] >= max(row["recall"]["value"] for row in rows) - 0.1
    assert all(row["precision"]["value"] == 1 for row in rows)
    tables = sections({**pooled(flown), "stretch": rows})
    assert all(len(row) == len(s.table.head) for s in tables if s.table for row in s.table.rows)


def test_a_folder_without_a_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a finished flight"):
        read_flight(tmp_path)
