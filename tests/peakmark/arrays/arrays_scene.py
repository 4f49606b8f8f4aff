"""Arrays projected exactly into cameras, as perfect or disturbed detections."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.models import camera_named
from peaksim.geometry.pose import Pose, compose, invert, rotation_about, transform

from peakmark.identification.detection import Detection
from peakmark.markers.array_code import THREE_BIT, Layout, polarities_of
from peakmark.markers.patterns import Polarity

CAMERA = camera_named("sony-dsc-s85")
SIDE_M = 0.05


@dataclass(frozen=True)
class Printed:
    """A marker on the wall: the plane z = 0, x right, y up."""

    xy_m: tuple[float, float]
    polarity: Polarity
    side_m: float = SIDE_M


def printed_array(
    code: int, center_m: tuple[float, float] = (0.0, 0.0), layout: Layout = THREE_BIT, rotation_deg: float = 0.0
) -> list[Printed]:
    """Return the markers of an array on the wall in reading order."""
    middle = (np.array([layout.columns, layout.rows]) - 1) / 2
    rotation = rotation_about("z", rotation_deg)[:2, :2]
    offsets = (np.array(layout.cells) - middle) * [1, -1] * SIDE_M * layout.pitch @ rotation.T + center_m
    return [Printed((float(x), float(y)), p) for (x, y), p in zip(offsets, polarities_of(code, layout), strict=True)]


def facing_wall(distance_m: float, tilt_deg: float, direction_deg: float, roll_deg: float) -> Pose:
    """Return a camera that looks at the wall's origin; its axis is tilted from the normal towards a direction."""
    flip = np.diag([1.0, -1.0, -1.0])
    rotation = rotation_about("z", direction_deg) @ rotation_about("x", tilt_deg) @ rotation_about("z", roll_deg) @ flip
    return compose(rotation, -distance_m * rotation[:, 2])


def detections(
    printed: Sequence[Printed],
    world_from_camera: Pose,
    rng: np.random.Generator | None = None,
    center_noise: float = 0.0,
    size_noise: float = 0.0,
    camera: Camera = CAMERA,
) -> tuple[list[Detection], NDArray[np.float64]]:
    """Return detections and their affinities; noise is relative to the side, centres in x and y, sizes as a factor."""
    offsets = np.array([[0, 0], [0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5]]) * [1, -1]
    found, shapes = [], []
    for number, p in enumerate(printed):
        points = np.pad(np.array(p.xy_m) + offsets * p.side_m, ((0, 0), (0, 1)))
        px = camera.project(transform(invert(world_from_camera), points))
        shape = np.stack([px[1] - px[2], px[3] - px[4]], axis=1)
        size, xy = float(np.sqrt(abs(np.linalg.det(shape)))), px[0]
        if rng is not None:
            xy = xy + center_noise * size * rng.standard_normal(2)
            size *= float(np.exp(size_noise * rng.standard_normal()))
        found.append(Detection(number, xy, size, p.polarity, 1e4 - number, 0.1, number + 1))
        shapes.append(shape)
    return found, np.array(shapes).reshape(-1, 2, 2)
