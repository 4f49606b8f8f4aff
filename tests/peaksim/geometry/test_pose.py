"""Poses: group axioms, known rotations, and the distance of two poses as a metric."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim import Camera, Trajectory
from peaksim.camera.shutter import still_camera
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import (
    Pose,
    compose,
    interpolate,
    invert,
    look_at,
    pose_distance,
    rigid,
    rotation_about,
    transform,
)
from scipy.spatial.transform import Rotation

SEEDS = st.integers(0, 10_000)


def random_pose(seed: int) -> Pose:
    return compose(Rotation.random(random_state=seed).as_matrix(), np.random.default_rng(seed).normal(size=3))


@given(SEEDS, SEEDS, SEEDS)
def test_poses_are_a_group(i: int, j: int, k: int) -> None:
    a, b, c = random_pose(i), random_pose(j), random_pose(k)
    assert np.allclose((a @ b) @ c, a @ (b @ c))
    assert np.allclose(a @ invert(a), np.eye(4))
    assert np.allclose(invert(a @ b), invert(b) @ invert(a))
    points = np.random.default_rng(i).normal(size=(5, 3))
    assert np.allclose(transform(a @ b, points), transform(a, transform(b, points)))
    rigid(a @ b)


@given(SEEDS, SEEDS, SEEDS)
def test_the_distance_of_poses_is_a_metric_that_no_change_of_world_alters(i: int, j: int, k: int) -> None:
    a, b, c = random_pose(i), random_pose(j), random_pose(k)
    assert pose_distance(a, a) == pytest.approx((0, 0), abs=1e-6)
    assert pose_distance(a, b) == pytest.approx(pose_distance(b, a))
    assert pose_distance(c @ a, c @ b) == pytest.approx(pose_distance(a, b))
    direct, detour = np.array(pose_distance(a, c)), np.add(pose_distance(a, b), pose_distance(b, c))
    assert (direct <= detour + 1e-9).all()


MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    "use",
    [
        rigid,
        invert,
        lambda pose: pose_distance(pose, np.eye(4)),
        lambda pose: pose_distance(np.eye(4), pose),
        lambda pose: interpolate(pose, np.eye(4), 0.5),
        lambda pose: interpolate(np.eye(4), pose, 0.5),
        lambda pose: still_camera(Camera(), pose),
        lambda pose: Trajectory([0.0], [pose]),
    ],
)
def test_a_mirrored_pose_is_refused_as_one(use: Callable[[Pose], object]) -> None:
    with pytest.raises(SceneError, match=r"expected a rigid transform .* got a mirrored one \(determinant −1\)"):
        use(MIRRORED)


@pytest.mark.parametrize("axis", ["w", "xy", "", 0])
def test_an_axis_that_is_none_is_refused(axis: object) -> None:
    with pytest.raises(InputError, match="axis: expected one of x, y, z, got"):
        rotation_about(axis, 10.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("angle_deg", [0.0, 1e-6, 0.01, 30.0, 90.0, 179.999, 180.0])
def test_the_distance_tells_known_rotations_and_shifts(axis: str, angle_deg: float) -> None:
    start = random_pose(5)
    moved = start @ compose(rotation_about(axis, angle_deg), [0.3, -0.4, 1.2])
    assert pose_distance(start, moved) == pytest.approx((1.3, angle_deg), abs=1e-9)


def test_rotations_are_right_handed() -> None:
    for axis, source, target in (("x", [0, 1, 0], [0, 0, 1]), ("y", [0, 0, 1], [1, 0, 0]), ("z", [1, 0, 0], [0, 1, 0])):
        assert np.allclose(rotation_about(axis, 90) @ source, target)


@given(SEEDS, SEEDS, st.floats(0, 1))
def test_interpolation_divides_distance_and_angle_in_proportion(i: int, j: int, fraction: float) -> None:
    start, end = random_pose(i), random_pose(j)
    between = interpolate(start, end, fraction)
    rigid(between)
    whole = np.array(pose_distance(start, end))
    assert np.allclose(pose_distance(start, between), fraction * whole, atol=1e-6)
    assert np.allclose(pose_distance(between, end), (1 - fraction) * whole, atol=1e-6)


def test_a_camera_cannot_look_at_its_own_position_or_along_up() -> None:
    with pytest.raises(SceneError, match="expected a target away from the eye"):
        look_at([1, 2, 3], [1, 2, 3])
    with pytest.raises(SceneError, match="not parallel to up"):
        look_at([0, 0, 1], [0, 0, 5])
