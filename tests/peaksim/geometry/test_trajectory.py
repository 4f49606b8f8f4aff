"""Trajectories: splines through their waypoints, the times of frames, and refused input."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at, pose_distance, rigid
from peaksim.geometry.trajectory import Trajectory, from_quaternions, quaternions_xyzw
from scipy.spatial.transform import Rotation


def random_trajectory(seed: int, count: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(count, random_state=seed).as_matrix()
    poses = [compose(r, p) for r, p in zip(rotations, rng.normal(size=(count, 3)), strict=True)]
    return Trajectory(np.cumsum(rng.uniform(0.1, 1, count)), np.stack(poses))


@given(st.integers(0, 10_000), st.integers(1, 6))
def test_it_passes_through_its_waypoints_and_is_rigid_between(seed: int, count: int) -> None:
    trajectory = random_trajectory(seed, count)
    for time, pose in zip(trajectory.times_s, trajectory.world_from_camera, strict=True):
        assert np.allclose(trajectory.at(time), pose, atol=1e-9)
    for time in np.linspace(trajectory.times_s[0], trajectory.times_s[-1], 7):
        rigid(trajectory.at(time))


def test_it_stands_still_outside_its_times() -> None:
    trajectory = random_trajectory(1, 4)
    assert np.array_equal(trajectory.at(-5), trajectory.at(trajectory.times_s[0]))
    assert np.array_equal(trajectory.at(1e9), trajectory.at(trajectory.times_s[-1]))


def test_a_line_has_constant_speed_and_turning_rate() -> None:
    ends = look_at([0, 0, 1], [0, 1, 1]), look_at([3, 4, 1], [2, 4, 1])
    poses = Trajectory(np.array([0.0, 2.0]), np.stack(ends)).poses_at(np.linspace(0, 2, 21))
    steps = [pose_distance(a, b) for a, b in itertools.pairwise(poses)]
    assert np.allclose(np.array(steps) / 0.1, [2.5, 45.0], rtol=1e-6)


def test_a_spline_through_36_poses_of_an_orbit_keeps_its_radius_and_looks_at_the_centre() -> None:
    center, angles = np.array([1, 2, 0.5]), np.radians(np.linspace(0, 360, 37))
    eyes = center + np.stack([3 * np.cos(angles), 3 * np.sin(angles), np.ones(37)], axis=1)
    orbit = Trajectory(np.linspace(0, 10, 37), np.stack([look_at(eye, center) for eye in eyes]))
    for pose in orbit.poses_at(np.linspace(0, 10, 101)):
        to_center = center - pose[:3, 3]
        assert np.hypot(*to_center[:2]) == pytest.approx(3.0, rel=4e-5)
        assert np.allclose(pose[:3, 2], to_center / np.linalg.norm(to_center), atol=1e-4)


def test_frame_times_include_both_ends() -> None:
    trajectory = Trajectory(np.array([0, 0.3]), np.stack([np.eye(4), compose(np.eye(3), [1, 0, 0])]))
    assert np.allclose(trajectory.frame_times_s(10), [0, 0.1, 0.2, 0.3])
    with pytest.raises(SceneError, match="positive frame rate"):
        trajectory.frame_times_s(0)


@pytest.mark.parametrize("times", [[0, 0], [1, 0.5], [0, np.nan], [0, 1, 1], [0, 2, 1], [0, np.nan, 1]])
def test_repeated_unsorted_and_nan_times_are_refused(times: list[float]) -> None:
    with pytest.raises(SceneError, match="times_s: expected strictly increasing times"):
        Trajectory(np.array(times), np.stack([np.eye(4)] * len(times)))


def test_wrong_shapes_and_poses_are_refused() -> None:
    with pytest.raises(SceneError, match=r"\(n, 4, 4\)"):
        Trajectory(np.array([0.0, 1.0]), np.eye(4)[None])
    with pytest.raises(SceneError, match="pose 1: expected a rigid transform"):
        Trajectory(np.array([0.0, 1.0]), np.stack([np.eye(4), np.diag([2.0, 1, 1, 1])]))


def test_quaternions_round_trip_and_must_have_unit_length() -> None:
    trajectory = random_trajectory(3, 5)
    again = from_quaternions(trajectory.times_s, trajectory.world_from_camera[:, :3, 3], quaternions_xyzw(trajectory))
    assert np.allclose(again.world_from_camera, trajectory.world_from_camera, atol=1e-12)
    with pytest.raises(SceneError, match="pose 0: expected a unit quaternion, got one of length 2"):
        from_quaternions([0], [[0, 0, 0]], [[0, 0, 0, 2]])
    with pytest.raises(SceneError, match=r"pose 1: expected a unit quaternion, got one of length 1\.1"):
        from_quaternions([0, 1], np.zeros((2, 3)), [[0, 0, 0, 1], [0, 0, 0, 1.1]])
