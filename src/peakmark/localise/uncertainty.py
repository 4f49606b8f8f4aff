"""How far off refined markers are: what their alignment's residuals say, and what no residual shows."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.detection import Detection
from peakmark.localise.residuals import MarkerFits, refined_sigmas

CENTER_FLOOR_PX, SHAPE_FLOOR_PX, PERSPECTIVE_FLOOR = 0.012, 0.01, 0.002
"""σ of a centre, of a shape, and of a perspective a side that an alignment does not see; set by hand, as are
`SHAPE_FACTOR` and `residuals.ALIKE_PX`, on what `scripts/evaluate_poses.py --seed 101` measures."""

SHAPE_FACTOR = 1.2
"""How many times its stated σ a shape is off."""


def marker_fits(markers: Sequence[Detection]) -> MarkerFits:
    """Return what the alignments of refined markers say, and how far they are off.

    Markers whose alignment states no spread, such as those of a detector of one's own, get what their size lets expect
    (`refined_sigmas`, whose σ of shapes is doubled for what all in a frame have in common).
    """
    count = len(markers)
    perspective, covariance, drawn = np.full((count, 2), np.nan), np.empty((count, 8, 8)), np.zeros((count, 8, 2))
    for k, marker in enumerate(markers):
        covariance[k] = _covariance(marker)
        if marker.spread is not None and marker.perspective is not None:
            perspective[k], drawn[k] = marker.perspective, marker.spread.drawn
    return MarkerFits(perspective, covariance, drawn)


def _covariance(marker: Detection) -> NDArray[np.float64]:
    assert marker.affinity is not None
    if marker.spread is None or marker.perspective is None:
        center, shape = refined_sigmas(marker.affinity[None])
        alone = shape[0] / 2 if marker.made_for == "surf" else shape[0]
        return np.diag(np.repeat([center[0], alone, 1.0], [2, 4, 2]) ** 2)
    factors = np.repeat([1.0, SHAPE_FACTOR, 1.0], [2, 4, 2])
    floors = np.repeat([CENTER_FLOOR_PX, SHAPE_FLOOR_PX, PERSPECTIVE_FLOOR], [2, 4, 2])
    return np.asarray(factors[:, None] * marker.spread.covariance * factors + np.diag(floors**2))
