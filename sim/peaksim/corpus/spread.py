"""Spreads: how a number of a corpus varies, as a file states it, and its value for a uniform number.

In a file a spread is a number (always the same), a pair `[low, high]` (uniform), or one of the tables
`{ uniform = [low, high] }`, `{ log_uniform = [low, high] }`, `{ integers = [low, high] }` (both included),
`{ normal = [mean, sigma], within = [low, high] }` and `{ choice = [a, b, …], weights = [1, 2, …] }`.
"""

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import scipy
from pydantic import AfterValidator, Field, model_validator

from peaksim.scene.schema import NotNegative, Number, StrictTable

Pair = tuple[Number, Number]

_FORMS = ("uniform", "log_uniform", "integers", "normal", "choice")


class Spread(StrictTable):
    """One number's distribution; `at` picks from it."""

    uniform: Pair | None = None
    log_uniform: Pair | None = None
    integers: tuple[int, int] | None = None
    normal: Pair | None = None
    within: Pair | None = None
    choice: Annotated[tuple[Number, ...], Field(min_length=1)] | None = None
    weights: tuple[NotNegative, ...] | None = None

    @model_validator(mode="before")
    @classmethod
    def _short_forms(cls, value: Any) -> Any:
        if isinstance(value, int | float) and not isinstance(value, bool):
            return {"choice": (value,)}
        if isinstance(value, list | tuple):
            return {"uniform": value}
        if not isinstance(value, dict):
            raise ValueError(f"expected a number, a pair [low, high] or a table of a spread, got {value!r:.60}")
        return value

    @model_validator(mode="after")
    def _makes_sense(self) -> "Spread":
        given = [form for form in _FORMS if getattr(self, form) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(_FORMS)}, got {' and '.join(given) or 'none'}")
        if (self.within is None) != (self.normal is None):
            raise ValueError("expected normal and within together, got one of them")
        for pair in (self.uniform, self.log_uniform, self.integers, self.within):
            if pair is not None and not pair[0] <= pair[1]:
                raise ValueError(f"expected low ≤ high, got {pair[0]:g} and {pair[1]:g}")
        if self.log_uniform is not None and not self.log_uniform[0] > 0:
            raise ValueError(f"expected positive limits of log_uniform, got {self.log_uniform[0]:g}")
        if self.normal is not None and self.within is not None:
            _check_normal(self.normal, self.within)
        if self.weights is not None:
            _check_weights(self.weights, len(self.choice or ()))
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value that can come."""
        if self.choice is not None:
            return min(self.choice), max(self.choice)
        low, high = self.uniform or self.log_uniform or self.integers or self.within or (0.0, 0.0)
        return float(low), float(high)

    @property
    def is_whole(self) -> bool:
        """Whether only whole numbers come."""
        return self.integers is not None or all(float(value).is_integer() for value in self.choice or (0.5,))

    def at(self, share: float) -> float:
        """Return the value below which a `share` (0…1) of all values lies."""
        low, high = self.limits
        if self.choice is not None:
            return float(self.choice[pick_index(share, self.weights or (1.0,) * len(self.choice))])
        if self.integers is not None:
            return float(min(low + np.floor(share * (high - low + 1)), high))
        if self.log_uniform is not None:
            return float(np.clip(low * (high / low) ** share, low, high))
        if self.normal is not None:
            return _truncated_normal(share, *self.normal, low, high)
        return float(np.clip(low + share * (high - low), low, high))


def pick_index(share: float, weights: tuple[float, ...]) -> int:
    """Return the index whose part of the summed weights holds a `share` (0…1) of the whole."""
    edges = np.cumsum(weights)
    return int(min(np.searchsorted(edges, share * edges[-1], side="right"), len(weights) - 1))


def _check_normal(normal: Pair, within: Pair) -> None:
    mean, sigma = normal
    if not sigma > 0:
        raise ValueError(f"expected a positive sigma, got {sigma:g}")
    if within[1] < mean - 5 * sigma or within[0] > mean + 5 * sigma:
        raise ValueError(f"expected limits within 5 sigma of the mean {mean:g}, got {within[0]:g}…{within[1]:g}")


def _check_weights(weights: tuple[float, ...], count: int) -> None:
    if len(weights) != count:
        raise ValueError(f"expected one weight for each of the {count} choices, got {len(weights)}")
    if not sum(weights) > 0:
        raise ValueError("expected at least one positive weight, got none")


def _truncated_normal(share: float, mean: float, sigma: float, low: float, high: float) -> float:
    a, b = (low - mean) / sigma, (high - mean) / sigma
    # in the upper tail probabilities are near 1, where numbers are coarse: there the mirrored distribution is used
    steps = _standard_normal(share, a, b) if a <= 0 else -_standard_normal(1 - share, -b, -a)
    return float(np.clip(mean + sigma * steps, low, high))


def _standard_normal(share: float, low: float, high: float) -> float:
    """Return the value below which a share of a standard normal distribution between limits lies."""
    # as scipy.stats's truncnorm, which takes 0.2 s to import
    below, above = scipy.special.ndtr([low, high])
    return float(scipy.special.ndtri(below + share * (above - below)))


def _within(low: float, high: float, *, whole: bool = False) -> Callable[[Spread], Spread]:
    def check(spread: Spread) -> Spread:
        least, most = spread.limits
        if not (low <= least and most <= high):
            raise ValueError(f"expected values in {low:g}…{high:g}, got {least:g}…{most:g}")
        if whole and not spread.is_whole:
            raise ValueError("expected whole numbers: one, integers = [low, high] or a choice of them")
        return spread

    return check


AnySpread = Annotated[Spread, AfterValidator(_within(-1e9, 1e9))]
"""Any finite numbers."""
Angle = Annotated[Spread, AfterValidator(_within(-360, 360))]
"""Degrees."""
Length = Annotated[Spread, AfterValidator(_within(1e-4, 1e4))]
"""Positive metres."""
Share = Annotated[Spread, AfterValidator(_within(0, 1))]
"""0…1."""
Factor = Annotated[Spread, AfterValidator(_within(0, 100))]
"""A multiplier that is not negative."""
Level = Annotated[Spread, AfterValidator(_within(0, 255))]
"""A grey level."""
Count = Annotated[Spread, AfterValidator(_within(0, 10_000, whole=True))]
"""A whole number of objects."""
Weight = NotNegative
"""Of one choice among several."""


def spread_field(value: Any) -> Any:
    """Return a field whose default is a spread."""
    return Field(default_factory=lambda: Spread.model_validate(value))
