"""A COLMAP text model (colmap.github.io/format.html): cameras, images, and the markers' points as its 3-D points.

COLMAP's pixel centres are at +½, its poses camera from world. Points belong to a sequence: the same marker is
five other points in the next one, whose scene may have moved it.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import scipy

from peaksim.camera.calibration_file import colmap_line, joined
from peaksim.corpus.layout import image_name
from peaksim.corpus.sample import SEEN, Record
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.store.base import Writing
from peaksim.geometry.pose import invert


@dataclass
class _TrackedPoint:
    number: int
    xyz: list[float]
    track: list[tuple[int, int]] = field(default_factory=list)


Points = dict[tuple[str, int], _TrackedPoint]


@contextmanager
def colmap_writer(
    cameras: Writing, images: Writing, points: Writing, spec: CorpusSpec
) -> Iterator[Callable[[Record], None]]:
    """Yield a function that adds a frame to the files cameras.txt, images.txt and points3D.txt.

    Frames of one sequence follow one another.
    """
    camera_numbers: dict[str, int] = {}
    current: Points = {}
    sequence, next_point = -1, 1

    def flush() -> None:
        points.write("".join(_point_line(point) for point in current.values()).encode())

    def add(record: Record) -> None:
        nonlocal sequence, current, next_point
        if record["sequence"] != sequence:
            flush()
            sequence, next_point, current = record["sequence"], next_point + len(current), {}
        name = record["camera"]["name"]
        if name not in camera_numbers:
            camera_numbers[name] = len(camera_numbers) + 1
            cameras.write(f"{camera_numbers[name]} {colmap_line(record['camera'])}\n".encode())
        images.write(_image_lines(spec, record, camera_numbers[name], current, next_point).encode())

    yield add
    flush()


def _image_lines(spec: CorpusSpec, record: Record, camera: int, points: Points, first_point: int) -> str:
    """Return an image's two lines, and add its visible points to their tracks; new points count from `first_point`."""
    number = record["frame"] + 1
    pose = invert(np.array(record["world_from_camera"]))
    x, y, z, w = scipy.spatial.transform.Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    seen: list[str] = []
    for marker in record["markers"]:
        for i, state in enumerate(marker["points_seen"]):
            if state == SEEN:
                fresh = _TrackedPoint(first_point + len(points), marker["points_world_m"][i])
                point = points.setdefault((marker["name"], i), fresh)
                point.track.append((number, len(seen)))
                u, v = marker["points_xy"][i]
                seen.append(f"{u + 0.5!r} {v + 0.5!r} {point.number}")
    name = image_name(spec, record["frame"]).removeprefix("frames/")
    return f"{number} {joined([w, x, y, z, *pose[:3, 3]])} {camera} {name}\n{' '.join(seen)}\n"


def _point_line(point: _TrackedPoint) -> str:
    track = " ".join(f"{image} {index}" for image, index in point.track)
    return f"{point.number} {joined(point.xyz)} 128 128 128 0 {track}\n"
