"""The figures of an evaluation, with 95 % intervals: rates by Wilson, quantiles by bootstrap."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from peakmark.score.plain_statistics import rate

Record = dict[str, Any]

QUANTILES = (50, 95, 99)

BINS = {"side_px": (0, 12, 16, 20, 25, 32, 45, 70, 1000), "tilt_deg": (0, 15, 30, 45, 55, 65, 90)}
"""Edges of the bins by which recall is broken down."""

FAR_DEG = 5.0
"""A pose that turns farther from the truth is counted as wrong."""


def figures(records: Sequence[Record]) -> dict[str, Any]:
    """Return all figures of an evaluation's records."""
    markers = [marker for record in records for marker in record["markers"] if marker["is_wanted"]]
    found = [marker for marker in markers if marker["is_found"]]
    arrays = [array for record in records for array in record["arrays"]]
    return {
        "views": len(records),
        "features": int(np.median([record["features"] for record in records])) if records else 0,
        "recall": rate(len(found), len(markers)),
        "polarity_errors": rate(sum(not marker["is_polarity_right"] for marker in found), len(found)),
        "polarity_errors_by_signature": rate(sum(not marker["is_signature_right"] for marker in found), len(found)),
        "localisation_px": quantiles([marker["error_px"] for marker in found]),
        "false_detections_per_view": _mean(records, "false_detections"),
        "arrays_decoded": rate(sum(array["is_decoded"] for array in arrays), len(arrays)),
        "wrong_codes": _wrong(records, "wrong_codes", "codes"),
        "unsure_per_view": _mean(records, "unsure"),
        "arrays_decoded_by_paper": rate(sum(array["is_decoded_by_paper"] for array in arrays), len(arrays)),
        "wrong_codes_by_paper": sum(record["wrong_codes_by_paper"] for record in records),
        "pose": {kind: pose_figures(records, kind) for kind in ("one", "several", "wall")},
        "time_s": _times(records),
    }


def _mean(records: Sequence[Record], name: str) -> float | None:
    return float(np.mean([record[name] for record in records])) if records else None


def _wrong(records: Sequence[Record], wrong: str, named: str) -> dict[str, Any]:
    return rate(sum(record[wrong] for record in records), sum(len(record[named]) for record in records))


def _times(records: Sequence[Record]) -> dict[str, float]:
    stages = records[0]["time_s"] if records else ()
    return {stage: float(np.median([record["time_s"][stage] for record in records])) for stage in stages}


def pose_figures(records: Sequence[Record], kind: str) -> dict[str, Any]:
    """Return the errors of the poses of one kind, all of them and those without a rival."""
    poses = [pose for record in records for pose in record["poses"] if pose["kind"] == kind]
    certain = [pose for pose in poses if pose["is_certain"]]
    return {
        "arrays": float(np.mean([pose["arrays"] for pose in poses])) if poses else None,
        "mm": quantiles([pose["mm"] for pose in poses]),
        "deg": quantiles([pose["deg"] for pose in poses]),
        "flips": rate(sum(pose["is_flipped"] for pose in poses), len(poses)),
        "certain": rate(len(certain), len(poses)),
        "flips_among_certain": rate(sum(pose["is_flipped"] for pose in certain), len(certain)),
        "farther_than_5_deg": sum(pose["deg"] > FAR_DEG for pose in poses),
    }


def quantiles(values: ArrayLike, seed: int = 0) -> dict[str, Any]:
    """Return p50, p95 and p99, each with its bootstrap interval (1000 resamples); None without values."""
    sample = np.asarray(values, dtype=np.float64)
    if len(sample) == 0:
        return {**{f"p{q}": None for q in QUANTILES}, "of": 0}
    rng = np.random.default_rng(seed)
    draws = np.percentile(sample[rng.integers(len(sample), size=(1000, len(sample)))], QUANTILES, axis=1)
    low, high = np.percentile(draws, [2.5, 97.5], axis=1)
    result: dict[str, Any] = {"of": len(sample)}
    for k, q in enumerate(QUANTILES):
        result[f"p{q}"] = float(np.percentile(sample, q))
        result[f"p{q}_interval"] = [float(low[k]), float(high[k])]
    return result


def recall_by(records: Sequence[Record], quantity: str) -> list[dict[str, Any]]:
    """Return one row a bin of `BINS[quantity]` that holds markers fully in view: recall and p95 of the error, px."""
    markers = [marker for record in records for marker in record["markers"] if marker["is_in_view"]]
    rows = []
    for low, high in pairwise(BINS[quantity]):
        inside = [marker for marker in markers if low <= marker[quantity] < high]
        found = [marker for marker in inside if marker["is_found"]]
        if inside:
            error = quantiles([marker["error_px"] for marker in found])["p95"]
            rows.append({"low": low, "high": high, "recall": rate(len(found), len(inside)), "error_px_p95": error})
    return rows


def headline(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return rows (figure, value, low, high, of) for the report and the terminal."""
    rates = (
        "recall",
        "polarity_errors",
        "polarity_errors_by_signature",
        "arrays_decoded",
        "wrong_codes",
        "arrays_decoded_by_paper",
    )
    rows = [_rate_row(name.replace("_", " "), result[name]) for name in rates]
    plain = ("views", "features", "false_detections_per_view", "unsure_per_view", "wrong_codes_by_paper")
    rows += [(name.replace("_", " "), result[name], None, None, None) for name in plain]
    rows += _quantile_rows("marker (px)", result["localisation_px"])
    for kind, pose in result["pose"].items():
        label = {"one": "pose from one array", "several": "pose from 3 or more", "wall": "pose from a wall"}[kind]
        rows += _quantile_rows(f"{label} (mm)", pose["mm"]) + _quantile_rows(f"{label} (°)", pose["deg"])
        rows += [
            _rate_row(f"{label}: {name.replace('_', ' ')}", pose[name])
            for name in ("flips", "certain", "flips_among_certain")
        ]
    return rows


def _rate_row(name: str, value: dict[str, Any]) -> tuple[Any, ...]:
    return name, value["value"], value["low"], value["high"], value["of"]


def _quantile_rows(name: str, value: dict[str, Any]) -> list[tuple[Any, ...]]:
    keys = [f"p{q}" for q in QUANTILES]
    return [(f"{name} {key}", value[key], *value.get(f"{key}_interval", (None, None)), value["of"]) for key in keys]
