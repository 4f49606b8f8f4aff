"""The stretch measured, not assumed: recall and response drop of the same frames over several stretches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from peakmark.experiments.floor.flight import open_flight, render_frame, score_flight_view
from peakmark.experiments.floor.flight_figures import outcomes, precision_of, recall_of, response_drops
from peakmark.experiments.floor.flight_records import FrameRecord, record_of
from peakmark.experiments.floor.flights import flight_config
from peakmark.identification.stretch import Stretch
from peakmark.score.statistics import Quantiles, Rate, quantiles, rate
from peakmark.score.wanted import Wanted

STRETCHES = (1.0, 1.5, 2.0, 3.0)
"""Of the whole image; the one that the camera's pitch implies for each row comes after them."""

WANTED = Wanted(min_side_px=10.0)
"""Markers from this side on, unstretched, must be found, whatever the stretch."""

STEEP_DEG = 60.0
"""Tilt that parts the markers into two groups: from here on a marker appears less than half as high as wide."""

SAMPLE = (("bumpy", "brick", 41), ("stroll", "coins", 42), ("bumpy", "grass", 43))
"""Ride, floor and seed of the flights."""

FRAMES_EACH = 20


@dataclass(frozen=True)
class StretchRow:
    """What one stretch gave."""

    stretch: str
    """Factor, or "of each row"."""
    recall: Rate
    """Of `WANTED`."""
    recall_below_60_deg: Rate
    recall_from_60_deg: Rate
    """Of those tilted less than `STEEP_DEG`, and of the others."""
    precision: Rate
    """Detections that are at a marker."""
    response_drop: Quantiles
    """Of the frames that have one."""
    uniquely_detectable: Rate
    """Of these frames."""


def stretch_table(frames_each: int = FRAMES_EACH) -> list[StretchRow]:
    """Return one row a stretch, all of the same frames."""
    records: dict[str, list[FrameRecord]] = {}
    for sample in SAMPLE:
        flight = open_flight(flight_config(*sample, None))
        stretches: dict[str, Stretch] = {**{f"{s:g}": s for s in STRETCHES}, "of each row": flight.stretch}
        for index in np.linspace(0, len(flight.times_s) - 1, frames_each).astype(int):
            frame = render_frame(flight, int(index))
            for name, stretch in stretches.items():
                view = score_flight_view(int(index), frame, 0.0, stretch, "joint")
                records.setdefault(name, []).append(record_of(view))
    return [stretch_row(name, of_stretch) for name, of_stretch in records.items()]


def stretch_row(name: str, records: Sequence[FrameRecord]) -> StretchRow:
    """Return a stretch's line of the table."""
    found, drops = outcomes(records, WANTED), response_drops(records)
    return StretchRow(
        stretch=name,
        recall=recall_of(found),
        recall_below_60_deg=recall_of(pair for pair in found if pair[0].tilt_deg < STEEP_DEG),
        recall_from_60_deg=recall_of(pair for pair in found if pair[0].tilt_deg >= STEEP_DEG),
        precision=precision_of(records),
        response_drop=quantiles(drops),
        uniquely_detectable=rate(sum(drop > 1 for drop in drops), len(drops)),
    )
