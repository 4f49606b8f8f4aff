"""A map from thirty rendered photographs of a room with twenty arrays: search, decoding and adjustment together."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Quad, Scene, Texture, render
from peaksim.camera.sensor import Sensor, apply_sensor
from peaksim.geometry.pose import Pose, compose, look_at

from peakmark.found.found import find
from peakmark.mapping.adjust import build_map
from peakmark.mapping.sightings import sightings_of
from peakmark.markers.board import board_tile
from peakmark.markers.sheet import pages
from peakmark.markers.sheet_files import raster
from tests.peakmark.mapping.test_adjust import CAMERA, LAYOUT, SIDE_M, errors_m, room

_PAPER_MM = (260.0, 260.0)
SENSOR = Sensor(lens_blur_px=0.6, vignetting=0.2, full_well_e=10000, read_noise=1.5, exposure=0.8)


@cache
def printed(code: int) -> tuple[Texture, NDArray[np.float64]]:
    """Return an array's sheet, and where its middle lies from the sheet's, m, x right and y up."""
    (page,) = pages([board_tile(code, 1000 * SIDE_M)], _PAPER_MM, 0.0, "")
    xy = np.array([(placed.x_mm, placed.y_mm) for placed in page.markers])
    middle = (xy.min(axis=0) + xy.max(axis=0)) / 2
    levels = raster(page, 127.0)
    offset = (middle - np.array(_PAPER_MM) / 2) * [1, -1] / 1000
    return Texture.from_array(np.rint(25 + levels / 255.0 * 190).astype(np.uint8)), np.array([*offset, 0.0])


def hung() -> dict[int, Pose]:
    """Return world_from_array of twenty arrays on the walls of `room`, five each, that do not cover one another."""
    poses, rng = {}, np.random.default_rng(0)
    for code, pose in room().items():
        normal = np.round(pose[:3, 2])
        first, second = np.flatnonzero(normal == 0)
        place = np.where(normal != 0, pose[:3, 3], [0.0, 0.0, 1.3])
        place[first] += 0.34 * (code // 4 - 2) + rng.uniform(-0.05, 0.05)
        place[second] += (0.3 if code // 4 % 2 else -0.3) + rng.uniform(-0.1, 0.1)
        poses[code] = compose(pose[:3, :3], place)
    return poses


def cameras(count: int) -> list[Pose]:
    """Return cameras that look around at three walls and up to the ceiling from the middle of the room."""
    rng, poses = np.random.default_rng(4), []  # a walk that shows every array twice or more
    for _ in range(count):
        yaw, pitch = rng.uniform(-0.4, np.pi + 0.4), rng.uniform(-0.1, 0.9)
        eye = rng.uniform([-0.7, -1.2, 1.0], [0.7, -0.2, 1.6])
        ahead = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
        poses.append(look_at(eye, eye + ahead))
    return poses


@pytest.mark.slow
def test_twenty_arrays_from_thirty_rendered_photographs_within_a_millimetre() -> None:
    poses, size = hung(), (_PAPER_MM[0] / 1000, _PAPER_MM[1] / 1000)
    quads = []
    for code, pose in poses.items():
        texture, offset = printed(code)
        place = pose @ compose(np.eye(3), -offset)
        quads.append(Quad(name=f"{code}", texture=texture, size_m=size, world_from_quad=place, marker=None))
    scene, rng = Scene(quads=tuple(quads)), np.random.default_rng(0)
    photographs = []
    for camera in cameras(30):
        frame = apply_sensor(render(scene, CAMERA, camera, renderer="exact"), SENSOR, rng)
        photographs.append(find(frame.image, layout=LAYOUT))
    seen, twice = sightings_of(photographs, CAMERA, LAYOUT, SIDE_M)
    assert twice == []
    built = build_map(seen, CAMERA, LAYOUT, SIDE_M)
    rms_mm = 1000 * float(np.sqrt((errors_m(built, poses) ** 2).sum(axis=1).mean()))
    print(f"{len(built.marker_map.arrays)} arrays, {len(seen)} sightings, {rms_mm:.3f} mm rms")
    assert len(built.marker_map.arrays) == 20
    assert rms_mm < 1.0
