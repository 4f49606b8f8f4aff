"""Many views of one condition through one detector: is the marker found, uniquely, how strongly, how exactly.

Definitions of Section 4.1: a marker is *detected* if a key point of about its size lies within 3 px of its centre,
and *uniquely* if that is the strongest key point of the picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.outcome import Outcome
from peakmark.experiments.detectability.conditions import View
from peakmark.score.statistics import wilson

Row = dict[str, Any]
"""One point through one detector: names and figures."""

TOLERANCE_PX = 3.0
"""The paper's limit of the localisation error."""

TOLERANCE_SIDES = 0.1
"""The limit that goes with the marker's size, shown beside it."""

SIZE_RATIO = 2.0
"""A key point is the marker's if its size is within this factor of what an undistorted marker gives."""

_GATE_SIDES = 0.35


@dataclass(frozen=True)
class Reference:
    """What a detector gives for an undistorted marker."""

    response: float
    """Median response."""
    size_per_side: float
    """Median key point size over the marker's side."""


@dataclass(frozen=True)
class Trial:
    """One view through one detector."""

    detected: bool
    """Within `TOLERANCE_PX`."""
    detected_in_sides: bool
    """Within `TOLERANCE_SIDES`."""
    unique: bool
    """Detected, and by the strongest key point of the picture."""
    response: float
    """Of the key point that is taken for the marker's; nan without one."""
    error_px: NDArray[np.float64]
    """(2,) its position minus the true centre; nan without one."""
    blob_error_px: NDArray[np.float64]
    """(2,) its position minus the projected blob's centroid."""
    size_per_side: float
    """Its size over the marker's side in the picture."""


MISSED = np.full(2, np.nan)


def judge(view: View, outcome: Outcome, reference: Reference | None) -> Trial:
    """Compare one picture's key points with the truth.

    The marker's key point is the strongest one of fitting size within 3 px of the centre, else within 0.35 sides;
    without a reference any size fits.
    """
    points = outcome.keypoints
    distance = np.linalg.norm(points.xy - view.center_xy, axis=1)
    ratio = points.size / view.side_px
    fits = np.ones(len(points), bool)
    if reference is not None:
        relative = ratio / reference.size_per_side
        fits = (relative >= 1 / SIZE_RATIO) & (relative <= SIZE_RATIO)
    chosen = next(
        (
            int(near[0])
            for near in (np.flatnonzero(fits & (distance <= d)) for d in (TOLERANCE_PX, _GATE_SIDES * view.side_px))
            if len(near)
        ),
        None,
    )
    if chosen is None:
        return Trial(False, False, False, np.nan, MISSED, MISSED, np.nan)
    xy = points.xy[chosen].astype(np.float64)
    detected = bool(distance[chosen] <= TOLERANCE_PX)
    return Trial(
        detected=detected,
        detected_in_sides=bool(distance[chosen] <= TOLERANCE_SIDES * view.side_px),
        unique=detected and chosen == 0,
        response=float(abs(points.response[chosen])),
        error_px=xy - view.center_xy,
        blob_error_px=xy - view.blob_xy,
        size_per_side=float(ratio[chosen]),
    )


def reference_of(trials: Sequence[Trial]) -> Reference | None:
    """Return the medians over undistorted trials; None if none was detected."""
    found = [trial for trial in trials if trial.detected]
    if not found:
        return None
    return Reference(
        float(np.median([trial.response for trial in found])),
        float(np.median([trial.size_per_side for trial in found])),
    )


def summary(trials: Sequence[Trial], outcomes: Sequence[Outcome], reference: Reference | None) -> dict[str, Any]:
    """Return one point's figures as plain values; None where nothing was found."""
    count = len(trials)
    rows: dict[str, Any] = {"trials": count}
    for name in ("detected", "detected_in_sides", "unique"):
        hits = sum(getattr(trial, name) for trial in trials)
        low, high = wilson(hits, count)
        rows |= {name: hits / count, f"{name}_low": low, f"{name}_high": high}
    responses = np.array([trial.response for trial in trials if trial.detected])
    rows |= _spread("response", responses)
    median = rows["response"]
    rows["response_ratio"] = None if median is None or reference is None else median / reference.response
    rows |= _spread("size_per_side", np.array([trial.size_per_side for trial in trials if trial.detected]))
    rows |= _errors("", np.array([trial.error_px for trial in trials]))
    rows |= _errors("blob_", np.array([trial.blob_error_px for trial in trials]))
    rows["failures"] = sum(bool(outcome.failure) for outcome in outcomes)
    rows["not_finite"] = sum(outcome.not_finite for outcome in outcomes)
    rows["outside"] = sum(outcome.outside for outcome in outcomes)
    rows["first_failure"] = next((outcome.failure for outcome in outcomes if outcome.failure), "")
    return rows


def _spread(name: str, values: NDArray[np.float64]) -> dict[str, float | None]:
    """Return median, 5th and 95th percentile."""
    if len(values) == 0:
        return {name: None, f"{name}_p5": None, f"{name}_p95": None}
    p5, median, p95 = (float(v) for v in np.percentile(values, [5, 50, 95]))
    return {name: median, f"{name}_p5": p5, f"{name}_p95": p95}


def _errors(prefix: str, errors_px: NDArray[np.float64]) -> dict[str, float | None]:
    """Return bias along x and y, RMS and 95th percentile of the distance, over the trials with a key point."""
    found = errors_px[np.isfinite(errors_px).all(axis=1)]
    names = ("bias_x_px", "bias_y_px", "rms_px", "p95_px")
    if len(found) == 0:
        return {prefix + name: None for name in names}
    distance = np.linalg.norm(found, axis=1)
    values = (*found.mean(axis=0), np.sqrt((distance**2).mean()), np.percentile(distance, 95))
    return {prefix + name: float(value) for name, value in zip(names, values, strict=True)}
