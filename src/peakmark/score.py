"""Detections against truth: which markers were found, how precisely, and how far clutter stays behind."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.frame import MarkerTruth

from peakmark.identification import Detection
from peakmark.keypoints import Keypoints

TOLERANCE_PX = 3.0
"""A marker detected farther off counts as undetected (paper, Section 4.1)."""

FULLY_IN_VIEW = 0.95
"""Visible fraction from which a marker must be found; below, finding it is neither asked for nor wrong."""


@dataclass(frozen=True)
class Localisation:
    """Distances of found markers from their true centres."""

    bias: float | None
    """Length of the mean error vector, px; None where nothing was found."""
    bias_xy: tuple[float, float] | None
    """Mean error vector, detected − true, px."""
    rms: float | None
    """Root mean square distance, px."""
    p95: float | None
    """95th percentile of the distance, px."""


@dataclass(frozen=True)
class Score:
    """One frame's result."""

    markers_in_view: int
    """Markers whose visible fraction is at least `FULLY_IN_VIEW`."""
    markers_found: int
    """Those of them that were detected within the tolerance."""
    missed: tuple[str, ...]
    """Names of those that were not."""
    false_detections: int
    """Detections that are within the tolerance of no marker."""
    matches: dict[str, int]
    """Marker name → index into the detections, partly visible markers included."""
    localisation: Localisation
    """Of the found markers."""
    rank_of_last_marker: int | None
    """Rank among all features of the weakest found marker's strongest feature; None where nothing was found."""
    false_above_last_marker: int | None
    """Features that belong to no marker and are stronger than the weakest found marker's strongest one."""
    strongest_clutter: float | None
    """Response of the strongest feature that is at no marker's centre."""
    response_drop: float | None
    """Weakest found marker's strongest response over the strongest clutter; > 1 is unique detectability."""

    def summary(self) -> dict[str, Any]:
        """Return the plain values for JSON, without the matches."""
        values = asdict(self)
        del values["matches"]
        return values


def score_frame(
    truth: Sequence[MarkerTruth],
    detections: Sequence[Detection],
    features: Keypoints,
    tolerance_px: float = TOLERANCE_PX,
) -> Score:
    """Score one frame's detections, and the features that they were chosen from, against truth.

    Parameters
    ----------
    truth
        Records of all markers of the scene.
    detections
        Identified markers.
    features
        All key points, strongest first, in the coordinates of the truth.
    tolerance_px
        Largest distance from a true centre that counts as found.
    """
    visible = [t for t in truth if t.visible_fraction > 0]
    in_view = [t for t in visible if t.visible_fraction >= FULLY_IN_VIEW]
    matches = match(visible, detections, tolerance_px)
    found = [t for t in in_view if t.name in matches]
    errors = np.array([detections[matches[t.name]].xy - t.center_xy for t in found]).reshape(-1, 2)
    owner = owners(visible, features, tolerance_px)
    ranks = [_strongest(owner, visible.index(t)) for t in found]
    last = max((rank for rank in ranks if rank is not None), default=None)
    clutter = _strongest(owner, -1)
    return Score(
        markers_in_view=len(in_view),
        markers_found=len(found),
        missed=tuple(t.name for t in in_view if t.name not in matches),
        false_detections=len(detections) - len(matches),
        matches=matches,
        localisation=localisation(errors),
        rank_of_last_marker=None if last is None else last + 1,
        false_above_last_marker=None if last is None else int((owner[:last] == -1).sum()),
        strongest_clutter=None if clutter is None else float(features.response[clutter]),
        response_drop=None
        if last is None or clutter is None
        else float(features.response[last] / features.response[clutter]),
    )


def match(
    truth: Sequence[MarkerTruth], detections: Sequence[Detection], tolerance_px: float
) -> dict[str, int]:
    """Pair markers with detections one to one within the tolerance, the nearest pairs first."""
    if not truth or not detections:
        return {}
    centers = np.array([t.center_xy for t in truth])
    gaps = np.linalg.norm(centers[:, None] - np.array([d.xy for d in detections])[None], axis=2)
    matches: dict[str, int] = {}
    for i, j in zip(*np.unravel_index(np.argsort(gaps, axis=None, kind="stable"), gaps.shape), strict=True):
        if gaps[i, j] > tolerance_px:
            break
        if truth[i].name not in matches and j not in matches.values():
            matches[truth[i].name] = int(j)
    return matches


def owners(truth: Sequence[MarkerTruth], features: Keypoints, tolerance_px: float) -> NDArray[np.intp]:
    """Return for each feature the index of the marker at whose centre it lies, −1 for clutter."""
    owner = np.full(len(features), -1, dtype=np.intp)
    for i, marker in enumerate(truth):
        owner[np.linalg.norm(features.xy - marker.center_xy, axis=1) <= tolerance_px] = i
    return owner


def _strongest(owner: NDArray[np.intp], index: int) -> int | None:
    """Return the row of the strongest feature of an owner; features come strongest first."""
    rows = np.flatnonzero(owner == index)
    return int(rows[0]) if len(rows) else None


def localisation(errors_px: NDArray[np.float64]) -> Localisation:
    """Summarise (n, 2) error vectors."""
    if len(errors_px) == 0:
        return Localisation(None, None, None, None)
    mean = errors_px.mean(axis=0)
    gaps = np.linalg.norm(errors_px, axis=1)
    return Localisation(
        bias=float(np.linalg.norm(mean)),
        bias_xy=(float(mean[0]), float(mean[1])),
        rms=float(np.sqrt((gaps**2).mean())),
        p95=float(np.percentile(gaps, 95)),
    )
