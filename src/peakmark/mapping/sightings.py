"""Where arrays are seen in photographs, and what each sighting alone says of the camera's pose to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose

from peakmark.arrays.decode import MarkerArray
from peakmark.found.found import Found
from peakmark.localise.from_arrays import Place, pose_from_arrays
from peakmark.localise.residuals import refined_sigmas
from peakmark.markers.array_code import Layout

_AXES = np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]])


@dataclass(frozen=True)
class Sighting:
    """One array in one photograph."""

    image: int
    """Number of the photograph."""
    code: int
    """Of the array."""
    xy: NDArray[np.float64]
    """(k, 2) its markers' centres in reading order, px."""
    sigma_px: NDArray[np.float64]
    """(k,) expected errors along each axis, up to a factor common to all."""
    array_from_camera: tuple[Pose, ...]
    """The pose that its markers tell, and the other one that a flat target leaves, if any."""


def cell_points_m(layout: Layout, side_m: float) -> NDArray[np.float64]:
    """Return (k, 3) centres of an array's markers in its own frame: x right, y up, z out, its middle the origin."""
    middle = (np.array([layout.columns, layout.rows]) - 1) / 2
    xy = (np.array(layout.cells) - middle) * [1, -1] * layout.pitch * side_m
    return np.column_stack([xy, np.zeros(len(xy))])


def sightings_of(
    photographs: Sequence[Found], camera: Camera, layout: Layout, side_m: float
) -> tuple[list[Sighting], list[int]]:
    """Return every array with a code in the photographs, and the codes that one photograph showed twice.

    The latter hang at several places, and are left out everywhere.
    """
    read = [[array for array in found.arrays if array.code is not None] for found in photographs]
    twice = {int(a.code or 0) for arrays in read for a in arrays if sum(b.code == a.code for b in arrays) > 1}
    place = Place(cell_points_m(layout, side_m), _AXES, side_m)
    found = [
        _sighting(number, array, camera, place)
        for number, arrays in enumerate(read)
        for array in arrays
        if array.code not in twice
    ]
    return [each for each in found if each is not None], sorted(twice)


def _sighting(image: int, array: MarkerArray, camera: Camera, place: Place) -> Sighting | None:
    if any(marker.affinity is None for marker in array.detections):
        return None
    assert array.code is not None
    estimate = pose_from_arrays(camera, [array], {array.code: place})
    if estimate is None:
        return None
    poses = tuple(fit.world_from_camera for fit in (estimate.fit, estimate.rival) if fit is not None)
    sigma, _ = refined_sigmas(np.array([marker.affinity for marker in array.detections]))
    return Sighting(image, array.code, np.array([marker.xy for marker in array.detections]), sigma, poses)
