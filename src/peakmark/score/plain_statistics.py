"""Rates and quantiles as plain dictionaries: to be replaced by `peakmark.score.statistics`, then deleted."""

from dataclasses import asdict
from typing import Any

from numpy.typing import ArrayLike

from peakmark.score import statistics


def rate(successes: int, trials: int) -> dict[str, Any]:
    """Return `Rate` as a dictionary."""
    return asdict(statistics.rate(successes, trials))


def quantiles(values: ArrayLike, seed: int = 0) -> dict[str, Any]:
    """Return `Quantiles` as a dictionary."""
    return statistics.quantiles(values, seed=seed).to_plain()


def rate_row(name: str, figure: dict[str, Any]) -> tuple[Any, ...]:
    """Return a rate as a table's row: name, value, interval, cases."""
    return name, figure["value"], figure["low"], figure["high"], figure["of"]


def quantile_rows(name: str, figure: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return the median and the 95th percentile as rows like `rate_row`'s; one row of blanks where there is none."""
    if figure["p50"] is None:
        return [(f"{name}: p50", None, None, None, 0)]
    return [(f"{name}: {q}", figure[q], *figure[f"{q}_interval"], figure["of"]) for q in ("p50", "p95")]
