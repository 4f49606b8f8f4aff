"""Simulated cameras, and the poses from which each photographs a board; nothing of them is told to the calibration."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.sensor import Sensor
from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, compose, invert

from peakmark.experiments.option import check_range

SIZE = (1280, 960)
"""Of every image, px."""

_CELLS = (5, 3)
"""Columns and rows of the image in which the middle of the board is seen by turns."""


@dataclass(frozen=True)
class StudyConfig:
    """How many cameras, and how many photographs each takes."""

    cameras: int = 30
    """Simulated cameras."""
    fisheyes: int = 5
    """So many of them are fisheyes, evenly among the others."""
    views: int = 20
    """Photographs of each board."""
    seed: int = 0
    """Of lenses, poses and noise."""

    def __post_init__(self) -> None:
        check_range("cameras", self.cameras, 1, 1000)
        check_range("fisheyes", self.fisheyes, 0, self.cameras)
        check_range("views", self.views, 3, 200)
        check_range("seed", self.seed, 0)


@dataclass(frozen=True)
class SimulatedCamera:
    """A camera, and what it does to light."""

    camera: Camera
    sensor: Sensor
    lens: str
    """Model that is fitted."""
    poses: tuple[Pose, ...]
    """(4, 4) world_from_camera of its photographs; the board lies in z = 0, its middle at the origin."""


def simulated_camera(config: StudyConfig, number: int) -> SimulatedCamera:
    """Return one of the cameras: lens, sensor and poses are random, and depend on the seed and the number alone."""
    rng = np.random.default_rng((config.seed, number))
    is_fisheye = (number + 1) * config.fisheyes // config.cameras > number * config.fisheyes // config.cameras
    camera = _camera(rng, is_fisheye)
    sensor = Sensor(
        lens_blur_px=float(rng.uniform(0.4, 1.0)),
        vignetting=float(rng.uniform(0.0, 0.3)),
        exposure=float(rng.uniform(0.6, 0.9)),
        full_well_e=float(rng.uniform(4000, 20000)),
        read_noise=float(rng.uniform(0.5, 2.5)),
    )
    poses = tuple(_pose(camera, rng, cell, view % 2 == 0) for view, cell in enumerate(_cells(config.views, rng)))
    return SimulatedCamera(camera, sensor, "fisheye" if is_fisheye else "brown5", poses)


def _camera(rng: np.random.Generator, is_fisheye: bool) -> Camera:
    """Return a camera whose lens does not fold its image."""
    while True:
        with suppress(SceneError):
            return _fisheye(rng) if is_fisheye else _pinhole(rng)


def _pinhole(rng: np.random.Generator) -> Camera:
    fx = float(rng.uniform(850, 1400))
    k1 = float(rng.uniform(-0.25, 0.1))
    terms = (k1, float(rng.uniform(-0.2, 0.3)) * k1, *map(float, rng.normal(0, 5e-4, 2)), 0.02 * k1)
    return Camera(*SIZE, fx, fx * float(rng.uniform(0.998, 1.002)), *_center(rng), terms)


def _fisheye(rng: np.random.Generator) -> Camera:
    fx = float(rng.uniform(520, 640))
    terms = tuple(map(float, rng.uniform((0.0, -0.015, -0.001, -0.0005), (0.03, -0.005, 0.002, 0.0))))
    return Camera(*SIZE, fx, fx * float(rng.uniform(0.998, 1.002)), *_center(rng), terms, "fisheye")


def _center(rng: np.random.Generator) -> tuple[float, float]:
    x, y = (np.array(SIZE) - 1) / 2 + rng.uniform(-20, 20, 2)
    return float(x), float(y)


def _cells(count: int, rng: np.random.Generator) -> list[NDArray[np.float64]]:
    """Return where in the image the middle of the board is seen, shares of width and height, cell by cell."""
    columns, rows = _CELLS
    grid = np.array([(column, row) for row in range(rows) for column in range(columns)])
    chosen = np.concatenate([rng.permutation(grid) for _ in range(-(-count // len(grid)))])[:count]
    return [(cell + rng.uniform(0.2, 0.8, 2)) / _CELLS for cell in chosen]


def _pose(camera: Camera, rng: np.random.Generator, share: NDArray[np.float64], is_whole: bool) -> Pose:
    """Return a camera that sees the board's middle there, tilted to its line of sight by 10 to 45°.

    The board is whole in the image, or near, large and cut by the image's border.
    """
    middle = 0.5 + (0.3 if is_whole else 0.85) * (share - 0.5)
    sight = camera.unproject([middle * SIZE - 0.5])[0]
    sight /= np.linalg.norm(sight)
    nearest, farthest = (0.5, 0.6) if is_whole else (0.28, 0.45)
    reach_m = float(rng.uniform(nearest, farthest)) * (camera.fx / 1000 if camera.model == "brown" else 0.7)
    facing = _facing(-sight, rng.uniform(0, 2 * np.pi))
    angles_deg = rng.uniform((0, 10, 0), (360, 45, 0))
    tilt = scipy.spatial.transform.Rotation.from_euler("zxz", angles_deg, degrees=True)
    return invert(compose(facing @ tilt.as_matrix(), reach_m * sight))


def _facing(normal: NDArray[np.float64], roll: float) -> NDArray[np.float64]:
    """Return (3, 3) camera_from_board with z along a normal."""
    right = np.cross([np.cos(roll), np.sin(roll), 0.1], normal)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(normal, right), normal])
