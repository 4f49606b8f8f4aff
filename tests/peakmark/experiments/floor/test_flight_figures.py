"""The figures of made-up flights, whose values are known by construction."""

import numpy as np
import pytest

from peakmark.experiments.floor.flight_figures import detection_figures, recall_bins, speed_figures
from peakmark.experiments.floor.flight_records import FrameRecord
from peakmark.experiments.floor.flight_tracking import Flown, track_frames
from peakmark.score.statistics import rate
from tests.floor_views import CAMERA
from tests.peakmark.experiments.floor.records import detection_record, frame_record, truth_record


def flown(*records: FrameRecord, stretch: float = 1.0) -> Flown:
    times_s = np.arange(len(records), dtype=np.float64)
    return Flown("made up", CAMERA, stretch, times_s, None, track_frames(records, CAMERA, None))


FLIGHT = flown(
    frame_record(["a", truth_record("small", side_px=15.0)], ["a", detection_record(None)], response_drop=2.0),
    frame_record("ab", [detection_record("b", off_px=3.0)], response_drop=0.5),
    frame_record("", ""),
    frame_record("", [detection_record(None)]),
)


def test_counts_are_those_of_the_records() -> None:
    figures = detection_figures([FLIGHT])
    assert (figures.frames, figures.recall, figures.precision) == (4, rate(2, 3), rate(2, 4))
    assert (figures.false, figures.uniquely_detectable) == (2, rate(1, 2))
    assert figures.silent_without_markers == rate(1, 2)
    assert figures.false_per_megapixel == pytest.approx(2 / (4 * 1.024 * 0.768))
    assert (figures.response_drop[50], figures.response_drop.of) == (1.25, 2)
    assert (figures.localisation_px.largest, figures.localisation_px.of) == (3.0, 2)


def test_flights_are_pooled_by_their_cases_each_with_its_own_stretch() -> None:
    stretched = flown(*FLIGHT.records, stretch=2.0)
    figures = detection_figures([FLIGHT, stretched])
    assert detection_figures([stretched]).recall == rate(2, 4)
    assert (figures.recall, figures.precision, figures.frames) == (rate(4, 7), rate(4, 8), 8)


def test_recall_is_broken_down_by_what_the_markers_truly_are() -> None:
    rows = recall_bins([FLIGHT], "side_px")
    assert [(row.low, row.high, row.recall) for row in rows] == [(15, 20, rate(0, 1)), (45, 70, rate(2, 3))]
    assert [row.error_px[50] for row in rows] == [None, 1.5]
    assert [row.recall for row in recall_bins([FLIGHT], "tilt_deg")] == [rate(2, 4)]


def test_the_speed_is_that_of_all_stages_together() -> None:
    assert speed_figures(FLIGHT.records) == {"render": 0.1, "detect": 0.1, "frames_per_second": pytest.approx(5.0)}
