"""Rerun recordings (.rrd): cameras and markers in the world, images and what was found in the camera."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.extras import needs_extra
from peaksim.geometry.pose import Pose

from peakmark.maps.marker_map import MarkerMap
from peakmark.recording.moment import Moment

_FOUND = (26, 230, 51)


@needs_extra
def write_rerun(path: Path, marker_map: MarkerMap | None) -> Any:
    """Give a function that appends moments to a Rerun file, as a context."""
    import rerun

    return _written(rerun, path, marker_map)


@contextmanager
def _written(rr: Any, path: Path, marker_map: MarkerMap | None) -> Iterator[Callable[[Moment], None]]:
    recording = rr.RecordingStream("peakmark")
    recording.save(path)
    trails: dict[str, list[NDArray[np.float64]]] = {"estimate": [], "truth": []}
    if marker_map is not None:
        recording.log("world/markers", _boxes(rr, marker_map), static=True)

    def append(moment: Moment) -> None:
        recording.set_time("time", duration=moment.time_s)
        for name, pose in (("estimate", moment.estimate), ("truth", moment.truth)):
            if pose is not None:
                trails[name].append(pose[:3, 3])
                recording.log(f"world/{name}", rr.Points3D([pose[:3, 3]], radii=0.01))
        log_camera(rr, recording, moment.camera, moment.estimate if moment.estimate is not None else moment.truth)
        recording.log("world/camera/picture", rr.Image(moment.image))
        strips = [corners[[0, 1, 2, 3, 0]] + 0.5 for _, corners in moment.outlines]
        names = [name for name, _ in moment.outlines]
        recording.log("world/camera/picture/found", rr.LineStrips2D(strips, labels=names, colors=_FOUND))

    try:
        yield append
        for name, places in trails.items():
            if places:
                recording.log(f"world/{name}/path", rr.LineStrips3D([np.array(places)]), static=True)
    finally:
        recording.flush()
        recording.disconnect()


def log_camera(rr: Any, recording: Any, camera: Camera | None, world_from_camera: Pose | None) -> None:
    """Log where a camera is, and how it sees without its lens's distortion; what is not known is left out."""
    if world_from_camera is not None:
        step = rr.Transform3D(translation=world_from_camera[:3, 3], mat3x3=world_from_camera[:3, :3])
        recording.log("world/camera", step)
    if camera is not None:
        matrix = camera.matrix + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])  # Rerun's pixels begin at 0
        pinhole = rr.Pinhole(image_from_camera=matrix, width=camera.width, height=camera.height)
        recording.log("world/camera/picture", pinhole)


def _boxes(rr: Any, marker_map: MarkerMap) -> Any:
    right, down = marker_map.axes[:, :, 0], marker_map.axes[:, :, 1]
    frames = np.stack([right, -down, np.cross(right, -down)], axis=2)
    halves = marker_map.sides_m[:, None] / 2 * [1, 1, 0.01]
    codes = {array.rows[0]: str(array.code) for array in marker_map.arrays}
    labels = [codes.get(row, "") for row in range(len(marker_map))]
    colours = [(40, 40, 40) if polarity == "dark" else (230, 230, 230) for polarity in marker_map.polarities]
    quaternions = [_quaternion(frame) for frame in frames]
    return rr.Boxes3D(
        centers=marker_map.centers_m, half_sizes=halves, quaternions=quaternions, labels=labels, colors=colours
    )


def _quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(scipy.spatial.transform.Rotation.from_matrix(rotation).as_quat(canonical=True))
