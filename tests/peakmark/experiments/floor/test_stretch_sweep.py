"""The table of stretches, on a frame of each flight, and a row of it by hand."""

from peakmark.experiments.floor.stretch_sweep import STEEP_DEG, stretch_row, stretch_table
from peakmark.score.statistics import rate
from tests.peakmark.experiments.floor.records import frame_record, truth_record


def test_the_stretch_of_each_row_finds_most() -> None:
    rows = stretch_table(1)
    assert [row.stretch for row in rows] == ["1", "1.5", "2", "3", "of each row"]
    assert len({row.recall.of for row in rows}) == 1
    recall = [row.recall.count / row.recall.of for row in rows]
    assert recall[-1] >= max(recall) - 0.1
    assert all(row.precision.value == 1 for row in rows)


def test_markers_are_parted_by_their_tilt_and_small_ones_left_out() -> None:
    markers = [
        truth_record("flat", tilt_deg=STEEP_DEG - 0.1),
        truth_record("steep", tilt_deg=STEEP_DEG),
        truth_record("small", side_px=9.9),
    ]
    row = stretch_row("2", [frame_record(markers, ["flat"], response_drop=3.0), frame_record("", "")])
    assert (row.recall, row.recall_below_60_deg, row.recall_from_60_deg) == (rate(1, 2), rate(1, 1), rate(0, 1))
    assert (row.response_drop[50], row.uniquely_detectable) == (3.0, rate(1, 1))
