"""Many images of one condition through one detector: is the marker found, uniquely, how strongly, how exactly.

Definitions of Section 4.1: a marker is *detected* if a key point of about its size lies within 3 px of its centre,
and *uniquely* if that is the strongest key point of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.outcome import Outcome
from peakmark.experiments.detectability.conditions import MarkerImage
from peakmark.score.markers import Localisation, localisation
from peakmark.score.statistics import Rate, rate
from peakmark.score.wanted import TOLERANCE_PX

TOLERANCE_SIDES = 0.1
"""The limit that goes with the marker's size, shown beside it: the paper's 3 px at 30 px."""

SIZE_RATIO = 2.0
"""A key point is the marker's if its size is within this factor of what an undistorted marker gives."""

_GATE_SIDES = 0.35
"""A key point farther off is not the marker's. Chosen by hand: less than half a side, where its border answers."""


@dataclass(frozen=True)
class ReferenceResponse:
    """What a detector gives for an undistorted marker."""

    response: float
    size_per_side: float
    """Medians of the response, and of the key point's size over the marker's side."""


@dataclass(frozen=True)
class Trial:
    """One image through one detector."""

    detected: bool
    detected_in_sides: bool
    """Within `TOLERANCE_PX`, and within `TOLERANCE_SIDES`."""
    unique: bool
    """Detected, and by the strongest key point of the image."""
    response: float
    """Of the key point that is taken for the marker's; nan without one."""
    error_px: NDArray[np.float64]
    blob_error_px: NDArray[np.float64]
    """(2,) its position minus the true centre, and minus the projected blob's centroid; nan without one."""
    size_per_side: float
    """Its size over the marker's side in the image."""


_NO_ERROR = np.full(2, np.nan)


@dataclass(frozen=True)
class Percentiles:
    """The median and the middle 90 % of a quantity; None where nothing was found."""

    median: float | None
    p5: float | None
    p95: float | None


@dataclass(frozen=True)
class Summary:
    """The trials of one condition through one detector."""

    trials: int
    detected: Rate
    detected_in_sides: Rate
    """Trials with the marker within `TOLERANCE_PX`, and within `TOLERANCE_SIDES`."""
    unique: Rate
    """Trials with the marker as the strongest key point."""
    response: Percentiles
    """Of the marker's key point, where detected."""
    response_ratio: float | None
    """Median response over that of the undistorted marker, of the trials in which it is detected."""
    near_response_ratio: float | None
    """The same of the trials with a key point within 0.35 sides, also beyond 3 px."""
    size_per_side: Percentiles
    """Size of the key point over the marker's side, where detected."""
    error: Localisation
    blob_error: Localisation
    """From the marker's projected centre, and from the centroid of the image of its central blob."""
    failures: int
    """Trials in which the detector raised an exception."""
    not_finite: int
    outside: int
    """Key points with nan or inf, and outside the image, over all trials."""
    first_failure: str
    """The first exception's type and text."""


@dataclass(frozen=True)
class Row:
    """One point through one detector."""

    experiment: str
    marker: str
    series: str
    """What tells this curve from others of the same marker."""
    x: float
    """Position on the axis."""
    detector: str
    found: Summary

    def columns(self) -> dict[str, str | float | None]:
        """Return the columns of rows.csv."""
        found = self.found
        return {
            **{name: getattr(self, name) for name in ("experiment", "marker", "series", "x", "detector")},
            "trials": found.trials,
            **_rate_columns("detected", found.detected),
            **_rate_columns("detected_in_sides", found.detected_in_sides),
            **_rate_columns("unique", found.unique),
            **_percentile_columns("response", found.response),
            "response_ratio": found.response_ratio,
            "near_response_ratio": found.near_response_ratio,
            **_percentile_columns("size_per_side", found.size_per_side),
            **_error_columns("", found.error),
            **_error_columns("blob_", found.blob_error),
            **{name: getattr(found, name) for name in ("failures", "not_finite", "outside", "first_failure")},
        }


def _rate_columns(name: str, share: Rate) -> dict[str, float | None]:
    return {name: share.value, f"{name}_low": share.low, f"{name}_high": share.high}


def _percentile_columns(name: str, found: Percentiles) -> dict[str, float | None]:
    return {name: found.median, f"{name}_p5": found.p5, f"{name}_p95": found.p95}


def _error_columns(prefix: str, found: Localisation) -> dict[str, float | None]:
    x, y = found.bias_xy or (None, None)
    names = ("bias_x_px", "bias_y_px", "rms_px", "p95_px")
    return {f"{prefix}{name}": value for name, value in zip(names, (x, y, found.rms, found.p95), strict=True)}


def score_image(view: MarkerImage, outcome: Outcome, reference: ReferenceResponse | None) -> Trial:
    """Compare one image's key points with the truth.

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
        return Trial(False, False, False, np.nan, _NO_ERROR, _NO_ERROR, np.nan)
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


def reference_response(trials: Sequence[Trial]) -> ReferenceResponse | None:
    """Return the medians over undistorted trials; None if none was detected."""
    found = [trial for trial in trials if trial.detected]
    if not found:
        return None
    return ReferenceResponse(
        float(np.median([trial.response for trial in found])),
        float(np.median([trial.size_per_side for trial in found])),
    )


def summarise_trials(
    trials: Sequence[Trial], outcomes: Sequence[Outcome], reference: ReferenceResponse | None
) -> Summary:
    """Return the figures of one condition's trials through one detector."""
    detected = [trial for trial in trials if trial.detected]
    response = _percentiles([trial.response for trial in detected])
    near = _percentiles([trial.response for trial in trials if np.isfinite(trial.response)])
    return Summary(
        trials=len(trials),
        detected=rate(len(detected), len(trials)),
        detected_in_sides=rate(sum(trial.detected_in_sides for trial in trials), len(trials)),
        unique=rate(sum(trial.unique for trial in trials), len(trials)),
        response=response,
        response_ratio=_over(response, reference),
        near_response_ratio=_over(near, reference),
        size_per_side=_percentiles([trial.size_per_side for trial in detected]),
        error=_localisation([trial.error_px for trial in trials]),
        blob_error=_localisation([trial.blob_error_px for trial in trials]),
        failures=sum(bool(outcome.failure) for outcome in outcomes),
        not_finite=sum(outcome.not_finite for outcome in outcomes),
        outside=sum(outcome.outside for outcome in outcomes),
        first_failure=next((outcome.failure for outcome in outcomes if outcome.failure), ""),
    )


def _over(response: Percentiles, reference: ReferenceResponse | None) -> float | None:
    return None if response.median is None or reference is None else response.median / reference.response


def _percentiles(values: Sequence[float]) -> Percentiles:
    if not values:
        return Percentiles(None, None, None)
    p5, median, p95 = (float(value) for value in np.percentile(values, [5, 50, 95]))
    return Percentiles(median, p5, p95)


def _localisation(errors_px: Sequence[NDArray[np.float64]]) -> Localisation:
    """Return the errors over the trials with a key point; (2,) each, nan without one."""
    return localisation(np.array([error for error in errors_px if np.isfinite(error).all()]))
