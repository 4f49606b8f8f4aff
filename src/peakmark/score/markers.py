"""Detections against truth: which markers were found, how precisely, and how far clutter stays below them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.identification.detection import Detection
from peakmark.identification.sift_signature import sift_signature_distances
from peakmark.identification.signature import polarity_by_signature
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity, Variant
from peakmark.score.wanted import IN_VIEW, TOLERANCE_PX, Wanted, polarity_of

_BOTH: tuple[Polarity, ...] = ("dark", "light")


@dataclass(frozen=True)
class Localisation:
    """Distances of found markers from their true centres."""

    bias: float | None
    bias_xy: tuple[float, float] | None
    """Length of the mean error vector, detected − true, and the vector, px; None where nothing was found."""
    rms: float | None
    p95: float | None
    """Root mean square and 95th percentile of the distance, px."""


@dataclass(frozen=True)
class MarkerScore:
    """What became of a visible marker."""

    name: str
    side_px: float
    tilt_deg: float
    distance_m: float
    """True side in the image, tilt and distance."""
    is_in_view: bool
    """Whether it is fully in view."""
    is_wanted: bool
    """Whether it must be found."""
    is_found: bool
    """Whether a detection lies within the tolerance."""
    error_px: float | None = None
    """Distance of the detection from the true centre; None if not found."""
    is_polarity_right: bool | None = None
    """By the sign of the Laplacian; None if not found."""
    is_signature_right: bool | None = None
    """Whether the signature gives the polarity, too; None if not found, or without descriptors."""


@dataclass(frozen=True)
class ScoreSummary:
    """One frame's result without the single markers: what files keep of it."""

    markers_in_view: int
    markers_found: int
    """Markers that must be found, and those that were."""
    missed: tuple[str, ...]
    """Names of the others."""
    false_detections: int
    """Detections that are within the tolerance of no visible marker."""
    localisation_px: Localisation
    """Of the found markers that are fully in view."""
    rank_of_last_marker: int | None
    """Rank among all features of the strongest feature of the weakest of them; None where nothing was found."""
    false_above_last_marker: int | None
    """Features that belong to no marker and are stronger than that one."""
    strongest_clutter: float | None
    """Response of the strongest feature that is at no marker's centre."""
    response_drop: float | None
    """Response of the weakest found marker over the strongest clutter; > 1 is unique detectability."""


@dataclass(frozen=True)
class Score(ScoreSummary):
    """One frame's result."""

    markers: tuple[MarkerScore, ...]
    """All visible markers."""
    matches: dict[str, int]
    """Marker name → index into the detections, partly visible markers included."""

    @property
    def polarity_errors(self) -> int:
        """Wanted markers that were found with the wrong sign of the Laplacian."""
        return sum(marker.is_wanted and marker.is_polarity_right is False for marker in self.markers)

    @property
    def signature_errors(self) -> int:
        """Wanted markers that were found with a signature nearer to that of the other polarity."""
        return sum(marker.is_wanted and marker.is_signature_right is False for marker in self.markers)

    def summary(self) -> ScoreSummary:
        """Return counts and errors, without the single markers."""
        return ScoreSummary(**{field.name: getattr(self, field.name) for field in fields(ScoreSummary)})


