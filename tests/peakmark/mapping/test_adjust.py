"""Maps from photographs: twenty arrays in a room within a millimetre, honest σ, and faults left out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera
from peaksim.geometry.pose import Pose, compose, invert, look_at, transform
from peaksim.scene.build_quads import quad_pose

from peakmark.arrays.decode import MarkerArray
from peakmark.errors import InputError
from peakmark.found.found import Found
from peakmark.identification.detection import Detection
from peakmark.localise.pose import expected_shapes
from peakmark.localise.residuals import refined_sigmas
from peakmark.mapping.adjust import BuiltMap, build_map
from peakmark.mapping.sightings import cell_points_m, sightings_of
from peakmark.markers.array_code import Layout, polarities_of

LAYOUT = Layout(3, 3, parity=True)
SIDE_M = 0.05
CAMERA = Camera(1280, 960, 900.0, distortion=(-0.1, 0.02, 0.0, 0.0))


def room() -> dict[int, Pose]:
    """Return world_from_array of twenty arrays on three walls and the ceiling of a room of 4×4×2.6 m."""
    rng = np.random.default_rng(0)
    walls = [((0, 2, 1.3), (0, -1, 0)), ((2, 0, 1.3), (-1, 0, 0)), ((-2, 0, 1.3), (1, 0, 0)), ((0, 0, 2.6), (0, 0, -1))]
    poses = {}
    for code in range(20):
        center, normal = walls[code % 4]
        along = np.array(center) + np.where(np.array(normal) != 0, 0, rng.uniform(-1.0, 1.0, 3))
        poses[code] = quad_pose(normal, (0, 1, 0.1) if code % 4 == 3 else (0, 0, 1), along, "array")
    return poses


def photograph(poses: dict[int, Pose], world_from_camera: Pose, rng: np.random.Generator | None) -> Found:
    """Return the arrays that are whole in an image, with the errors of refined markers."""
    arrays = []
    for code, pose in poses.items():
        centers = transform(pose, cell_points_m(LAYOUT, SIDE_M))
        tangents = np.broadcast_to(SIDE_M * pose[:3, :2] * [1, -1], (len(centers), 3, 2))
        xy, shapes = expected_shapes(CAMERA, world_from_camera, centers, tangents)
        sizes = np.linalg.det(np.nan_to_num(shapes))
        if (sizes > 12**2).all():
            arrays.append(_array(code, xy, shapes, rng))
    return Found(tuple(d for each in arrays for d in each.detections), tuple(arrays), (CAMERA.width, CAMERA.height))


def _array(
    code: int, xy: NDArray[np.float64], shapes: NDArray[np.float64], rng: np.random.Generator | None
) -> MarkerArray:
    if rng is not None:
        center_sigma, shape_sigma = refined_sigmas(shapes)
        xy = xy + center_sigma[:, None] * rng.standard_normal(xy.shape)
        shapes = shapes + shape_sigma[:, None, None] * rng.standard_normal(shapes.shape) / 2
    found = [
        Detection(k, xy[k], float(np.sqrt(np.linalg.det(shapes[k]))), polarity, 1.0, np.nan, 1, shapes[k], 0.99)
        for k, polarity in enumerate(polarities_of(code, LAYOUT))
    ]
    return MarkerArray(code, "", tuple(found), LAYOUT)


def walk(count: int, seed: int = 1) -> list[Pose]:
    """Return cameras in the room that look around at the walls and up to the ceiling."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        yaw, pitch = rng.uniform(0, np.pi), rng.uniform(0.0, 0.9)
        eye = rng.uniform([-0.9, -1.6, 1.0], [0.9, -0.4, 1.7])
        ahead = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
        poses.append(look_at(eye, eye + ahead))
    return poses


def built_from(poses: dict[int, Pose], cameras: list[Pose], seed: int | None) -> BuiltMap:
    rng = None if seed is None else np.random.default_rng(seed)
    seen, twice = sightings_of([photograph(poses, camera, rng) for camera in cameras], CAMERA, LAYOUT, SIDE_M)
    assert twice == []
    return build_map(seen, CAMERA, LAYOUT, SIDE_M)


@cache
def built_with_noise(seed: int) -> BuiltMap:
    """Return the map of the room by thirty photographs."""
    return built_from(room(), walk(30, seed), seed)


