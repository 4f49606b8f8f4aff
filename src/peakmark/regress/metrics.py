"""Metrics: figures of a run, each with a unit, a direction, a tolerance and a bootstrap interval over frames.

Every metric is a ratio of sums over frames, Σa / Σb, under a form: the mean itself, its root (rms), or its
exponential (geometric mean). That makes resampling frames a matrix product, and pairs two runs frame by frame.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from peakmark.regress.frame import ScoredFrame, ScoredMarker
from peakmark.score.statistics import percentile_interval

Form = Literal["mean", "rms", "geometric"]
Direction = Literal["higher", "lower", "same"]
Floats = NDArray[np.float64]

SIDE_EDGES_PX = (0.0, 24.0, 48.0, 96.0, 192.0, np.inf)
"""Classes of marker sides, px; each octave of SURF serves about one of them."""

_FORMS: dict[str, Callable[[Floats], Floats]] = {"mean": lambda ratio: ratio, "rms": np.sqrt, "geometric": np.exp}


@dataclass(frozen=True)
class Metric:
    """One figure of a run."""

    key: str
    """Unique in a run."""
    unit: str
    """Empty for shares and counts."""
    direction: Direction
    """Which way is better; "same" where any change is a fault."""
    tolerance: float
    """Change that does not matter, in the unit; a share of the old value where `relative`."""
    relative: bool
    """Whether changes are shares of the old value."""
    form: Form
    """What is done with Σa / Σb."""
    a: Floats
    """(n,) per frame."""
    b: Floats
    """(n,) per frame."""

    def value(self) -> float | None:
        """Return the figure; None where no frame contributes to it."""
        value = float(self.resampled(np.ones((1, len(self.a))))[0])
        return None if np.isnan(value) else value

    def resampled(self, counts: Floats) -> Floats:
        """Return (m,) figures of (m, n) counts of how often each frame is taken; nan where Σb is 0."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return _FORMS[self.form]((counts @ self.a) / (counts @ self.b))

    def interval(self, counts: Floats, level: float = 0.95) -> tuple[float, float] | None:
        """Return the percentile bootstrap interval."""
        return percentile_interval(self.resampled(counts), level)


# --- which metrics there are ----------------------------------------------------------------------------------


def metrics_of(results: Sequence[ScoredFrame], tolerances: dict[str, float]) -> tuple[Metric, ...]:
    """Return the metrics of a run, always the same ones; `tolerances` replace the built-in ones by key."""
    listed = (*_found(results), *_precision(results), *_positions(results), *_strengths(results))
    return tuple(replace(metric, tolerance=tolerances.get(metric.key, metric.tolerance)) for metric in listed)


Pick = Callable[[ScoredMarker], float | None]


def _sums(results: Sequence[ScoredFrame], pick: Pick) -> tuple[Floats, Floats]:
    """Return per frame the sum and the count of what `pick` takes from each marker wanted."""
    rows = [[v for m in result.markers.values() if (v := pick(m)) is not None] for result in results]
    return np.array([sum(row) for row in rows], dtype=float), np.array([len(row) for row in rows], dtype=float)


def _found(results: Sequence[ScoredFrame]) -> list[Metric]:
    """Return recall, in all and by side, and the share of frames without an answer."""
    rows = [Metric("recall", "", "higher", 0.01, False, "mean", *_sums(results, _is_found(0, np.inf)))]
    for low, high in pairwise(SIDE_EDGES_PX):
        name = f"recall, side {low:g}…{high:g} px" if np.isfinite(high) else f"recall, side from {low:g} px"
        rows.append(Metric(name, "", "higher", 0.02, False, "mean", *_sums(results, _is_found(low, high))))
    failures = np.array([float(result.failure is not None) for result in results])
    return [*rows, Metric("frames without an answer", "", "lower", 0.0, False, "mean", failures, np.ones(len(results)))]


def _is_found(low_px: float, high_px: float) -> Pick:
    """Return a pick of 1 for a found and 0 for a missed marker of a side in a class."""
    return lambda m: float(m.xy is not None) if low_px <= m.side_px < high_px else None


def _precision(results: Sequence[ScoredFrame]) -> list[Metric]:
    """Return false detections, and wrong polarities of found markers."""
    identified = np.array([float(result.false_xy is not None) for result in results])
    false = np.array([float(len(result.false_xy or ())) for result in results])
    wrong = _sums(results, lambda m: None if m.polarity_is_right is None else float(not m.polarity_is_right))
    return [
        Metric("false detections", "a frame", "lower", 0.1, False, "mean", false, identified),
        Metric("wrong polarity", "", "lower", 0.01, False, "mean", *wrong),
    ]


def _positions(results: Sequence[ScoredFrame]) -> list[Metric]:
    """Return the error of positions and its mean along each axis."""

    def error(axis: int) -> Pick:
        return lambda m: None if m.xy is None else m.xy[axis] - m.true_xy[axis]

    squares = _sums(results, lambda m: None if m.xy is None else float(np.sum(np.subtract(m.xy, m.true_xy) ** 2)))
    return [
        Metric("error, rms", "px", "lower", 0.05, False, "rms", *squares),
        Metric("bias in x", "px", "same", 0.1, False, "mean", *_sums(results, error(0))),
        Metric("bias in y", "px", "same", 0.1, False, "mean", *_sums(results, error(1))),
    ]


def _strengths(results: Sequence[ScoredFrame]) -> list[Metric]:
    """Return features, responses, and the drop from markers to clutter, where the detector tells them."""
    answered = np.array([float(result.failure is None) for result in results])
    features = answered * [result.features for result in results]
    responses = _sums(results, lambda m: _log(m.response))
    drops = np.array([_log(result.drop) for result in results], dtype=np.float64)  # nan where there is none
    known = np.isfinite(drops).astype(np.float64)
    return [
        Metric("features", "a frame", "same", 0.03, True, "mean", features, answered),
        Metric("response of markers", "", "same", 0.05, True, "geometric", *responses),
        Metric("drop to clutter", "", "higher", 0.1, True, "geometric", np.nan_to_num(drops), known),
    ]


def _log(value: float | None) -> float | None:
    return float(np.log(value)) if value is not None and value > 0 else None
