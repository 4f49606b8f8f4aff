"""Comparing a run with a baseline, frame by frame: better, same, worse."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from peakmark.errors import InputError
from peakmark.regress.metrics import Floats, Metric, metrics_of
from peakmark.regress.record import Record
from peakmark.score.statistics import percentile_interval, resample_counts

CONFIDENCE = 0.995
"""Level of the interval that a change must leave to count: strict enough that the many figures of a suite raise no
false alarm over 20 seeds of the noise (`tests/peakmark/regress/test_run.py`); six frames that agree suffice."""

Verdict = Literal["better", "same", "worse", "changed", "unknown"]

FAULTS: tuple[Verdict, ...] = ("worse", "changed")
"""Verdicts that make a regression."""


@dataclass(frozen=True)
class Change:
    """One metric, before and after."""

    metric: Metric
    """As of the run."""
    before: float | None
    """The baseline's value."""
    after: float | None
    """The run's value."""
    change: float | None
    """After − before, or the share of it where the metric is relative."""
    interval: tuple[float, float] | None
    """Of the change, by resampling frames in pairs; its level is `CONFIDENCE`."""
    verdict: Verdict
    """What the change means."""
    frames: tuple[int, ...]
    """Indices of the frames that show it best; empty unless it is a fault."""


@dataclass(frozen=True)
class Comparison:
    """A run beside a baseline."""

    before: Record
    after: Record
    changes: tuple[Change, ...]
    """One a metric."""
    images_changed: int
    """Frames whose pixels differ."""

    @property
    def faults(self) -> tuple[Change, ...]:
        """What got worse or changed."""
        return tuple(change for change in self.changes if change.verdict in FAULTS)


def compare_records(after: Record, before: Record) -> Comparison:
    """Compare a run with a baseline of the same suite.

    Raises
    ------
    InputError
        If they are of different suites, or of different frames of one.
    """
    _check_same_suite(after, before)
    counts = resample_counts(len(after.results))
    old, new = (metrics_of(record.results, after.tolerances) for record in (before, after))
    frames = [result.frame for result in after.results]
    changes = tuple(_change(a, b, counts, frames) for a, b in zip(new, old, strict=True))
    pairs = zip(after.results, before.results, strict=True)
    return Comparison(before, after, changes, sum(a.picture != b.picture for a, b in pairs))


def _check_same_suite(after: Record, before: Record) -> None:
    if after.suite != before.suite:
        raise InputError(f"baseline: expected one of suite {after.suite!r}, got one of {before.suite!r}")
    if after.suite_sha256 != before.suite_sha256:
        raise InputError(
            f"baseline: expected one of suite {after.suite!r} as it is now, the suite has changed since: "
            "check the run and accept it again"
        )
    if [r.frame for r in after.results] != [r.frame for r in before.results]:
        raise InputError(
            f"baseline: expected one of the same {len(after.results)} frames, got {len(before.results)}: "
            "quick runs need a quick baseline"
        )


def _change(new: Metric, old: Metric, counts: Floats, frames: Sequence[int]) -> Change:
    after, before = new.value(), old.value()
    if after is None or before is None:
        return Change(new, before, after, None, None, "unknown", ())
    changes = _difference(new.resampled(counts), old.resampled(counts), new.relative)
    interval = percentile_interval(changes, CONFIDENCE)
    change = float(_difference(np.array(after), np.array(before), new.relative))
    verdict = verdict_of(new, change, interval)
    showing = showing_frames(new, old, frames, change) if verdict in FAULTS else ()
    return Change(new, before, after, change, interval, verdict, showing)


def _difference(new: Floats, old: Floats, relative: bool) -> Floats:
    """Return new − old, as a share of old where `relative`; nothing compared with nothing is no change."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(new == old, 0.0, new / old - 1) if relative else new - old


def verdict_of(metric: Metric, change: float, interval: tuple[float, float] | None) -> Verdict:
    """Return what a change means: it counts if it exceeds the tolerance and its interval excludes zero."""
    certain = interval is not None and (interval[0] > 0 or interval[1] < 0)
    if abs(change) <= metric.tolerance or not certain:
        return "same"
    if metric.direction == "same":
        return "changed"
    return "better" if (change > 0) == (metric.direction == "higher") else "worse"


def showing_frames(new: Metric, old: Metric, frames: Sequence[int], change: float, most: int = 3) -> tuple[int, ...]:
    """Return the frames that contribute most to a change, the strongest first."""
    old_sum, new_sum = old.b.sum(), new.b.sum()
    level = old.a.sum() / old_sum
    pull = (new.a - level * new.b) / new_sum - (old.a - level * old.b) / old_sum
    order = np.argsort(-np.sign(change) * pull, kind="stable")[:most]
    return tuple(frames[i] for i in order if np.sign(change) * pull[i] > 0)
