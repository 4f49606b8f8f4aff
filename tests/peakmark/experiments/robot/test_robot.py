"""The robot and its controller, with projected truth instead of a detector."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.camera.camera import Camera
from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.pose import invert, transform
from peaksim.scene.ride import Mount, smooth_noise

from peakmark.errors import InputError
from peakmark.experiments.robot.robot import (
    STOP,
    Command,
    Robot,
    State,
    Steering,
    advanced,
    driven,
    line_at,
    next_markers,
    robot_camera_pose,
    seen_from_robot,
    steer,
    wheel_speeds,
)

CAMERA = Camera(640, 480, 420.0, 420.0, 319.5, 239.5)
MOUNT, ROBOT, STEERING = Mount(0.7, 38.0), Robot(), Steering()
FRAME_S = 0.1


def random_path(rng: np.random.Generator) -> FloorPath:
    """Return a winding path of about 10 m, nowhere sharper than a radius of 1.4 m."""
    heading = np.cumsum(np.clip(0.35 * smooth_noise(41, 0.12, rng), -0.7, 0.7) * 0.25)
    return FloorPath(np.cumsum(0.25 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)[::2])


def drive(path: FloorPath, rng: np.random.Generator, blind_from: int = 10_000) -> tuple[np.ndarray, list[Command]]:
    """Return the robot's position and command in each frame; nothing is detected from a frame on."""
    markers = np.column_stack([path.at(np.arange(0, path.length_m, 0.3)), np.zeros(int(np.ceil(path.length_m / 0.3)))])
    state = State(*(path.at(-0.5)[0] + rng.normal(0, 0.03, 2)), float(path.heading_rad(0)[0]) + rng.normal(0, 0.05))
    bias = rng.normal(0, ROBOT.wheel_bias, 2)
    commands, positions = [STOP, STOP], []
    for frame in range(400):
        pose = robot_camera_pose(ROBOT, state, MOUNT)
        near = np.linalg.norm(markers - pose[:3, 3], axis=1) < 2.5
        xy = CAMERA.project(transform(invert(pose), markers[near]))
        seen = xy[((xy > 15) & (xy < [624, 464])).all(axis=1) & (rng.random(len(xy)) > 0.02)]
        seen = seen + rng.normal(0, 1.0, seen.shape)
        if frame >= blind_from:
            seen = seen[:0]
        commands.append(steer(ROBOT, STEERING, seen_from_robot(ROBOT, MOUNT, CAMERA, seen), commands[-1].speed_m_s))
        state = driven(ROBOT, state, commands[-2], FRAME_S, bias, rng)
        positions.append((state.x_m, state.y_m))
        if commands[-10:] == [STOP] * 10:
            break
    return np.array(positions), commands


@pytest.mark.parametrize("seed", range(6))
def test_it_follows_ten_metres_and_stops_at_the_end(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    positions, commands = drive(path, rng)
    at, left = path.nearest(positions)
    on_path = (at > 0) & (at < path.length_m)
    assert commands[-1] == STOP
    assert path.length_m - at[-1] < 0.8
    assert np.sqrt((left[on_path] ** 2).mean()) < 0.05


def test_it_stops_at_once_when_it_sees_nothing() -> None:
    rng = np.random.default_rng(0)
    positions, commands = drive(random_path(rng), rng, blind_from=60)
    assert commands[2 + 60 :] == [STOP] * len(commands[2 + 60 :])
    assert np.linalg.norm(positions[-1] - positions[60]) < 0.1


@settings(max_examples=60, deadline=None)
@given(speed=st.floats(-1, 1), turn_rate=st.floats(-3, 3), heading=st.floats(-3, 3), steps=st.integers(2, 30))
def test_an_arc_in_one_step_is_the_same_arc_in_many(speed: float, turn_rate: float, heading: float, steps: int) -> None:
    wheels = wheel_speeds(ROBOT, Command(speed, turn_rate))
    at_once = advanced(ROBOT, State(1.0, 2.0, heading), wheels, 0.5)
    state = State(1.0, 2.0, heading)
    for _ in range(steps):
        state = advanced(ROBOT, state, wheels, 0.5 / steps)
    assert np.allclose([state.x_m, state.y_m, state.heading_rad], [at_once.x_m, at_once.y_m, at_once.heading_rad])
    assert at_once.heading_rad == pytest.approx(heading + 0.5 * turn_rate)


def test_a_quarter_circle_ends_where_it_should() -> None:
    state = advanced(ROBOT, State(0, 0, 0), wheel_speeds(ROBOT, Command(1.0, 1.0)), np.pi / 2)
    assert np.allclose([state.x_m, state.y_m, state.heading_rad], [1, 1, np.pi / 2])


@settings(max_examples=40, deadline=None)
@given(x=st.floats(0.5, 3), y=st.floats(-0.3, 0.3), heading=st.floats(-3, 3))
def test_what_the_camera_sees_is_where_it_is_from_the_robot(x: float, y: float, heading: float) -> None:
    state = State(0.3, -0.2, heading)
    c, s = np.cos(heading), np.sin(heading)
    point = [[0.3 + c * x - s * y, -0.2 + s * x + c * y, 0.0]]
    xy = CAMERA.project(transform(invert(robot_camera_pose(ROBOT, state, MOUNT)), point))
    assert np.allclose(seen_from_robot(ROBOT, MOUNT, CAMERA, xy), [[x, y]], atol=1e-6)


def test_the_line_is_followed_marker_by_marker() -> None:
    line = np.array([[0.5, 0.0], [0.8, 0.05], [1.1, 0.15], [1.4, 0.3]])
    others = np.array([[-0.5, 0.0], [0.6, 2.0], [3.5, 0.0]])
    assert np.allclose(next_markers(np.concatenate([others, line[::-1]])), line)
    assert next_markers(others[:1]).shape == (0, 2)


def test_a_parabola_gives_its_own_offset_slope_and_curvature() -> None:
    x = np.array([0.4, 0.7, 1.0, 1.3])
    offset, slope, curvature = line_at(np.column_stack([x, 0.1 - 0.2 * x + 0.3 * x**2]), 0.0)
    assert (offset, slope) == (pytest.approx(0.1), pytest.approx(-0.2))
    assert curvature == pytest.approx(0.6 / 1.04**1.5)
    assert line_at(np.array([[0.5, 0.1], [1.0, 0.2]]), 0.0) == (pytest.approx(0), pytest.approx(0.2), 0.0)
    assert line_at(np.array([[0.5, 0.1]]), 0.25) == (pytest.approx(0.05), pytest.approx(0.2), 0.0)


def test_it_steers_back_to_the_line() -> None:
    line = np.column_stack([np.arange(0.4, 2, 0.3), np.full(6, 0.1)])
    assert steer(ROBOT, STEERING, line, 0.5).turn_rad_s > 0
    assert steer(ROBOT, STEERING, -line * [-1, 1], 0.5).turn_rad_s < 0
    straight = steer(ROBOT, STEERING, line * [1, 0], 0.5)
    assert straight == Command(0.5, pytest.approx(0.0, abs=1e-9))
    assert steer(ROBOT, STEERING, line[:1] * [1, 0], 0.5).speed_m_s == 0.25
    assert steer(ROBOT, STEERING, np.empty((0, 2)), 0.5) == STOP


def test_senseless_robots_are_refused() -> None:
    for field, value in (("track_width_m", 0.0), ("wheel_noise", -0.1), ("latency_s", np.inf)):
        with pytest.raises(InputError, match=rf"robot\.{field}: expected a number of at least 0, got"):
            Robot(**{field: value})
