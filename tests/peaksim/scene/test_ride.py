"""Rides: speeds, stops, height and pitch are as requested."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.camera.camera import Camera
from peaksim.camera.sensor import Sensor
from peaksim.errors import SceneError
from peaksim.geometry.floor_path import FloorPath
from peaksim.scene.ride import Bumps, ExposureChange, Mount, Ride, camera_pose, follow_path, smooth_noise

STRAIGHT = FloorPath(np.array([[0.0, 0.0], [0.0, 10.0]]))
MOUNT = Mount(0.7, 30.0)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_the_camera_stands_over_the_path_and_looks_along_it_and_down() -> None:
    pose = camera_pose(np.array([1.0, 2.0]), np.pi / 2, MOUNT)
    assert np.allclose(pose[:3, 3], [1, 2, 0.7])
    assert np.allclose(pose[:3, 2], [0, np.cos(np.radians(30)), -0.5])
    assert np.allclose(pose[:3, 0], [1, 0, 0])
    rolled = camera_pose(np.zeros(2), np.pi / 2, MOUNT, roll_deg=90)
    assert np.allclose(rolled[:3, 2], pose[:3, 2])
    assert np.allclose(rolled[:3, 0], pose[:3, 1])


@settings(max_examples=40, deadline=None)
@given(speed=st.floats(0.1, 2), length=st.floats(0.5, 8), acceleration=st.floats(0.2, 3))
def test_it_starts_and_ends_at_rest_and_never_goes_faster_than_asked(
    speed: float, length: float, acceleration: float
) -> None:
    trajectory = follow_path(
        STRAIGHT, MOUNT, speed, 0.0, length, rng(), acceleration_m_s2=acceleration, frames_per_second=50
    )
    y = trajectory.world_from_camera[:, 1, 3]
    speeds = np.diff(y) * 50
    assert y[0] == 0
    assert y[-1] == pytest.approx(length, abs=0.01 + 0.03 * acceleration)
    assert speeds.max() <= speed * 1.0001 + 0.01
    assert np.abs(np.diff(speeds)).max() <= 2.5 * acceleration / 50 + 0.02 * speed
    assert np.allclose(trajectory.world_from_camera[:, 2, 3], 0.7)


def test_it_waits_where_it_should() -> None:
    trajectory = follow_path(STRAIGHT, MOUNT, 1.0, 0.0, 6.0, rng(), stops=((2.0, 1.5),), frames_per_second=20)
    y = trajectory.world_from_camera[:, 1, 3]
    assert (np.abs(y - 2.0) < 1e-3).sum() == pytest.approx(30, abs=3)


def test_it_swings_to_both_sides_and_looks_where_it_goes() -> None:
    trajectory = follow_path(
        STRAIGHT, MOUNT, 1.0, 0.0, 10.0, rng(), sway_m=0.1, sway_length_m=2.0, frames_per_second=50
    )
    positions, ahead = trajectory.world_from_camera[:, :2, 3], trajectory.world_from_camera[:, :2, 2]
    assert np.abs(positions[:, 0]).max() == pytest.approx(0.1, abs=2e-3)
    step = np.diff(positions[100:-100], axis=0)
    along = ahead[100:-101] / np.linalg.norm(ahead[100:-101], axis=1, keepdims=True)
    rotation = np.arccos(np.clip((along * step).sum(axis=1) / np.linalg.norm(step, axis=1), -1, 1))
    assert np.degrees(rotation).max() < 2


def test_bumps_have_the_asked_deviation_and_are_seeded() -> None:
    bumps = Bumps(roll_deg=1.0, pitch_deg=0.5, rate_hz=2.0)
    trajectories = [
        follow_path(STRAIGHT, MOUNT, 0.1, 0.0, 10.0, np.random.default_rng(seed), bumps=bumps) for seed in (1, 1, 2)
    ]
    assert np.array_equal(trajectories[0].world_from_camera, trajectories[1].world_from_camera)
    assert not np.array_equal(trajectories[0].world_from_camera, trajectories[2].world_from_camera)
    pitch = np.degrees(np.arcsin(-trajectories[0].world_from_camera[:, 2, 2]))
    assert pitch.std() == pytest.approx(0.5, rel=0.25)
    assert pitch.mean() == pytest.approx(30, abs=0.2)


def test_noise_is_of_unit_deviation_and_smooth() -> None:
    noise = smooth_noise(20_000, 0.05, rng())
    assert noise.std() == pytest.approx(1, rel=0.05)
    assert np.abs(np.diff(noise)).max() < 0.5


def test_the_light_swings_between_its_limits() -> None:
    ride = Ride(
        follow_path(STRAIGHT, MOUNT, 1.0, 0.0, 5.0, rng()),
        10.0,
        Camera(),
        Sensor(exposure=2.0),
        ExposureChange(0.5, 1.0, 4.0),
    )
    exposures = [ride.sensor_at(t).exposure for t in (0.0, 1.0, 3.0)]
    assert np.allclose(exposures, [1.5, 2.0, 1.0])
    assert ride.longest_step_m() == pytest.approx(0.1, abs=0.005)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed_m_s": 0.0}, "speed_m_s: expected a positive number, got 0"),
        ({"end_m": -1.0}, "drive: expected start, stops and end in rising order"),
        ({"stops": ((7.0, 1.0),)}, "drive: expected start, stops and end in rising order"),
        ({"frames_per_second": np.inf}, "frames_per_second: expected a positive number, got inf"),
    ],
)
def test_senseless_rides_are_refused(change: dict, message: str) -> None:
    arguments = {"speed_m_s": 1.0, "start_m": 0.0, "end_m": 6.0, **change}
    with pytest.raises(SceneError, match=message):
        follow_path(STRAIGHT, MOUNT, rng=rng(), **arguments)
