"""Figures of a study of poses: errors, normalised errors, and how often the truth is where it is said to be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.comparison.measure import CHI2_95
from peakmark.experiments.poses.study import SETS, SOURCES, PoseError
from peakmark.score.statistics import rate

WRONG = 0.05
"""Error of the position over the distance beyond which a pose is the wrong one of two, or grossly wrong."""

_RESAMPLES = 2000


@dataclass(frozen=True)
class PoseFigures:
    """One source of poses in one set of images."""

    set: str
    """One of `SETS`, or "all" of them."""
    source: str
    told: int
    """Poses."""
    uncertain: float | None
    """Share of them that is called uncertain, for another pose explains the image nearly as well."""
    wrong: int
    """Certain ones that are `WRONG`."""
    position_p50: float | None
    """Median error of the position over the distance, of certain poses, as the following ones."""
    rotation_p50_deg: float | None
    nees: float | None
    """Mean normalised squared error; six if covariances are honest."""
    nees_low: float | None
    nees_high: float | None
    """Ends of its 95 % interval, by bootstrap."""
    inside: float | None
    """Share of truths in the stated 95 % ellipsoid."""
    inside_low: float | None
    inside_high: float | None


def pose_figures(measured: Sequence[tuple[str, PoseError]]) -> tuple[PoseFigures, ...]:
    """Return the figures of each source, in each set and in all of them; (set, pose) are given."""
    rows = []
    for source in SOURCES:
        for name in (*SETS, "all"):
            chosen = [e for s, e in measured if e.source == source and e.is_told and name in (s, "all")]
            if chosen:
                rows.append(_figures(name, source, chosen))
    return tuple(rows)


def _figures(name: str, source: str, chosen: Sequence[PoseError]) -> PoseFigures:
    certain = [each for each in chosen if each.is_certain]
    right = [each for each in certain if each.position <= WRONG]
    counts = len(chosen), 1 - len(certain) / len(chosen), len(certain) - len(right)
    if not right:
        return PoseFigures(name, source, *counts, *[None] * 8)
    nees = np.array([each.nees for each in right])
    inside = rate(int((nees <= CHI2_95).sum()), len(nees))
    return PoseFigures(
        name,
        source,
        *counts,
        float(np.median([each.position for each in right])),
        float(np.median([each.rotation_deg for each in right])),
        float(nees.mean()),
        *_interval(nees),
        inside.value,
        inside.low,
        inside.high,
    )


def _interval(values: NDArray[np.float64]) -> tuple[float, float]:
    picks = np.random.default_rng(0).integers(0, len(values), (_RESAMPLES, len(values)))
    low, high = np.quantile(values[picks].mean(axis=1), (0.025, 0.975))
    return float(low), float(high)


HEAD = ("from", "images", "poses", "uncertain", "wrong", "position", "rotation", "NEES of 6", "in the 95 % ellipsoid")


def figure_row(row: PoseFigures) -> tuple[str, ...]:
    """Return a row in words, see `HEAD`."""
    counts = (row.source, row.set, str(row.told), f"{100 * (row.uncertain or 0):.0f} %", str(row.wrong))
    if row.nees is None or row.position_p50 is None or row.rotation_p50_deg is None or row.inside is None:
        return (*counts, "–", "–", "–", "–")
    return (
        *counts,
        f"{1e3 * row.position_p50:.2f} ‰",
        f"{row.rotation_p50_deg:.3f}°",
        f"{row.nees:.1f} ({row.nees_low:.1f}–{row.nees_high:.1f})",
        f"{100 * row.inside:.0f} % ({100 * (row.inside_low or 0):.0f}–{100 * (row.inside_high or 0):.0f})",
    )
