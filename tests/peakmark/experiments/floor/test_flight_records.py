"""What is kept of a frame is what was true and found, and the same after JSON."""

import json
from pathlib import Path

import numpy as np

from peakmark.experiments.floor.flight import FlightConfig, open_flight, render_view
from peakmark.experiments.floor.flight_records import FrameRecord, columns, record_of
from peakmark.plain import from_plain, to_plain


def test_a_record_holds_what_was_found_and_is_itself_after_json(ride: Path) -> None:
    view = render_view(open_flight(FlightConfig(str(ride), texture="brick", frames=3)), 1)
    record = record_of(view)
    assert len(record.detections) == len(view.found.detections) > 2
    truth = {t.name: t for t in view.frame.truth}
    for name, index in view.score.matches.items():
        assert np.array_equal(record.detection_of[name].xy, view.found.detections[index].xy)
        assert np.array_equal(record.truth_of[name].center_xy, truth[name].center_xy)
    again = from_plain(FrameRecord, json.loads(json.dumps(to_plain(record))))
    np.testing.assert_equal(to_plain(again), to_plain(record))
    assert again.score == record.score
    assert columns(again).xy.shape == (len(record.detections), 2)


def test_no_detections_are_empty_columns_of_the_right_shape(ride: Path) -> None:
    record = record_of(render_view(open_flight(FlightConfig(str(ride), frames=1)), 0))
    none = columns(from_plain(FrameRecord, {**to_plain(record), "detections": []}))
    assert (none.xy.shape, none.affinity.shape, none.refined.shape) == ((0, 2), (0, 2, 2), (0,))
