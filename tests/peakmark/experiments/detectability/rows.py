"""Rows as the detectability run makes them, with chosen figures."""

from dataclasses import replace
from typing import Any

from peakmark.experiments.detectability.trials import Percentiles, Row, Summary
from peakmark.score.markers import Localisation
from peakmark.score.statistics import rate


def row(experiment: str, marker: str, detector: str, x: float, hits: int = 100, **figures: Any) -> Row:
    """Return one row of 100 trials; `figures` replace what an undistorted marker would give.

    Besides fields of `Row` and `Summary` these are a response's median, and fields of the errors from the centre.
    """
    is_found = hits > 0
    response = Percentiles(10.0, 9.0, 11.0) if is_found else Percentiles(None, None, None)
    size = Percentiles(1.0, 1.0, 1.0) if is_found else Percentiles(None, None, None)
    error = Localisation(0.14, (0.1, 0.1), 0.1, 0.1) if is_found else Localisation(None, None, None, None)
    if "response" in figures:
        response = replace(response, median=figures.pop("response"))
    errors = {name: figures.pop(name) for name in ("bias_xy", "rms", "p95") if name in figures}
    share, ratio = rate(hits, 100), 1.0 if is_found else None
    found = Summary(
        100, share, share, share, response, ratio, ratio, size, replace(error, **errors), error, 0, 0, 0, ""
    )
    series = figures.pop("series", "")
    return Row(experiment, marker, series, float(x), detector, replace(found, **figures))


def curve(experiment: str, marker: str, detector: str, hits: dict[float, int], **figures: Any) -> list[Row]:
    """Return the rows of one curve from x → hits."""
    return [row(experiment, marker, detector, x, count, **figures) for x, count in hits.items()]
