"""Which markers of a frame count: what a detector must find."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from peaksim.camera.frame import MarkerTruth

from peakmark.identification.stretch import Stretch
from peakmark.markers.patterns import Polarity

TOLERANCE_PX = 3.0
"""A marker detected farther off counts as undetected (paper, Section 4.1)."""

FULLY_IN_VIEW = 0.95
"""Visible fraction from which a marker must be found; below, finding it is neither required nor wrong. Chosen by hand:
less than 1, because the fraction is counted in pixels."""

SMALLEST_PX = 20.0
"""Side from which a marker must be found, unless an experiment says otherwise; chosen by hand, where the recall on the
floor and in the CAVE comes near 1 (docs/figures/driving.md)."""

STEEPEST_DEG = 45.0
"""Tilt up to which markers on walls, and arrays, must be read; chosen by hand, for nothing is stretched there."""


@dataclass(frozen=True)
class Wanted:
    """What a marker must be like to count as one that must be found; every limit is itself allowed."""

    min_side_px: float = 0.0
    """Smallest side, after stretching."""
    max_tilt_deg: float = 90.0
    min_visible: float = FULLY_IN_VIEW
    kinds: tuple[str, ...] = ()
    """Beginnings of the kinds that count; empty for all."""
    stretch: Stretch = 1.0
    """Vertical stretch before detection: one factor, or (H,) one for each row; it makes markers larger."""

    def of(self, markers: Iterable[MarkerTruth]) -> list[MarkerTruth]:
        """Return the markers that must be found."""
        return [marker for marker in markers if self.includes(marker)]

    def includes(self, marker: MarkerTruth) -> bool:
        """Return whether a marker must be found."""
        return (
            self.counts(marker)
            and marker.visible_fraction >= self.min_visible
            and marker.tilt_deg <= self.max_tilt_deg
            and stretched_side_px(marker, self.stretch) >= self.min_side_px
        )

    def counts(self, marker: MarkerTruth) -> bool:
        """Return whether a marker is of a kind that counts, so that finding it is at least not wrong."""
        return not self.kinds or marker.kind.startswith(self.kinds)


IN_VIEW = Wanted()
"""Every marker that is fully in view."""

READABLE = Wanted(min_side_px=SMALLEST_PX, max_tilt_deg=STEEPEST_DEG)
"""Markers on walls: fully in view, large and square enough to be read."""


def stretched_side_px(marker: MarkerTruth, stretch: Stretch) -> float:
    """Return a marker's side once the image is stretched vertically: the square root of its area there."""
    factor = np.asarray(stretch, dtype=np.float64)
    if factor.ndim == 0:
        return float(marker.side_px * np.sqrt(factor))
    row = int(np.clip(round(float(marker.center_xy[1])), 0, factor.size - 1))
    return float(marker.side_px * np.sqrt(factor[row]))


def polarity_of(kind: str) -> Polarity:
    """Return the polarity of a mark's kind, such as "surf-light"."""
    return "light" if kind.endswith("light") else "dark"
