"""Figures of a sample with their 95 % intervals: rates by Wilson, quantiles by bootstrap, both by group."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

RESAMPLES = 1000
"""Bootstrap samples behind an interval of a quantile; chosen by hand, enough for two digits of a 95 % interval."""

_AT_ONCE = 1_000_000
"""Numbers that are resampled at a time."""


@dataclass(frozen=True)
class Rate:
    """A share of counted cases."""

    value: float | None
    """0…1; None without cases."""
    low: float | None
    high: float | None
    """Ends of the Wilson interval."""
    of: int
    """Cases."""

    @property
    def count(self) -> int:
        """Cases that are counted in the share."""
        return round((self.value or 0.0) * self.of)

    def row(self, name: str) -> tuple[Any, ...]:
        """Return a table's row: name, value, interval, cases."""
        return name, self.value, self.low, self.high, self.of


def rate(successes: int, trials: int) -> Rate:
    """Return a share with its Wilson interval; None without trials."""
    if trials == 0:
        return Rate(None, None, None, 0)
    return Rate(successes / trials, *wilson(successes, trials), trials)


def pooled(rates: Iterable[Rate]) -> Rate:
    """Return the rate of all cases together."""
    listed = list(rates)
    return rate(sum(one.count for one in listed), sum(one.of for one in listed))


def wilson(successes: int, trials: int, z: float = 1.959963984540054) -> tuple[float, float]:
    """Return the Wilson score interval of a rate, 95 % unless z says otherwise; (0, 1) without trials.

    DOI 10.1080/01621459.1927.10502953.
    """
    if trials == 0:
        return 0.0, 1.0
    share, spread = successes / trials, z * z / trials
    middle = (share + spread / 2) / (1 + spread)
    half = z / (1 + spread) * np.sqrt(share * (1 - share) / trials + spread / (4 * trials))
    low = 0.0 if successes == 0 else float(middle - half)
    return low, 1.0 if successes == trials else float(middle + half)


@dataclass(frozen=True)
class Quantiles:
    """Quantiles of a sample."""

    values: dict[int, float]
    """Percent → quantile; empty without values."""
    intervals: dict[int, tuple[float, float]]
    """Percent → bootstrap interval."""
    percents: tuple[int, ...]
    """Which of them there are."""
    largest: float | None
    """None without values."""
    of: int
    """Finite values."""

    def __getitem__(self, percent: int) -> float | None:
        return self.values.get(percent)

    def to_plain(self) -> dict[str, Any]:
        """Return p50, p50_interval and so on, max, and the number of values, as result.json has them."""
        plain: dict[str, Any] = {}
        for percent in self.percents:
            plain[f"p{percent}"] = self[percent]
            if percent in self.intervals:
                plain[f"p{percent}_interval"] = list(self.intervals[percent])
        return {**plain, **({} if self.largest is None else {"max": self.largest}), "of": self.of}

    def rows(self, name: str) -> list[tuple[Any, ...]]:
        """Return one row like `Rate.row`'s for each quantile, empty cells where there are no values."""
        empty = (None, None)
        return [(f"{name}: p{p}", self[p], *self.intervals.get(p, empty), self.of) for p in self.percents]


def quantiles(values: ArrayLike, percents: tuple[int, ...] = (50, 95), seed: int = 0) -> Quantiles:
    """Return quantiles with their bootstrap intervals; values that are not finite (unknown) are left out."""
    sample = np.asarray(values, dtype=np.float64)
    sample = sample[np.isfinite(sample)]
    if len(sample) == 0:
        return Quantiles({}, {}, percents, None, 0)
    rng = np.random.default_rng(seed)
    some = max(1, _AT_ONCE // len(sample))
    drawn = [
        np.percentile(sample[rng.integers(len(sample), size=(min(some, RESAMPLES - k), len(sample)))], percents, axis=1)
        for k in range(0, RESAMPLES, some)
    ]
    low, high = np.percentile(np.concatenate(drawn, axis=1), [2.5, 97.5], axis=1)
    found = np.percentile(sample, percents)
    return Quantiles(
        values={p: float(value) for p, value in zip(percents, found, strict=True)},
        intervals={p: (float(a), float(b)) for p, a, b in zip(percents, low, high, strict=True)},
        percents=percents,
        largest=float(sample.max()),
        of=len(sample),
    )


@dataclass(frozen=True)
class Bin:
    """What was found of the markers in one bin of a quantity."""

    low: float
    high: float
    """Of the bin, the lower itself in it, the upper not."""
    recall: Rate
    """Of the markers in it."""
    error_px: Quantiles
    """Distance of the found ones from their true centres."""


def recall_by(
    edges: Sequence[float], quantity: ArrayLike, errors_px: ArrayLike, percents: tuple[int, ...] = (50, 95)
) -> list[Bin]:
    """Return one row for each bin, between rising edges, that holds markers.

    `quantity` is that of the (n,) markers that count, `errors_px` their localisation errors, nan where not found.
    """
    values, errors = np.asarray(quantity, dtype=np.float64), np.asarray(errors_px, dtype=np.float64)
    rows = []
    for low, high in pairwise(edges):
        inside = (values >= low) & (values < high)
        if inside.any():
            rows.append(Bin(low, high, _found(errors[inside]), quantiles(errors[inside], percents)))
    return rows


def _found(errors_px: NDArray[np.float64]) -> Rate:
    return rate(int(np.isfinite(errors_px).sum()), len(errors_px))


def percentile_interval(values: NDArray[np.float64], level: float) -> tuple[float, float] | None:
    """Return the middle `level` of bootstrapped values; None where more than one in twenty is nan."""
    if np.isnan(values).mean() > 0.05:
        return None
    method: Literal["nearest", "linear"] = (
        "nearest" if np.isinf(values).any() else "linear"
    )  # between infinities there is nothing
    low, high = np.nanquantile(values, [(1 - level) / 2, (1 + level) / 2], method=method)
    return float(low), float(high)


def resample_counts(cases: int, resamples: int = 10_000, seed: int = 0) -> NDArray[np.float64]:
    """Return (resamples, cases) counts of how often each case is drawn, with replacement.

    10 000 resamples leave 25 of them beyond each end of a 99.5 % interval.
    """
    rng = np.random.default_rng(seed)
    return rng.multinomial(cases, np.full(cases, 1 / cases), resamples).astype(np.float64)
