"""Flights: what is refused before the first frame, and that a frame depends on nothing but its index."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import FlightConfig, open_flight, render_view
from peakmark.experiments.floor.flight_records import record_of
from peakmark.plain import to_plain


def test_a_frame_depends_on_its_index_alone(ride: Path) -> None:
    flight = open_flight(FlightConfig(str(ride), frames=4))
    once, again = render_view(flight, 2), render_view(flight, 2)
    assert np.array_equal(once.frame.image, again.frame.image)
    plain = [to_plain(record_of(view)) for view in (once, again)]
    for record in plain:
        del record["time_s"]
    np.testing.assert_equal(*plain)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": 0}, "--frames: expected 1…1000000, got 0"),
        ({"seed": -1}, "--seed: expected 0 or more, got -1"),
        ({"stretch": 9.0}, r"--stretch: expected 0\.25…8, got 9\.0"),
        ({"rule": "guess"}, "--rule: expected joint or paper, got guess"),
        ({"texture": "marble"}, r"textures\.floor: expected one of gravel, brick, got 'marble'"),
    ],
)
def test_bad_input_is_one_line(ride: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        open_flight(FlightConfig(str(ride), **change))
