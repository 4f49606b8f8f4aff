"""The public API as a user types it: `tests/test_typing.py` lets mypy and pyright read this file. It is never run."""

from pathlib import Path
from typing import assert_type

import numpy as np
from numpy.typing import NDArray
from peaksim import Camera, Frame, Scene, Trajectory, camera_named, load_scene, load_trajectory, render
from peaksim.camera import apply_sensor, sensor_named

from peakmark import Detection, Found, Keypoints, Location, MarkerMap, find, identify, load_map, locate, marker, surf
from peakmark.arrays import MarkerArray, decode_arrays
from peakmark.detectors import find_detector
from peakmark.refine import Refined, refine

setup = load_scene("cave")  # unpacked, its values are Any: three of four fields are no tuple
scene, camera, trajectory = setup.scene, setup.camera, setup.trajectory
assert_type(scene, Scene)
assert_type(camera, Camera)
assert_type(trajectory, Trajectory)
frame = render(scene, camera, trajectory.at(0.0))
assert_type(frame, Frame)
assert_type(load_trajectory(Path("poses.tum")), Trajectory)
assert_type(camera_named("sony-dsc-s85"), Camera)
assert_type(apply_sensor(frame, sensor_named("phone"), np.random.default_rng(0)), Frame)

found = find(frame.image)
assert_type(found, Found)
assert_type(found.markers, tuple[Detection, ...])
assert_type(identify(frame.image, polarity="dark"), tuple[Detection, ...])
assert_type(decode_arrays(found.markers, image=frame.image), tuple[MarkerArray, ...])
where = locate(found, camera, load_map("cave"))
assert_type(where, Location | None)
if where is not None:
    assert_type(where.is_certain, bool)
    assert_type(where.position_sigma_m, NDArray[np.float64])
assert_type(load_map("cave"), MarkerMap)
assert_type(surf.detect(frame.image), Keypoints)
assert_type(marker.surf_marker(147), NDArray[np.uint8])
assert_type(find_detector("surf")(frame.image), Keypoints)
assert_type(refine(np.asarray(frame.image), [(10.0, 20.0)], [30.0]), Refined)
