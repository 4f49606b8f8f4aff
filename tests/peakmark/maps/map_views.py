"""What a camera sees of a map: its markers projected exactly, or with the errors of refined ones."""

import numpy as np
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose

from peakmark.identification.detection import Detection
from peakmark.localise.pose import expected_shapes
from peakmark.localise.residuals import refined_sigmas
from peakmark.maps.marker_map import MarkerMap


def detections(
    marker_map: MarkerMap, camera: Camera, world_from_camera: Pose, rng: np.random.Generator | None = None
) -> list[Detection]:
    """Return detections of all markers that face the camera and lie inside the image, in the map's order."""
    xy, shapes = expected_shapes(camera, world_from_camera, marker_map.centers_m, marker_map.tangents_m)
    found = []
    for number in np.flatnonzero(np.linalg.det(np.nan_to_num(shapes)) > 0):
        center, shape = xy[number], shapes[number]
        if rng is not None:
            center_sigma, shape_sigma = refined_sigmas(shape[None])
            center = center + center_sigma[0] * rng.standard_normal(2)
            shape = shape + shape_sigma[0] * rng.standard_normal((2, 2)) / 2
        side = float(np.sqrt(np.linalg.det(shape)))
        polarity = marker_map.polarities[number]
        found.append(Detection(int(number), center, side, polarity, 1e4 - number, np.nan, number + 1, shape, 0.99))
    return found
