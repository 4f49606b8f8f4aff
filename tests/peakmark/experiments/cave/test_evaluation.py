"""The evaluation: records of real views, resuming, what its figures count, and the intervals."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.experiments.cave import evaluation as cave_evaluation
from peakmark.experiments.cave.evaluation import EvaluationConfig, evaluate, room_records
from peakmark.experiments.cave.evaluation_figures import figures, headline, quantiles, recall_by
from peakmark.experiments.cave.evaluation_results import write_evaluation

CONFIG = EvaluationConfig(rooms=1, views=2, split="training", seed=3)


def marker(side: float = 30.0, tilt: float = 10.0, **changes: Any) -> dict[str, Any]:
    values = {
        "name": "m",
        "side_px": side,
        "tilt_deg": tilt,
        "distance_m": 1.0,
        "is_in_view": True,
        "is_wanted": True,
        "is_found": True,
        "error_px": 0.1,
        "is_polarity_right": True,
        "is_signature_right": True,
    }
    return {**values, **changes}


MISSED = {"is_found": False, "error_px": None, "is_polarity_right": None, "is_signature_right": None}


def record(markers: list[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    values = {
        "room": 0,
        "features": 100,
        "false_detections": 1,
        "codes": [3],
        "wrong_codes": 0,
        "wrong_codes_by_paper": 2,
        "unsure": 0,
        "markers": markers,
        "arrays": [],
        "poses": [],
        "time_s": {"detect": 0.5},
    }
    return {**values, **changes}


def pose(kind: str, mm: float, deg: float = 0.1, flipped: bool = False, certain: bool = True) -> dict[str, Any]:
    return {"kind": kind, "arrays": 3, "mm": mm, "deg": deg, "is_flipped": flipped, "is_certain": certain}


def test_only_wanted_markers_count_and_polarity_only_of_found_ones() -> None:
    small = marker(12.0, is_wanted=False, is_polarity_right=False)
    markers = [marker(), marker(**MISSED), small, marker(is_signature_right=False)]
    result = figures([record(markers)])
    assert (result["recall"]["value"], result["recall"]["of"]) == (2 / 3, 3)
    assert (result["polarity_errors"]["value"], result["polarity_errors"]["of"]) == (0, 2)
    assert result["polarity_errors_by_signature"]["value"] == 0.5
    assert result["false_detections_per_view"] == 1


def test_wrong_codes_are_a_share_of_all_named_codes() -> None:
    array = {"name": "a", "side_px": 30, "tilt_deg": 1, "is_decoded": True, "is_decoded_by_paper": False}
    arrays = [array, {**array, "is_decoded": False}]
    result = figures([record([marker()], codes=[1, 2, 3, 4], wrong_codes=1, arrays=arrays)])
    assert (result["wrong_codes"]["value"], result["wrong_codes"]["of"]) == (0.25, 4)
    assert result["arrays_decoded"]["value"] == 0.5
    assert result["arrays_decoded_by_paper"]["value"] == 0
    assert result["wrong_codes"]["low"] < 0.25 < result["wrong_codes"]["high"]


def test_poses_by_kind_and_flips() -> None:
    poses = [pose("one", 1), pose("one", 300, 40, flipped=True, certain=False), pose("several", 2), pose("several", 4)]
    result = figures([record([marker()], poses=poses)])["pose"]
    assert result["several"]["mm"]["p50"] == 3
    assert result["one"]["flips"]["value"] == 0.5
    assert (result["one"]["flips_among_certain"]["value"], result["one"]["flips_among_certain"]["of"]) == (0, 1)
    assert (result["one"]["farther_than_5_deg"], result["several"]["farther_than_5_deg"]) == (1, 0)
    assert result["wall"]["mm"] == {"p50": None, "p95": None, "p99": None, "of": 0}


def test_every_figure_has_a_row_even_without_values() -> None:
    rows = headline(figures([record([marker()])]))
    assert {len(row) for row in rows} == {5}
    assert "pose from a wall (°) p99" in {row[0] for row in rows}


def test_bins_hold_each_marker_once() -> None:
    markers = [marker(side) for side in (8, 12, 15.9, 16, 24, 200)]
    rows = recall_by([record([*markers, marker(20, **MISSED), marker(20, is_in_view=False)])], "side_px")
    assert [(row["low"], row["recall"]["of"]) for row in rows] == [(0, 1), (12, 2), (16, 1), (20, 2), (70, 1)]
    assert next(row for row in rows if row["low"] == 20)["recall"]["value"] == 0.5


@settings(max_examples=15)
@given(st.lists(st.floats(0, 1e3), min_size=1, max_size=30))
def test_quantiles_lie_in_their_intervals_and_in_order(values: list[float]) -> None:
    result = quantiles(values)
    assert result["p50"] <= result["p95"] <= result["p99"] <= max(values)
    assert result["p95_interval"][0] - 1e-9 <= result["p95"] <= result["p95_interval"][1] + 1e-9
    assert quantiles(values) == result


def test_rooms_are_rendered_once_and_more_rooms_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rendered: list[int] = []

    def counted(config: EvaluationConfig, room: int) -> list[dict[str, Any]]:
        rendered.append(room)
        return [{"room": room, "seed": config.seed}]

    monkeypatch.setattr(cave_evaluation, "room_records", counted)
    done: list[int] = []
    for rooms in (2, 2, 3):
        records = evaluate(EvaluationConfig(rooms=rooms), tmp_path, 1, lambda: done.append(1))
        assert [r["room"] for r in records] == list(range(rooms))
    assert rendered == [0, 1, 2]
    assert len(done) == 7
    with pytest.raises(InputError, match="holds another evaluation"):
        evaluate(EvaluationConfig(rooms=2, seed=9), tmp_path)
    (tmp_path / "records" / "config.json").write_text("{")
    with pytest.raises(InputError, match="is damaged"):
        evaluate(EvaluationConfig(rooms=2), tmp_path)


@pytest.mark.slow
def test_real_views_are_scored_and_reported(tmp_path: Path) -> None:
    records = evaluate(CONFIG, tmp_path)
    assert records == json.loads((tmp_path / "records" / "room00000.json").read_text())
    result = write_evaluation(CONFIG, records, tmp_path)
    assert json.loads((tmp_path / "result.json").read_text())["views"] == len(records) == result["views"]
    assert result["recall"]["value"] == 1
    assert result["wrong_codes"]["value"] in (0, None)
    assert "All markers fully in view, by side_px" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_records_depend_on_the_seed_alone() -> None:
    first, again = ([{**r, "time_s": 0} for r in room_records(CONFIG, 0)] for _ in range(2))
    assert first == again


@pytest.mark.parametrize("change", [{"rooms": 0}, {"views": 0}, {"size": 1.5}, {"seed": -1}, {"split": "test"}])
def test_faulty_configurations(change: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"--{next(iter(change))}: expected"):
        EvaluationConfig(**change)
    with pytest.raises(InputError, match="--workers: expected 1 or more"):
        evaluate(EvaluationConfig(), tmp_path, 0)
