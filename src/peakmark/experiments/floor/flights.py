"""Many flights as one sample: the figures of `flight_results.run`, pooled over floors, ways and seeds.

Everything is read from the files that each flight leaves, so that flights made at other times or places count as well.
"""

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.trajectory_file import load_trajectory

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import FlightConfig
from peakmark.experiments.floor.flight_figures import BINS, FARTHEST_M
from peakmark.localise.locate import FEWEST
from peakmark.score.plain_statistics import quantiles, rate

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
class Flown:
    """A finished flight, as its files tell."""

    name: str
    result: dict[str, Any]
    """result.json."""
    frames: list[dict[str, str]]
    """Rows of frames.csv."""
    detections: dict[str, NDArray[Any]]
    """Columns of detections.parquet; numbers are nan where missing."""
    heights_m: NDArray[np.float64]
    """(frames,) of the camera."""


def flight_config(ride: str, floor: str, seed: int, frames: int | None) -> FlightConfig:
    """Return one of `FLIGHTS`, or its first frames."""
    return FlightConfig(ride, texture=floor, seed=seed, frames=frames)


def read_flight(folder: Path) -> Flown:
    """Read the files of a flight.

    Raises
    ------
    InputError
        If one of them is missing or cannot be read.
    """
    from pyarrow import ArrowInvalid, parquet

    try:
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        with (folder / "frames.csv").open(encoding="utf-8", newline="") as file:
            frames = list(csv.DictReader(file))
        table = parquet.read_table(folder / "detections.parquet")
    except (OSError, json.JSONDecodeError, ArrowInvalid) as error:
        raise InputError(f"{folder}: expected a finished flight: {error}") from error
    columns = {name: np.array(table[name].to_pylist(), dtype=_kind(name)) for name in table.column_names}
    heights = load_trajectory(folder / "truth.tum").world_from_camera[:, 2, 3]
    return Flown(folder.name, result, frames, columns, heights)


def _kind(name: str) -> Any:
    return object if name in ("truth", "map_marker") else np.float64


def pooled(flights: Sequence[Flown]) -> dict[str, Any]:
    """Return the figures of all flights together, and one row a flight."""
    return {
        "detection": detection(flights),
        "breakdown": {quantity: breakdown(flights, quantity) for quantity in BINS},
        "distance": {name: quantiles(distance_errors(flights, name)) for name in ("rounded", "scale", "refined")},
        "pose": pose(flights),
        "flights": [flight_row(flight) for flight in flights],
    }


def detection(flights: Sequence[Flown]) -> dict[str, Any]:
    """Return recall, precision and unique detectability; counts add up."""
    totals = {
        name: _added([f.result["detection"][name] for f in flights])
        for name in ("recall", "precision", "uniquely_detectable", "silent_without_markers")
    }
    megapixels = 1e-6 * sum(len(f.frames) * f.result["pixels"] for f in flights)
    false = sum(false_detections(f) for f in flights)
    return {
        **totals,
        "frames": sum(len(f.frames) for f in flights),
        "false": false,
        "false_per_megapixel": false / megapixels,
        "response_drop": quantiles(np.concatenate([_column(f, "response_drop") for f in flights])),
    }


