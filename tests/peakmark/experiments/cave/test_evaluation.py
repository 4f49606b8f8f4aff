"""The evaluation: records of real views, resuming, workers, what its figures count, and the intervals."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from peakmark.errors import InputError
from peakmark.experiments.cave.evaluation import (
    ArrayRecord,
    EvaluationConfig,
    PoseKind,
    PoseRecord,
    ViewRecord,
    evaluate,
    room_records,
)
from peakmark.experiments.cave.evaluation_results import (
    bin_row,
    evaluation_figures,
    headline,
    recall_by,
    write_evaluation,
)
from peakmark.experiments.cave.walk import COUNTS, CaveFrame, Counts
from peakmark.plain import to_plain
from peakmark.score.markers import MarkerScore

CONFIG = EvaluationConfig(rooms=1, views=2, split="training", seed=7)
TINY = EvaluationConfig(rooms=2, views=1, split="training", size=0.4, seed=0)


def marker(side: float = 30.0, **changes: Any) -> MarkerScore:
    found = MarkerScore("m", side, 10.0, 1.0, True, True, True, 0.1, True, True)
    return replace(found, **changes)


MISSED = {"is_found": False, "error_px": None, "is_polarity_right": None, "is_signature_right": None}


def record(
    markers: list[MarkerScore], codes: tuple[int, ...] = (3,), wrong_codes: int = 0, **changes: Any
) -> ViewRecord:
    counts = {"false_detections": 1, "wrong_codes": wrong_codes, "wrong_codes_by_paper": 2}
    frame = CaveFrame(
        frame=0,
        time_on_path_s=0.0,
        features=100,
        counts=Counts(**{**dict.fromkeys(COUNTS, 0), **counts}),
        codes=codes,
        missed=(),
        pose_mm=None,
        pose_deg=None,
        pose_is_certain=None,
        rank_of_last_marker=None,
        response_drop=None,
        time_s={"detect": 0.5},
    )
    return replace(ViewRecord(0, "640×480", frame, tuple(markers), (), ()), **changes)


def pose(kind: PoseKind, mm: float, deg: float = 0.1, flipped: bool = False, certain: bool = True) -> PoseRecord:
    return PoseRecord(kind, 3, mm, deg, flipped, certain)


def test_only_wanted_markers_count_and_polarity_only_of_found_ones() -> None:
    small = marker(12.0, is_wanted=False, is_polarity_right=False)
    markers = [marker(), marker(**MISSED), small, marker(is_signature_right=False)]
    result = evaluation_figures([record(markers)])
    assert (result.recall.value, result.recall.of) == (2 / 3, 3)
    assert (result.polarity_errors.value, result.polarity_errors.of) == (0, 2)
    assert result.polarity_errors_by_signature.value == 0.5
    assert result.false_detections_per_view == 1


def test_wrong_codes_are_a_share_of_all_named_codes() -> None:
    array = ArrayRecord("a", 30, 1, is_decoded=True, is_decoded_by_paper=False)
    arrays = (array, replace(array, is_decoded=False))
    result = evaluation_figures([record([marker()], codes=(1, 2, 3, 4), wrong_codes=1, arrays=arrays)])
    assert (result.wrong_codes.value, result.wrong_codes.of) == (0.25, 4)
    assert result.arrays_decoded.value == 0.5
    assert result.arrays_decoded_by_paper.value == 0
    assert result.wrong_codes.low < 0.25 < result.wrong_codes.high


def test_poses_by_kind_and_flips() -> None:
    poses = (pose("one", 1), pose("one", 300, 40, flipped=True, certain=False), pose("several", 2), pose("several", 4))
    figures = evaluation_figures([record([marker()], poses=poses)])
    result = figures.pose
    assert result["several"].mm[50] == 3
    assert result["one"].flips.value == 0.5
    assert (result["one"].flips_among_certain.value, result["one"].flips_among_certain.of) == (0, 1)
    assert (result["one"].farther_than_5_deg, result["several"].farther_than_5_deg) == (1, 0)
    assert to_plain(figures)["pose"]["wall"]["mm"] == {"p50": None, "p95": None, "p99": None, "of": 0}


def test_every_figure_has_a_row_even_without_values() -> None:
    rows = headline(evaluation_figures([record([marker()])]))
    assert {len(row) for row in rows} == {5}
    assert "pose from a wall (°): p99" in {row[0] for row in rows}
    assert {len(row) for row in headline(evaluation_figures([]))} == {5}


def test_bins_hold_each_marker_once() -> None:
    markers = [marker(side) for side in (8, 12, 15.9, 16, 24, 200)]
    rows = recall_by([record([*markers, marker(20, **MISSED), marker(20, is_in_view=False)])], "side_px")
    assert [(row.low, row.recall.of) for row in rows] == [(0, 1), (12, 2), (16, 1), (20, 2), (70, 1)]
    (twenty,) = [bin_row(row) for row in rows if row.low == 20]
    assert twenty["recall"].value == 0.5
    assert (twenty["high"], twenty["error_px_p95"]) == (25, 0.1)


def without_times(records: list[ViewRecord]) -> list[ViewRecord]:
    return [replace(record, frame=replace(record.frame, time_s={})) for record in records]


def test_records_are_equal_with_one_worker_and_two_and_more_rooms_extend_a_run(tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []

    def on_room(done: int, of: int) -> None:
        steps.append((done, of))

    both = evaluate(TINY, tmp_path / "two", 2, on_room)
    assert {record.room for record in both} == {0, 1}
    assert sum(len(record.markers) for record in both) > 5
    assert sum(len(record.poses) for record in both) > 0
    first = evaluate(replace(TINY, rooms=1), tmp_path / "one", 1, on_room)
    alone = evaluate(TINY, tmp_path / "one", 1, on_room)
    assert without_times(alone) == without_times(both)
    assert alone[: len(first)] == first
    assert evaluate(TINY, tmp_path / "one", 1, on_room) == alone
    assert steps == [(0, 2), (1, 2), (2, 2), (0, 1), (1, 1), (1, 2), (2, 2), (2, 2)]
    assert without_times(first) == without_times(room_records(TINY, 0))


def test_another_evaluation_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "journal.jsonl").write_text(json.dumps({**asdict(TINY), "seed": 9}) + "\n")
    with pytest.raises(InputError, match="another configuration: seed was 9, is 0"):
        evaluate(TINY, tmp_path)
    (tmp_path / "journal.jsonl").write_text("{")
    with pytest.raises(InputError, match="is damaged"):
        evaluate(TINY, tmp_path)


def test_real_views_are_scored_and_reported(tmp_path: Path) -> None:
    records = evaluate(CONFIG, tmp_path)
    write_evaluation(CONFIG, records, tmp_path)
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["views"] == len(records)
    assert (result["recall"]["value"], result["recall"]["of"]) == (1, 16)
    assert (result["wrong_codes"]["value"], result["wrong_codes"]["of"]) == (0, 5)
    assert "All markers fully in view, by side_px" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("change", [{"rooms": 0}, {"views": 0}, {"size": 1.5}, {"seed": -1}, {"split": "test"}])
def test_faulty_configurations(change: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"--{next(iter(change))}: expected"):
        EvaluationConfig(**change)
    with pytest.raises(InputError, match="--workers: expected 1…1024, got 0"):
        evaluate(EvaluationConfig(), tmp_path, 0)