def errors_m(built: BuiltMap, poses: dict[int, Pose]) -> NDArray[np.float64]:
    """Return (m, 3) errors of the markers after the best rigid alignment."""
    true = np.concatenate([transform(poses[a.code], cell_points_m(LAYOUT, SIDE_M)) for a in built.marker_map.arrays])
    found = built.marker_map.centers_m
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    return np.asarray(a @ rotation - b)


def test_exact_sightings_give_the_exact_map() -> None:
    poses = room()
    built = built_from(poses, walk(30), None)
    assert len(built.marker_map.arrays) == 20
    assert np.abs(errors_m(built, poses)).max() < 1e-6
    assert built.rms_px < 1e-4
    assert (built.left_out, built.unconnected) == ((), ())


def test_twenty_arrays_from_thirty_photographs_within_a_millimetre() -> None:
    built = built_with_noise(1)
    assert len(built.marker_map.arrays) == 20
    rms_mm = 1000 * float(np.sqrt((errors_m(built, room()) ** 2).sum(axis=1).mean()))
    assert rms_mm < 1.0


def test_the_stated_sigma_is_that_of_the_errors() -> None:
    """In the frame of the origin, whose pose is exact by definition."""
    poses, ratios = room(), []
    for seed in range(2):
        built = built_with_noise(seed)
        assert built.marker_map.sigma_m is not None
        for array in built.marker_map.arrays:
            if array.code != built.origin:
                true = transform(invert(poses[built.origin]) @ poses[array.code], cell_points_m(LAYOUT, SIDE_M))
                off = built.marker_map.centers_m[list(array.rows)] - true
                ratios.append((off**2).sum() / (built.marker_map.sigma_m[list(array.rows)] ** 2).sum())
    assert 0.5 < np.mean(ratios) < 2.0  # each array's errors are of one draw of six


def test_a_wrong_code_is_left_out() -> None:
    poses, rng = room(), np.random.default_rng(3)
    seen, _ = sightings_of([photograph(poses, camera, rng) for camera in walk(30)], CAMERA, LAYOUT, SIDE_M)
    victim = next(k for k, s in enumerate(seen) if s.code == 4)
    hidden = {s.code for s in seen if s.image == seen[victim].image}
    wrong = next(code for code in range(20) if code not in hidden)
    seen[victim] = replace(seen[victim], code=wrong)
    built = build_map(seen, CAMERA, LAYOUT, SIDE_M)
    assert [(s.image, s.code) for s in built.left_out] == [(seen[victim].image, wrong)]
    assert 1000 * np.sqrt((errors_m(built, poses) ** 2).sum(axis=1).mean()) < 1.0


def test_an_array_alone_is_named_and_one_that_hangs_twice_is_left_out() -> None:
    poses = room()
    far = {**poses, 20: compose(np.eye(3), [50.0, 0.0, 0.0])}
    alone = photograph({20: far[20]}, look_at([50.0, 0.0, 0.8], [50.0, 0.0, 0.0], [0, 1, 0]), None)
    shown = [photograph(poses, camera, None) for camera in walk(30)]
    seen, _ = sightings_of([*shown, alone], CAMERA, LAYOUT, SIDE_M)
    assert build_map(seen, CAMERA, LAYOUT, SIDE_M).unconnected == (20,)
    doubled = replace(shown[0], arrays=(*shown[0].arrays, shown[0].arrays[0]))
    seen, twice = sightings_of([doubled, *shown[1:]], CAMERA, LAYOUT, SIDE_M)
    assert twice == [shown[0].arrays[0].code]
    assert twice[0] not in {s.code for s in seen}


def test_photographs_that_connect_nothing_say_so() -> None:
    with pytest.raises(InputError, match="found none that was read"):
        build_map([], CAMERA, LAYOUT, SIDE_M)
    lone = photograph({1: np.eye(4)}, look_at([0.0, 0.0, 0.8], [0.0, 0.0, 0.0], [0, 1, 0]), None)
    seen, _ = sightings_of([lone], CAMERA, LAYOUT, SIDE_M)
    with pytest.raises(InputError, match="expected photographs that show two or more arrays at once"):
        build_map(seen, CAMERA, LAYOUT, SIDE_M)
