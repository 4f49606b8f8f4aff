"""Rows as the detectability run writes them, with chosen figures."""

from typing import Any

from peakmark.score.statistics import wilson


def row(experiment: str, marker: str, detector: str, x: float, hits: int = 100, **figures: Any) -> dict[str, Any]:
    """Return one row of 100 trials; `figures` replace what an undistorted marker would give."""
    low, high = wilson(hits, 100)
    rates = {
        f"{name}{end}": value
        for name in ("detected", "detected_in_sides", "unique")
        for end, value in (("", hits / 100), ("_low", low), ("_high", high))
    }
    seen: dict[str, Any] = {
        "response": 10.0,
        "response_p5": 9.0,
        "response_p95": 11.0,
        "response_ratio": 1.0,
        "size_per_side": 1.0,
        "size_per_side_p5": 1.0,
        "size_per_side_p95": 1.0,
        **{f"{of}{name}_px": 0.1 for of in ("", "blob_") for name in ("bias_x", "bias_y", "rms", "p95")},
    }
    if hits == 0:
        seen = dict.fromkeys(seen)
    faults = {"failures": 0, "not_finite": 0, "outside": 0, "first_failure": ""}
    head = {"experiment": experiment, "marker": marker, "series": "", "x": float(x), "detector": detector}
    return {**head, "trials": 100, **rates, **seen, **faults, **figures}


def curve(experiment: str, marker: str, detector: str, hits: dict[float, int], **figures: Any) -> list[dict[str, Any]]:
    """Return the rows of one curve from x → hits."""
    return [row(experiment, marker, detector, x, count, **figures) for x, count in hits.items()]
