"""The camera's pose from decoded arrays whose places are known: their codes say which marker is which.

Each refined marker gives its centre and its shape. One array is a flat target, which two poses explain nearly equally
well (the mirrored one tilts the other way); several on different walls leave no such doubt.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera

from peakmark.arrays.decode import MarkerArray
from peakmark.errors import InputError
from peakmark.identification.detection import Detection
from peakmark.localise.pose import PoseEstimate, estimate_pose
from peakmark.localise.residuals import Correspondences


@dataclass(frozen=True)
class Place:
    """Where an array's markers are."""

    centers_m: NDArray[np.float64]
    """(k, 3) world centres in reading order."""
    axes: NDArray[np.float64]
    """(3, 2) unit vectors along rows and columns of the pattern (x right, y down), world."""
    side_m: float
    """Side of a marker."""


def pose_from_arrays(camera: Camera, arrays: Sequence[MarkerArray], places: Mapping[int, Place]) -> PoseEstimate | None:
    """Return the camera's pose from every array with a code that is on the map; None without any.

    `places` says where each code is. The arrays' markers must be refined (`Detection.affinity`), and as many as their
    place has; else an `InputError`.
    """
    known = [(array, places[array.code]) for array in arrays if array.code is not None and array.code in places]
    if not known:
        return None
    seen = _correspondences(known)
    return estimate_pose(camera, seen, *_corners(known, seen))


def _correspondences(known: Sequence[tuple[MarkerArray, Place]]) -> Correspondences:
    found = [d for array, _ in known for d in array.detections]
    centers = [place.centers_m for _, place in known]
    if any(d.affinity is None for d in found):
        raise InputError("arrays: expected refined markers, got one without an affinity")
    if any(len(array.detections) != len(place.centers_m) for array, place in known):
        raise InputError("arrays: expected places with as many markers as their arrays")
    tangents = [np.broadcast_to(place.side_m * place.axes, (len(place.centers_m), 3, 2)) for _, place in known]
    return Correspondences(
        xy=np.array([d.xy for d in found]),
        centers_m=np.concatenate(centers),
        tangents_m=np.concatenate(tangents),
        affinity=np.array([_shape(array, d) for array, _ in known for d in array.detections]),
    )


def _shape(array: MarkerArray, marker: Detection) -> NDArray[np.float64]:
    """Return a marker's affinity; for a round one the array's own steps stand, in its sides.

    A round marker shows no rotation, and how large a DoG is cannot be told well from how blurred it is.
    """
    if marker.made_for == "surf":
        return np.asarray(marker.affinity, dtype=np.float64)
    return np.asarray(array.steps_px / array.layout.pitch)


def _corners(
    known: Sequence[tuple[MarkerArray, Place]], seen: Correspondences
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (5 k, 2) px and (5 k, 3) m of centres and the ends of the markers' axes.

    The pattern looks the same after a rotation by 90°; the array tells where its rows run.
    """
    assert seen.affinity is not None
    xy, points = [seen.xy], [seen.centers_m]
    first = 0
    for array, _ in known:
        rows = slice(first, first + len(array.detections))
        first = rows.stop
        along = array.steps_px[:, 0]
        for k in range(rows.start, rows.stop):
            shape = rotated_to(seen.affinity[k], along)
            for axis in (0, 1):
                for half in (-0.5, 0.5):
                    xy.append(seen.xy[k : k + 1] + half * shape[:, axis])
                    points.append(seen.centers_m[k : k + 1] + half * seen.tangents_m[k][:, axis])
    return np.concatenate(xy), np.concatenate(points)


def rotated_to(affinity: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (2, 2) affinity rotated by the multiple of 90° that brings its first axis nearest to `along` (2,)."""
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    shapes = [affinity @ np.linalg.matrix_power(quarter, k) for k in range(4)]
    return np.asarray(max(shapes, key=lambda s: float(s[:, 0] @ along) / float(np.linalg.norm(s[:, 0]))))
