"""Dark and light markers of one picture against truth: which were found, and whether their polarity is right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from peaksim.frame import MarkerTruth

from peakmark.identification_both import Both, polarity_by_signature
from peakmark.score import FULLY_IN_VIEW, TOLERANCE_PX, match
from peakmark.score_arrays import SMALLEST_PX, STEEPEST_DEG, polarity_of


@dataclass(frozen=True)
class MarkerResult:
    """What became of a visible marker."""

    name: str
    """Of the mark."""
    side_px: float
    """True side in the picture."""
    tilt_deg: float
    """True tilt."""
    distance_m: float
    """True distance."""
    is_in_view: bool
    """Whether it is fully in view."""
    is_wanted: bool
    """Whether it must be found: fully in view, ≥ `SMALLEST_PX`, tilted to `STEEPEST_DEG`."""
    is_found: bool
    """Whether a detection lies within `TOLERANCE_PX`."""
    error_px: float | None = None
    """Distance of the detection from the true centre; None if not found."""
    is_polarity_right: bool | None = None
    """By the sign of the Laplacian; None if not found."""
    is_signature_right: bool | None = None
    """Whether the signature tells the polarity, too; None if not found."""


@dataclass(frozen=True)
class BothScore:
    """One picture's result."""

    markers: tuple[MarkerResult, ...]
    """All visible markers."""
    false_detections: int
    """Detections within the tolerance of no visible marker."""

    @property
    def wanted(self) -> int:
        """Number of markers that must be found."""
        return sum(marker.is_wanted for marker in self.markers)

    @property
    def found(self) -> int:
        """Number of those that were."""
        return sum(marker.is_wanted and marker.is_found for marker in self.markers)

    @property
    def polarity_errors(self) -> int:
        """Wanted markers that were found with the wrong sign of the Laplacian."""
        return sum(marker.is_wanted and marker.is_polarity_right is False for marker in self.markers)

    @property
    def signature_errors(self) -> int:
        """Wanted markers that were found with a signature nearer to that of the other polarity."""
        return sum(marker.is_wanted and marker.is_signature_right is False for marker in self.markers)

    @property
    def missed(self) -> tuple[str, ...]:
        """Names of wanted markers that were not found."""
        return tuple(marker.name for marker in self.markers if marker.is_wanted and not marker.is_found)


def score_both(truth: Sequence[MarkerTruth], found: Both) -> BothScore:
    """Score one picture's markers of both polarities."""
    visible = [t for t in truth if t.visible_fraction > 0]
    matches = match(visible, found.detections, TOLERANCE_PX)
    results = tuple(_result(t, found, matches.get(t.name)) for t in visible)
    return BothScore(results, len(found.detections) - len(matches))


def is_wanted(truth: MarkerTruth) -> bool:
    """Return whether a marker must be found; see `MarkerResult.is_wanted`."""
    is_clear = truth.visible_fraction >= FULLY_IN_VIEW and truth.tilt_deg <= STEEPEST_DEG
    return is_clear and truth.side_px >= SMALLEST_PX


def _result(truth: MarkerTruth, found: Both, index: int | None) -> MarkerResult:
    is_in_view = truth.visible_fraction >= FULLY_IN_VIEW
    place = (truth.name, truth.side_px, truth.tilt_deg, truth.distance_m, is_in_view, is_wanted(truth))
    if index is None:
        return MarkerResult(*place, is_found=False)
    detection = found.detections[index]
    assert found.features.descriptors is not None
    (by_signature,) = polarity_by_signature(found.features.descriptors[detection.rank - 1 : detection.rank])
    polarity = polarity_of(truth.kind)
    return MarkerResult(
        *place,
        is_found=True,
        error_px=float(np.linalg.norm(detection.xy - truth.center_xy)),
        is_polarity_right=detection.polarity == polarity,
        is_signature_right=by_signature == polarity,
    )