def _added(rates: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the rate of all cases together."""
    return rate(sum(round((r["value"] or 0) * r["of"]) for r in rates), sum(r["of"] for r in rates))


def false_detections(flight: Flown) -> int:
    """Return how many detections were at no marker."""
    return sum(int(row["false_detections"]) for row in flight.frames)


def _column(flight: Flown, name: str) -> NDArray[np.float64]:
    return np.array([float(row[name]) if row[name] else np.nan for row in flight.frames])


def breakdown(flights: Sequence[Flown], quantity: str) -> list[dict[str, Any]]:
    """Return one row a bin of `BINS[quantity]`: recall, precision, and how far the markers stand out from clutter.

    Recall is that of markers fully in view. A false detection counts in the bin of its own size, or of the distance
    and tilt that its size stands for.
    """
    found = {(row["low"], row["high"]): [] for f in flights for row in f.result["recall_by"][quantity]}  # type: ignore[var-annotated]
    for flight in flights:
        for row in flight.result["recall_by"][quantity]:
            found[row["low"], row["high"]].append(row["recall"])
    values = np.concatenate([detected(f, quantity) for f in flights])
    is_true = np.concatenate([np.array([name is not None for name in f.detections["truth"]]) for f in flights])
    margins = np.concatenate([margins_of(f) for f in flights])
    rows = []
    for low, high in pairwise(BINS[quantity]):
        inside = (values >= low) & (values < high)
        if (low, high) in found:
            margin = margins[inside & is_true]
            rows.append(
                {
                    "low": low,
                    "high": high,
                    "recall": _added(found[low, high]),
                    "precision": rate(int((inside & is_true).sum()), int(inside.sum())),
                    "stands_out": rate(int((margin > 1).sum()), len(margin)),
                    "margin": quantiles(margin)["p50"],
                }
            )
    return rows


def detected(flight: Flown, quantity: str) -> NDArray[np.float64]:
    """Return side (px), distance (m) or tilt (°) of each detection: the marker's own, or what its size stands for."""
    table = flight.detections
    if quantity == "side_px":
        return table["side_px"]
    away = np.where(np.isfinite(table["true_distance_m"]), table["true_distance_m"], table["distance_scale_m"])
    if quantity == "distance_m":
        return np.asarray(away)
    height = flight.heights_m[table["frame"].astype(np.intp)]
    return np.asarray(np.degrees(np.arccos(np.clip(height / away, 0, 1))))


def margins_of(flight: Flown) -> NDArray[np.float64]:
    """Return each detection's response over that of the strongest clutter of its frame."""
    clutter = _column(flight, "strongest_clutter")
    return np.asarray(flight.detections["response"] / clutter[flight.detections["frame"].astype(np.intp)])


def distance_errors(flights: Sequence[Flown], kind: str) -> NDArray[np.float64]:
    """Return the relative errors of one kind of distance, of markers up to `FARTHEST_M`."""
    errors = []
    for flight in flights:
        true, told = flight.detections["true_distance_m"], flight.detections[f"distance_{kind}_m"]
        near = true <= FARTHEST_M
        errors.append(np.abs(told[near] / true[near] - 1))
    return np.concatenate([np.empty(0), *errors])


def pose(flights: Sequence[Flown]) -> dict[str, Any]:
    """Return how often and how well the map gave the pose, on frames with at least `FEWEST` detections."""
    position, rotation, alone, located, wrong, frames = [], [], 0, 0, 0, 0
    for flight in flights:
        counts = np.bincount(flight.detections["frame"].astype(np.intp), minlength=len(flight.frames))
        for row in (r for r, count in zip(flight.frames, counts, strict=True) if count >= FEWEST):
            frames += 1
            alone += row["pose.found"] == "alone"
            located += row["pose.found"] != "none"
            wrong += int(row["pose.is_wrong"])
            if row["pose.found"] != "none":
                position.append(float(row["pose.error_mm"]))
                rotation.append(float(row["pose.error_deg"]))
    return {
        "located_alone": rate(alone, frames),
        "located": rate(located, frames),
        "wrong": wrong,
        "position_mm": quantiles(position),
        "rotation_deg": quantiles(rotation),
    }


def flight_row(flight: Flown) -> dict[str, Any]:
    """Return one flight's line of the table."""
    result = flight.result
    motion = result.get("motion", {})
    errors = {way: motion.get(way) or {} for way in ("map", "motion")}
    return {
        "flight": flight.name,
        "frames": len(flight.frames),
        "recall": result["detection"]["recall"],
        "precision": result["detection"]["precision"],
        "false": false_detections(flight),
        "located": result["pose"]["located"]["value"] if "pose" in result else None,
        "map_ate_mm": errors["map"].get("ate_rmse_mm"),
        "map_rpe_mm": errors["map"].get("rpe_rmse_mm"),
        "motion_ate_mm": errors["motion"].get("ate_rmse_mm"),
        "motion_rpe_mm": errors["motion"].get("rpe_rmse_mm"),
        "track_changes": motion.get("track_changes"),
        "track_swaps": motion.get("track_swaps"),
        "frames_per_second": result["time_s"]["frames_per_second"],
    }
