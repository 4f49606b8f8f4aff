"""Poses of one image from one array, from all of them, from loose markers, and from everything; and their truth."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.pose import Pose, invert

from peakmark.experiments.comparison.boards import CAMERA, Print
from peakmark.experiments.comparison.frames import SWEEPS, Shot, View, clean_shot, traced_shot, warped_shot
from peakmark.experiments.comparison.measure import map_of
from peakmark.experiments.comparison.readers import READERS
from peakmark.experiments.option import check_range
from peakmark.found.found import Found, find
from peakmark.maps.locate import Location, locate
from peakmark.maps.marker_map import MappedArray, MarkerMap

SETS = ("clean", "warped", "traced")
"""Rendered exactly under one disturbance; warped into photographs by OpenCV; path-traced under lamps."""

SOURCES = ("one array", "several arrays", "loose markers", "all markers")
"""What a pose is computed from: each array by itself; all arrays; markers without a code; all of these."""

_READER = {reader.name: reader for reader in READERS}
_SIDES_PX = (24.0, 110.0)
_HARDEST = {"side_px": 20.0, "tilt_deg": 70.0, "noise": 20.0, "blur_px": 2.0, "shadow": 0.5, "exposure": 0.25}
"""Values of the sweeps beyond which arrays are no more read."""

_SAMPLES = 32


@dataclass(frozen=True)
class PoseStudyConfig:
    """How many images."""

    clean: int = 60
    warped: int = 60
    traced: int = 20
    seed: int = 0
    """Of boards, walls, cameras, light and noise."""

    def __post_init__(self) -> None:
        for name in SETS:
            check_range(name, getattr(self, name), 0, 100_000)
        check_range("seed", self.seed, 0)

    @property
    def frames(self) -> tuple[tuple[str, int], ...]:
        """Set and number of every image."""
        return tuple((name, number) for name in SETS for number in range(getattr(self, name)))


@dataclass(frozen=True)
class PoseError:
    """One pose, or none."""

    source: str
    """See `SOURCES`."""
    is_told: bool
    """Whether there is a pose; without one all else is 0."""
    is_certain: bool = False
    position: float = 0.0
    """Error over the camera's distance from the board's middle."""
    rotation_deg: float = 0.0
    nees: float = 0.0
    """Normalised squared error, six on average if the covariance is honest."""
    other_nees: float | None = None
    """Of the second solution, in the same covariance; None without one."""
    side_px: float = 0.0
    """Mean side of the markers that were used."""


def measured(config: PoseStudyConfig, index: int) -> list[PoseError]:
    """Return the poses of one of the configuration's frames."""
    name, number = config.frames[index]
    shot = shoot(name, np.random.default_rng([config.seed, number, *name.encode()]))
    found = find(shot.gray)
    return [pose_error(source, each, on_map, shot.pose) for source, each, on_map in cases(found, shot.board)]


def shoot(name: str, rng: np.random.Generator) -> Shot:
    """Return one frame of a set."""
    if name == "traced":
        return traced_shot(rng, _SAMPLES)
    if name == "warped":
        return warped_shot(rng)
    quantity = str(rng.choice(list(_HARDEST)))
    view = View(side_px=float(np.exp(rng.uniform(*np.log(_SIDES_PX)))))
    hardest = _HARDEST[quantity]
    values = [v for v in SWEEPS[quantity] if (v >= hardest if quantity in ("side_px", "exposure") else v <= hardest)]
    return clean_shot(replace(view, **{quantity: float(rng.choice(values))}), rng)


def cases(found: Found, board: tuple[Print, ...]) -> Iterator[tuple[str, Found, MarkerMap]]:
    """Yield each source that an image has: its name, what was found of it, and its map."""
    arrays = [one for one in board if one.design == "array"]
    loose = [one for one in board if one.design == "marker"]
    read = [array for array in found.arrays if array.code is not None]
    for array in read:
        own = [one for one in arrays if one.code == array.code]
        if len(own) == 1:
            alone = Found(array.detections, (array,), found.image_size)
            yield "one array", alone, map_of(_READER["decode_arrays"], own)
    if len(read) > 1:
        yield "several arrays", found, map_of(_READER["decode_arrays"], arrays)
    if len(loose) > 3:
        yield "loose markers", Found(found.markers, (), found.image_size), map_of(_READER["identify"], loose)
    if read and loose:
        both = map_of(_READER["decode_arrays"], arrays), map_of(_READER["identify"], loose)
        yield "all markers", found, joined(*both)


def joined(a: MarkerMap, b: MarkerMap) -> MarkerMap:
    """Return the map of two maps in one world."""
    moved = tuple(MappedArray(each.code, tuple(len(a) + row for row in each.rows)) for each in b.arrays)
    centers, axes = np.concatenate([a.centers_m, b.centers_m]), np.concatenate([a.axes, b.axes])
    sides = np.concatenate([a.sides_m, b.sides_m])
    return MarkerMap(centers, axes, sides, (*a.polarities, *b.polarities), (*a.arrays, *moved))


def pose_error(source: str, found: Found, on_map: MarkerMap, truth: Pose | None) -> PoseError:
    """Return how far the pose on a map is from the truth."""
    assert truth is not None
    where = locate(found, CAMERA, on_map)
    if where is None:
        return PoseError(source, False)
    step = step_between(where.world_from_camera, truth)
    return PoseError(
        source,
        True,
        where.is_certain,
        float(np.linalg.norm(step[3:]) / np.linalg.norm(truth[:3, 3])),
        float(np.degrees(np.linalg.norm(step[:3]))),
        float(step @ np.linalg.solve(where.covariance, step)),
        _other_nees(where, truth),
        float(np.mean([found.markers[row].size for row in np.flatnonzero(where.marker_of >= 0)])),
    )


def _other_nees(where: Location, truth: Pose) -> float | None:
    if where.other is None:
        return None
    step = step_between(where.other, truth)
    return float(step @ np.linalg.solve(where.covariance, step))


def step_between(found: Pose, truth: Pose) -> NDArray[np.float64]:
    """Return the (6,) step in the found camera's frame that leads to the truth: rotation vector, rad, and metres."""
    off = invert(found) @ truth
    return np.concatenate([cv2.Rodrigues(off[:3, :3])[0].ravel(), off[:3, 3]])
