"""Markers on a floor as an ideal camera sees them: exact projections, with noise on request, without rendering."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, look_at, rotation_about, transform

from peakmark.localise.locate import FloorMap

SIDE_M = 0.08
SPACING_M = 0.28
CAMERA = Camera(1024, 768, 700.0, 700.0, 511.5, 383.5)


@dataclass(frozen=True)
class Seen:
    """The markers of a map that are in view."""

    names: NDArray[np.intp]
    """(n,) indices into the map."""
    xy: NDArray[np.float64]
    affinity: NDArray[np.float64]

    @property
    def side_px(self) -> NDArray[np.float64]:
        return np.sqrt(np.abs(np.linalg.det(self.affinity)))

    def rows(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Seen":
        return Seen(self.names[chosen], self.xy[chosen], self.affinity[chosen])


def winding_map(rng: np.random.Generator, count: int = 40, bend: float = 0.1) -> FloorMap:
    """Return markers at even steps along a path that bends by about `bend` radians a step."""
    heading = np.cumsum(rng.normal(0, bend, count))
    xy = np.cumsum(SPACING_M * np.stack([np.sin(heading), np.cos(heading)], axis=1), axis=0)
    return FloorMap(np.column_stack([xy, np.zeros(count)]), SIDE_M)


def pose_at(
    floor_map: FloorMap,
    index: int,
    height_m: float = 0.9,
    pitch_deg: float = 35.0,
    roll_deg: float = 0.0,
    aside_m: float = 0.0,
) -> Pose:
    """Return the pose of a camera half a metre before a marker, looking along the path and down."""
    centers = floor_map.centers_m
    ahead = centers[index + 1] - centers[index]
    ahead = ahead / np.linalg.norm(ahead)
    eye = centers[index] - 0.5 * ahead + aside_m * np.array([-ahead[1], ahead[0], 0]) + [0, 0, height_m]
    down = np.radians(pitch_deg)
    target = eye + np.cos(down) * ahead - [0, 0, np.sin(down)]
    return look_at(eye, target) @ compose(rotation_about("z", roll_deg), [0, 0, 0])


def view(
    camera: Camera,
    pose: Pose,
    floor_map: FloorMap,
    rng: np.random.Generator,
    noise_px: float = 0.0,
    smallest_px: float = 14.0,
) -> Seen:
    """Return the markers inside the image, each rotated at random, by central differences of the projection."""
    centers, step = floor_map.centers_m, 1e-4
    ends = [transform(invert(pose), centers + step * np.eye(3)[axis] * sign) for axis in (0, 1) for sign in (1, -1)]
    image = [camera.project(end) for end in ends]
    shapes = floor_map.side_m * np.stack([image[0] - image[1], image[2] - image[3]], axis=2) / (2 * step)
    xy = camera.project(transform(invert(pose), centers))
    sides = np.sqrt(np.abs(np.linalg.det(np.nan_to_num(shapes))))
    inside = ((xy > 1.5 * sides[:, None]) & (xy < np.array([camera.width, camera.height]) - 1.5 * sides[:, None])).all(
        axis=1
    )
    names = np.flatnonzero(inside & (sides > smallest_px))
    rotations = np.stack([rotation_about("z", t)[:2, :2] for t in rng.uniform(0, 360, len(centers))])[names]
    return Seen(
        names,
        xy[names] + noise_px * rng.standard_normal((len(names), 2)),
        shapes[names] @ rotations + noise_px * rng.standard_normal((len(names), 2, 2)),
    )


def apart(a: Pose, b: Pose) -> tuple[float, float]:
    """Return the distance in metres and the angle in degrees between two poses."""
    relative = invert(a) @ b
    angle = np.linalg.norm(
        [relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]]
    )
    return float(np.linalg.norm(relative[:3, 3])), float(np.degrees(np.arctan2(angle, np.trace(relative[:3, :3]) - 1)))