def score_frame(
    truth: Sequence[MarkerTruth],
    detections: Sequence[Detection],
    features: Keypoints,
    wanted: Wanted = IN_VIEW,
    tolerance_px: float = TOLERANCE_PX,
) -> Score:
    """Score one frame's detections, and the features that they were chosen from, against truth.

    `truth` holds all markers of the scene, `features` all key points, strongest first, in its coordinates; `wanted`
    says which markers must be found, `tolerance_px` how far from a true centre at most.
    """
    visible = [t for t in truth if t.visible_fraction > 0]
    matches = match(visible, detections, tolerance_px)
    found = [t for t in IN_VIEW.of(visible) if t.name in matches]
    errors = np.array([detections[matches[t.name]].xy - t.center_xy for t in found]).reshape(-1, 2)
    owner = owners(visible, features, tolerance_px)
    ranks = [_strongest(owner, visible.index(t)) for t in found]
    last = max((rank for rank in ranks if rank is not None), default=None)
    clutter = _strongest(owner, -1)
    drop = None if last is None or clutter is None else _ratio(features.response[last], features.response[clutter])
    found_as = {name: detections[index] for name, index in matches.items()}
    markers = tuple(_result(t, found_as.get(t.name), features, wanted) for t in visible)
    required = [marker for marker in markers if marker.is_wanted]
    return Score(
        markers=markers,
        markers_in_view=len(required),
        markers_found=sum(marker.is_found for marker in required),
        missed=tuple(marker.name for marker in required if not marker.is_found),
        false_detections=len(detections) - len(matches),
        matches=matches,
        localisation_px=localisation(errors),
        rank_of_last_marker=None if last is None else last + 1,
        false_above_last_marker=None if last is None else int((owner[:last] == -1).sum()),
        strongest_clutter=None if clutter is None else float(features.response[clutter]),
        response_drop=drop,
    )


def _ratio(response: np.float32, other: np.float32) -> float | None:
    """Return a ratio of responses; None where it is no finite number, as for a detector that gives none."""
    with np.errstate(all="ignore"):
        ratio = float(response / other)
    return ratio if np.isfinite(ratio) else None


def _result(truth: MarkerTruth, detection: Detection | None, features: Keypoints, wanted: Wanted) -> MarkerScore:
    geometry = (truth.name, truth.side_px, truth.tilt_deg, truth.distance_m)
    known = (*geometry, IN_VIEW.includes(truth), wanted.includes(truth))
    if detection is None:
        return MarkerScore(*known, is_found=False)
    polarity = polarity_of(truth.kind)
    return MarkerScore(
        *known,
        is_found=True,
        error_px=float(np.linalg.norm(detection.xy - truth.center_xy)),
        is_polarity_right=detection.polarity == polarity,
        is_signature_right=_has_signature_of(polarity, detection, features),
    )


def _has_signature_of(polarity: Polarity, detection: Detection, features: Keypoints) -> bool | None:
    if features.descriptors is None or detection.rank < 1:
        return None
    row = features.descriptors[detection.rank - 1 : detection.rank]
    if row.shape == (1, 128) and detection.made_for == "sift":
        dark, light = (sift_signature_distances(row, (Variant(each, detection.limit, "sift"),))[0] for each in _BOTH)
        return bool((dark < light) == (polarity == "dark"))
    return polarity_by_signature(row) == [polarity] if row.shape == (1, 64) else None


def match(truth: Sequence[MarkerTruth], detections: Sequence[Detection], tolerance_px: float) -> dict[str, int]:
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


def ranks_above_clutter(truth: Sequence[MarkerTruth], features: Keypoints) -> dict[str, tuple[int, ...]]:
    """Return by marker the 1-based ranks of the features at its centre that are stronger than all clutter.

    A marker has several where another octave or orientation finds it again: together they are the paper's "16 highest
    response features for 14 present markers". Features of the other polarity at its centre, such as its white border's,
    are neither its own nor clutter. A marker without any has no entry.
    """
    visible = [marker for marker in truth if marker.visible_fraction > 0]
    owner = owners(visible, features, TOLERANCE_PX)
    above = owner[: _strongest(owner, -1)]
    signs = np.array([1 if polarity_of(marker.kind) == "dark" else -1 for marker in visible])
    own = features.laplacian[: len(above)] * signs[above] >= 0 if len(above) else np.zeros(0, bool)
    return {visible[k].name: tuple((np.flatnonzero((above == k) & own) + 1).tolist()) for k in sorted({*above[own]})}


def at_markers(truth: Sequence[MarkerTruth], features: Keypoints) -> NDArray[np.bool_]:
    """Return for each feature whether it lies at a visible marker's centre."""
    visible = [marker for marker in truth if marker.visible_fraction > 0]
    return owners(visible, features, TOLERANCE_PX) >= 0
