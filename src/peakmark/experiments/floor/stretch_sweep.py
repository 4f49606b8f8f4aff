"""The stretch measured, not assumed: recall and margin of the same frames over several stretches."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from peakmark.experiments.floor.flight import judge, open_flight, photograph
from peakmark.experiments.floor.flights import flight_config
from peakmark.identification.stretch import Stretch
from peakmark.score.plain_statistics import quantiles, rate
from peakmark.score.wanted import FULLY_IN_VIEW

STRETCHES = (1.0, 1.5, 2.0, 3.0)
"""Of the whole picture; the one that the camera's pitch implies for each row comes after them."""

SMALLEST_PX = 10.0
"""Markers from this side on, unstretched, are asked for, whatever the stretch."""

SAMPLE = (("bumpy", "brick", 41), ("stroll", "coins", 42), ("bumpy", "grass", 43))
FRAMES_EACH = 20


def stretch_table(frames_each: int = FRAMES_EACH) -> list[dict[str, Any]]:
    """Return one row a stretch: recall by tilt, precision, response drop and false detections of the same frames."""
    records: dict[str, list[dict[str, Any]]] = {}
    for sample in SAMPLE:
        flight = open_flight(flight_config(*sample, None))
        for index in np.linspace(0, len(flight.times_s) - 1, frames_each).astype(int):
            frame = photograph(flight, int(index))
            kinds: dict[str, Stretch] = {**{f"{s:g}": s for s in STRETCHES}, "of each row": flight.stretch}
            for name, stretch in kinds.items():
                records.setdefault(name, []).append(judge(frame, stretch, "joint", int(index), 0.0).record)
    return [stretch_row(name, of_stretch) for name, of_stretch in records.items()]


def stretch_row(name: str, records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return a stretch's line of the table."""
    total = sum(len(record["detections"]) for record in records)
    false = sum(record["score"]["false_detections"] for record in records)
    drops = [r["score"]["response_drop"] for r in records if r["score"]["response_drop"] is not None]
    return {
        "stretch": name,
        "recall": _recall(records, 0, 90),
        "recall_below_60_deg": _recall(records, 0, 60),
        "recall_from_60_deg": _recall(records, 60, 90),
        "precision": rate(total - false, total),
        "response_drop": quantiles(drops),
        "uniquely_detectable": rate(sum(drop > 1 for drop in drops), len(drops)),
    }


def _recall(records: Sequence[dict[str, Any]], low_deg: float, high_deg: float) -> dict[str, Any]:
    wanted = found = 0
    for record in records:
        names = {row["truth"] for row in record["detections"]}
        for truth in record["truth"]:
            is_large = truth["visible_fraction"] >= FULLY_IN_VIEW and truth["side_px"] >= SMALLEST_PX
            if is_large and low_deg <= truth["tilt_deg"] < high_deg:
                wanted += 1
                found += truth["name"] in names
    return rate(found, wanted)
