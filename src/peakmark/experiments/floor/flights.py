"""Many flights as one sample: the figures of a flight, pooled over floors, trajectories and seeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.floor.flight import FlightConfig
from peakmark.experiments.floor.flight_figures import (
    BINS,
    DetectionFigures,
    FlightResult,
    PoseFigures,
    detection_figures,
    distance_figures,
    false_detections,
    pose_figures,
    recall_bins,
)
from peakmark.experiments.floor.flight_records import FrameRecord, columns
from peakmark.experiments.floor.flight_tracking import Flown, distances, true_distances
from peakmark.plain import plain_fields
from peakmark.score.statistics import Quantiles, Rate, quantiles, rate

FLIGHTS = (
    ("bumpy", "brick", 11),
    ("stroll", "grass", 12),
    ("bumpy", "coins", 13),
    ("stroll", "coins", 14),
    ("bumpy", "grass", 15),
    ("stroll", "brick", 16),
    ("bumpy", "brick", 17),
    ("sharp", "grass", 18),
    ("stroll", "coins", 19),
    ("sharp", "brick", 20),
)
"""Ride, floor and seed of the standard sample: none of these floors had a part in tuning the identification."""


@dataclass(frozen=True)
class BreakdownRow:
    """Markers and detections in one bin of side, tilt or distance."""

    low: float
    high: float
    """Of the bin, the lower itself in it, the upper not."""
    recall: Rate
    """Of the markers that are fully in view."""
    precision: Rate
    """Of the detections; a false one counts by its own size, or the distance and tilt that its size stands for."""
    stands_out: Rate
    """True detections with a response above the strongest clutter of their frame."""
    margin: float | None
    """Median of their response over that of the strongest clutter."""


@dataclass(frozen=True)
class FlightRow:
    """One flight's line of the table; None where a flight has no such figure."""

    flight: str
    frames: int
    recall: Rate
    precision: Rate
    false: int
    """Detections at no marker."""
    located: float | None
    """Share of frames located in the map."""
    map_ate_mm: float | None
    map_rpe_mm: float | None
    motion_ate_mm: float | None
    motion_rpe_mm: float | None
    track_changes: int | None
    track_swaps: int | None
    frames_per_second: float


@dataclass(frozen=True)
class PooledFigures:
    """The figures of all flights together."""

    detection: DetectionFigures
    breakdown: dict[str, list[BreakdownRow]]
    """By each of `BINS`."""
    distance: dict[str, Quantiles]
    """Relative errors; the height of the camera is known in each frame."""
    pose: PoseFigures
    flights: list[FlightRow]

    def to_plain(self) -> dict[str, Any]:
        """Return what result.json holds."""
        plain = plain_fields(self)
        del plain["detection"]["localisation_px"]
        return plain


def flight_config(ride: str, floor: str, seed: int, frames: int | None) -> FlightConfig:
    """Return one of `FLIGHTS`, or its first frames."""
    return FlightConfig(ride, texture=floor, seed=seed, frames=frames)


def pooled(flights: Sequence[Flown], results: Sequence[FlightResult]) -> PooledFigures:
    """Return the figures of all flights together, and one row a flight."""
    return PooledFigures(
        detection=detection_figures(flights),
        breakdown={quantity: breakdown(flights, quantity) for quantity in BINS},
        distance=distance_figures(flights, [flight.heights_m for flight in flights]),
        pose=pose_figures(frame for flight in flights for frame in flight.frames),
        flights=[flight_row(flight, result) for flight, result in zip(flights, results, strict=True)],
    )


def breakdown(flights: Sequence[Flown], quantity: str) -> list[BreakdownRow]:
    """Return one row for each bin of `BINS[quantity]` that holds markers fully in view."""
    values, margins, is_true = [np.empty(0)], [np.empty(0)], [np.empty(0, dtype=bool)]
    for flight in flights:
        for record, height_m in zip(flight.records, flight.heights_m.tolist(), strict=True):
            values.append(detected_values(flight, record, height_m, quantity))
            margins.append(margins_of(record))
            is_true.append(np.array([row.marker is not None for row in record.detections], dtype=bool))
    value, margin, true = np.concatenate(values), np.concatenate(margins), np.concatenate(is_true)
    rows = []
    for one in recall_bins(flights, quantity):
        inside = (value >= one.low) & (value < one.high)
        margin_in_bin = margin[inside & true]
        rows.append(
            BreakdownRow(
                low=one.low,
                high=one.high,
                recall=one.recall,
                precision=rate(len(margin_in_bin), int(inside.sum())),
                stands_out=rate(int((margin_in_bin > 1).sum()), len(margin_in_bin)),
                margin=quantiles(margin_in_bin)[50],
            )
        )
    return rows


def detected_values(flight: Flown, record: FrameRecord, height_m: float, quantity: str) -> NDArray[np.float64]:
    """Return side (px), distance (m) or tilt (°) of each detection: the marker's own, or what its size stands for."""
    if quantity == "side_px":
        return columns(record).side_px
    true = true_distances(record)
    away = np.where(np.isfinite(true), true, distances(record, flight.camera, flight.floor_map, height_m)["scale"])
    above_floor_m = record.world_from_camera[2, 3]  # the floor is the world's plane z = 0; markers lie a hair above it
    return away if quantity == "distance_m" else np.degrees(np.arccos(np.clip(above_floor_m / away, 0, 1)))


def margins_of(record: FrameRecord) -> NDArray[np.float64]:
    """Return each detection's response over that of the strongest clutter; nan without clutter."""
    return np.array([row.detection.response for row in record.detections]) / (record.score.strongest_clutter or np.nan)


def flight_row(flight: Flown, result: FlightResult) -> FlightRow:
    """Return one flight's line of the table."""
    by_map, by_motion = (result.motion.map, result.motion.motion) if result.motion else (None, None)
    return FlightRow(
        flight=flight.name,
        frames=len(flight.frames),
        recall=result.detection.recall,
        precision=result.detection.precision,
        false=false_detections(flight.records),
        located=result.pose.located.value if result.pose else None,
        map_ate_mm=by_map.ate_rmse_mm if by_map else None,
        map_rpe_mm=by_map.rpe_rmse_mm if by_map else None,
        motion_ate_mm=by_motion.ate_rmse_mm if by_motion else None,
        motion_rpe_mm=by_motion.rpe_rmse_mm if by_motion else None,
        track_changes=result.motion.track_changes if result.motion else None,
        track_swaps=result.motion.track_swaps if result.motion else None,
        frames_per_second=result.time_s["frames_per_second"],
    )
