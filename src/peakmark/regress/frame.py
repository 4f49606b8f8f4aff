"""One frame's result: what was wanted, found and wrongly found, as one line of a record."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth
from pydantic import ConfigDict, Field, Strict

from peakmark.identification.detection import Detection
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity
from peakmark.regress.detector_protocol import LARGEST, Found
from peakmark.score.markers import score_frame
from peakmark.score.wanted import Wanted

_DECIMALS = 3  # of a pixel in a record

_POLARITIES: dict[int, Polarity] = {1: "dark", -1: "light"}  # by the sign of the Laplacian; 0 tells nothing

Figure = Annotated[float, Strict(), Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Pixel = tuple[Figure, Figure]
Count = Annotated[int, Strict(), Field(ge=0, lt=2**53)]
"""What a record's file may state: a baseline of nan, infinity or text compares with nothing."""


@dataclass(frozen=True)
class ScoredMarker:
    """A marker that was wanted."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    side_px: Figure
    """Its true side."""
    true_xy: Pixel
    """Its true centre, px."""
    xy: Pixel | None = None
    """Where it was found, px; None if it was not."""
    response: Figure | None = None
    """Of the detection."""
    polarity_is_right: Annotated[bool, Strict()] | None = None
    """Whether it was taken for what it is, light or dark; None if not found, or if it or the detector tells none."""


@dataclass(frozen=True)
class ScoredFrame:
    """What a detector made of one frame."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    frame: Count
    """Index in the suite."""
    picture: str
    """First 16 hexadecimal digits of the SHA-256 of the image's pixels; named as in the file."""
    features: Count = 0
    """Key points found."""
    failure: str | None = None
    """Why the detector gave no answer."""
    false_xy: tuple[Pixel, ...] | None = None
    """Detections at no marker, px; None where the detector does not say what it takes for a marker."""
    drop: Figure | None = None
    """Weakest found marker's response over the strongest clutter's."""
    markers: dict[str, ScoredMarker] = field(default_factory=dict)
    """Name → result of the markers wanted."""

    @property
    def found(self) -> int:
        """How many of the markers were found."""
        return sum(marker.xy is not None for marker in self.markers.values())


def score_answer(
    frame: int, digest: str, truth: Sequence[MarkerTruth], found: Found, wanted: Wanted, tolerance_px: float
) -> ScoredFrame:
    """Score what was found in a frame."""
    known = [t for t in truth if wanted.counts(t)]
    visible = [t for t in known if t.visible_fraction > 0]
    detections = found.detections
    if detections is None:
        detections = strongest_at_markers(visible, found.features, tolerance_px)
    score = score_frame(known, detections, found.features, wanted, tolerance_px)
    matched = set(score.matches.values())
    false = [_rounded(d.xy) for i, d in enumerate(detections) if i not in matched]
    return ScoredFrame(
        frame=frame,
        picture=digest,
        features=len(found.features),
        false_xy=None if found.detections is None else tuple(false),
        drop=None if score.response_drop is None else float(f"{score.response_drop:.6g}"),
        markers={t.name: _marker_result(t, detections, score.matches) for t in wanted.of(truth)},
    )


def score_failure(frame: int, digest: str, truth: Sequence[MarkerTruth], reason: str, wanted: Wanted) -> ScoredFrame:
    """Return the result of a frame on which the detector gave no answer: every marker is missed."""
    return ScoredFrame(
        frame, digest, failure=reason, markers={t.name: _marker_result(t, (), {}) for t in wanted.of(truth)}
    )


def _marker_result(marker: MarkerTruth, detections: Sequence[Detection], matches: dict[str, int]) -> ScoredMarker:
    truth = (round(marker.side_px, _DECIMALS), _rounded(marker.center_xy))
    if marker.name not in matches:
        return ScoredMarker(*truth)
    detection = detections[matches[marker.name]]
    stated = {polarity for polarity in ("light", "dark") if polarity in marker.kind}
    right = detection.polarity in stated if stated and detection.polarity is not None else None
    return ScoredMarker(*truth, _rounded(detection.xy), float(f"{detection.response:.6g}"), right)


def _rounded(xy: NDArray[np.float64]) -> tuple[float, float]:
    return round(float(xy[0]), _DECIMALS), round(float(xy[1]), _DECIMALS)


def strongest_at_markers(
    visible: Sequence[MarkerTruth], features: Keypoints, tolerance_px: float
) -> tuple[Detection, ...]:
    """Return the strongest key point at each marker's centre, by which a detector that does not identify is scored."""
    found: list[Detection] = []
    for marker in visible:
        near = np.flatnonzero(np.linalg.norm(features.xy - marker.center_xy, axis=1) <= tolerance_px)
        if len(near):
            i = int(near[0])  # features come strongest first
            xy = features.xy[i].astype(np.float64)
            size, response = float(features.size[i]), float(features.response[i])
            polarity: Polarity | None = _POLARITIES.get(int(features.laplacian[i]))
            found.append(Detection(len(found), xy, size, polarity, response, 0.0, i + 1))
    return tuple(found)
