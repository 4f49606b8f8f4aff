"""Trajectories: group axioms of the ways, splines through their waypoints, limits, and refused input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at, rigid
from peaksim.geometry.trajectory import Trajectory, from_quaternions, line, orbit, quaternions_xyzw
from scipy.spatial.transform import Rotation


def random_trajectory(seed: int, count: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(count, random_state=seed).as_matrix()
    poses = [compose(r, p) for r, p in zip(rotations, rng.normal(size=(count, 3)), strict=True)]
    return Trajectory(np.cumsum(rng.uniform(0.1, 1, count)), np.stack(poses))


@given(st.integers(0, 10_000), st.integers(1, 6))
def test_it_passes_through_its_waypoints_and_is_rigid_between(seed: int, count: int) -> None:
    way = random_trajectory(seed, count)
    for time, pose in zip(way.times_s, way.world_from_camera, strict=True):
        assert np.allclose(way.at(time), pose, atol=1e-9)
    for time in np.linspace(way.times_s[0], way.times_s[-1], 7):
        rigid(way.at(time))


def test_it_stands_still_outside_its_times() -> None:
    way = random_trajectory(1, 4)
    assert np.array_equal(way.at(-5), way.at(way.times_s[0]))
    assert np.array_equal(way.at(1e9), way.at(way.times_s[-1]))


def test_a_line_has_constant_speed_and_turning_rate() -> None:
    start, end = look_at([0, 0, 1], [0, 1, 1]), look_at([3, 4, 1], [2, 4, 1])
    way = line(start, end, 2.0)
    times = np.linspace(0, 2, 9)
    assert np.allclose(way.speeds_m_s(times), 2.5, rtol=1e-6)
    assert np.allclose(way.angular_rates_deg_s(times), 45.0, rtol=1e-6)


def test_an_orbit_keeps_radius_and_looks_at_the_centre() -> None:
    way = orbit([1, 2, 0.5], radius_m=3.0, height_m=1.0, duration_s=10.0)
    for time in np.linspace(0, 10, 101):
        pose = way.at(time)
        to_center = np.array([1, 2, 0.5]) - pose[:3, 3]
        assert np.hypot(*to_center[:2]) == pytest.approx(3.0, rel=4e-5)
        assert np.allclose(pose[:3, 2], to_center / np.linalg.norm(to_center), atol=1e-4)


def test_limits_name_the_time_and_the_value() -> None:
    way = line(look_at([0, 0, 1], [0, 1, 1]), look_at([3, 4, 1], [3, 5, 1]), 2.0)
    way.check_limits(speed_m_s=2.51, angular_rate_deg_s=1.0)
    with pytest.raises(SceneError, match=r"expected at most 2 m/s, got 2\.5 m/s at .* s"):
        way.check_limits(speed_m_s=2.0)


def test_frame_times_include_both_ends() -> None:
    way = line(np.eye(4), compose(np.eye(3), [1, 0, 0]), 0.3)
    assert np.allclose(way.frame_times_s(10), [0, 0.1, 0.2, 0.3])
    with pytest.raises(SceneError, match="positive frame rate"):
        way.frame_times_s(0)


@pytest.mark.parametrize("times", [[0, 0], [1, 0.5], [0, np.nan]])
def test_repeated_unsorted_and_nan_times_are_refused(times: list[float]) -> None:
    with pytest.raises(SceneError, match="strictly increasing"):
        Trajectory(np.array(times), np.stack([np.eye(4)] * 2))


def test_wrong_shapes_and_poses_are_refused() -> None:
    with pytest.raises(SceneError, match=r"\(n, 4, 4\)"):
        Trajectory(np.array([0.0, 1.0]), np.eye(4)[None])
    with pytest.raises(SceneError, match="pose 1: expected a rigid transform"):
        Trajectory(np.array([0.0, 1.0]), np.stack([np.eye(4), np.diag([2.0, 1, 1, 1])]))
    with pytest.raises(SceneError, match="radius_m"):
        orbit([0, 0, 0], 0.0, 1.0, 1.0)


def test_quaternions_round_trip_and_must_have_unit_length() -> None:
    way = random_trajectory(3, 5)
    again = from_quaternions(way.times_s, way.world_from_camera[:, :3, 3], quaternions_xyzw(way))
    assert np.allclose(again.world_from_camera, way.world_from_camera, atol=1e-12)
    with pytest.raises(SceneError, match="pose 0: expected a unit quaternion, got one of length 2"):
        from_quaternions([0], [[0, 0, 0]], [[0, 0, 0, 2]])
