"""A robot that follows floor markers by what its detector finds: differential drive, and a controller without a map.

Robot frame: x ahead, y to the left, origin on the floor between the wheels; angles counter-clockwise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose
from peaksim.scene.ride import Mount, camera_pose

from peakmark.errors import InputError
from peakmark.localise.distance import unit_rays
from peakmark.localise.floor import Floor, on_floor

_LONGEST_GAP_M = 0.9
"""Distance from one marker to the next beyond which it belongs to something else: three times the usual spacing."""

_SHARPEST_BEND_DEG = 50.0
"""Change of direction from one marker to the next beyond which it belongs to something else: far more than the 12° of
the sharpest path at the usual spacing, with room for errors of position."""


@dataclass(frozen=True)
class Robot:
    """A differential drive with a camera between its wheels' contact points, or ahead of them."""

    track_width_m: float = 0.3
    """Distance between the wheels."""
    camera_ahead_m: float = 0.1
    """How far the camera is ahead of the axle."""
    wheel_noise: float = 0.05
    """Relative deviation of each wheel's speed, anew every `NOISE_S`."""
    wheel_bias: float = 0.02
    """Relative deviation of each wheel's size, constant over a drive."""
    latency_s: float = 0.15
    """Time from the image to the wheels."""

    def __post_init__(self) -> None:
        for name in ("track_width_m", "camera_ahead_m", "wheel_noise", "wheel_bias", "latency_s"):
            value = getattr(self, name)
            if not 0 <= value < np.inf or (name == "track_width_m" and value == 0):
                raise InputError(f"robot.{name}: expected a number of at least 0, got {value}")


NOISE_S = 0.02
"""Step in which the wheels are simulated; divides the latency and the frame times in use."""


@dataclass(frozen=True)
class State:
    """Where the robot is."""

    x_m: float
    y_m: float
    heading_rad: float
    """Counter-clockwise from the world's x axis."""


@dataclass(frozen=True)
class Command:
    """What the wheels should do."""

    speed_m_s: float = 0.0
    turn_rad_s: float = 0.0
    """Counter-clockwise."""


STOP = Command()


@dataclass(frozen=True)
class Steering:
    """How the controller follows the line."""

    speed_m_s: float = 0.5
    """On a straight line."""
    reach_m: float = 0.4
    """Length over which an offset is steered away: smaller is stiffer."""
    most_turn_rad_s: float = 1.2
    lateral_m_s2: float = 0.25
    """Sideways acceleration that slows it down in curves."""
    fewest: int = 2
    """Markers that show where the line goes; with fewer it halves its speed."""


def wheel_speeds(robot: Robot, command: Command) -> NDArray[np.float64]:
    """Return the (2,) speeds of the left and right wheel, m/s."""
    half = command.turn_rad_s * robot.track_width_m / 2
    return np.array([command.speed_m_s - half, command.speed_m_s + half])


def advanced(robot: Robot, state: State, wheels_m_s: ArrayLike, time_s: float) -> State:
    """Return where the wheels take the robot: along an exact arc."""
    left, right = np.asarray(wheels_m_s, dtype=np.float64)
    arc_m, angle_rad = (left + right) / 2 * time_s, (right - left) / robot.track_width_m * time_s
    chord_m = arc_m * np.sinc(angle_rad / (2 * np.pi))
    middle = state.heading_rad + angle_rad / 2
    return State(
        state.x_m + chord_m * np.cos(middle), state.y_m + chord_m * np.sin(middle), state.heading_rad + angle_rad
    )


def driven(
    robot: Robot, state: State, command: Command, time_s: float, bias: NDArray[np.float64], rng: np.random.Generator
) -> State:
    """Return where a command takes the robot when the wheels slip and are not the size they should be.

    `time_s` is rounded to multiples of `NOISE_S`; `bias` is the (2,) relative error of each wheel.
    """
    speeds = wheel_speeds(robot, command)
    for _ in range(round(time_s / NOISE_S)):
        slip = 1 + bias + robot.wheel_noise * rng.standard_normal(2)
        state = advanced(robot, state, speeds * slip, NOISE_S)
    return state


def robot_camera_pose(robot: Robot, state: State, mount: Mount) -> Pose:
    """Return `world_from_camera` of the robot's camera."""
    ahead = robot.camera_ahead_m * np.array([np.cos(state.heading_rad), np.sin(state.heading_rad)])
    return camera_pose(np.array([state.x_m, state.y_m]) + ahead, state.heading_rad, mount)


def seen_from_robot(robot: Robot, mount: Mount, camera: Camera, xy: ArrayLike) -> NDArray[np.float64]:
    """Return (k, 2) robot coordinates, m, of detections at (n, 2) px, by the camera's known height and pitch.

    Detections above the horizon are left out.
    """
    down = np.radians(mount.pitch_deg)
    floor = Floor(np.array([0.0, -np.cos(down), -np.sin(down)]), mount.height_m)
    right_ahead = on_floor(floor, unit_rays(camera, np.asarray(xy, dtype=np.float64).reshape(-1, 2)))
    right_ahead = right_ahead[np.isfinite(right_ahead).all(axis=1)]
    return np.column_stack([right_ahead[:, 1] + robot.camera_ahead_m, -right_ahead[:, 0]])


def steer(robot: Robot, steering: Steering, markers_m: NDArray[np.float64], speed_m_s: float) -> Command:
    """Return what to do about (n, 2) markers in the robot frame, at a speed: follow their line; without any, stop."""
    line = next_markers(markers_m)
    if len(line) == 0:
        return STOP
    offset, slope, curvature = line_at(line, speed_m_s * robot.latency_s)
    bend = curvature + 2 * 0.8 / steering.reach_m * np.arctan(slope) + offset / steering.reach_m**2
    speed = steering.speed_m_s if len(line) >= steering.fewest else steering.speed_m_s / 2
    speed = min(speed, np.sqrt(steering.lateral_m_s2 / max(abs(curvature), 1e-6)))
    turn = float(np.clip(bend * speed, -steering.most_turn_rad_s, steering.most_turn_rad_s))
    return Command(float(min(speed, abs(turn / bend) if bend else speed)), turn)


def next_markers(markers_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (k, 2) markers ahead, nearest first: each the nearest in about the same direction."""
    left = markers_m[markers_m[:, 0] > 0]
    chain: list[NDArray[np.float64]] = []
    here, direction = np.zeros(2), np.array([1.0, 0.0])
    while len(left):
        steps = left - here
        gaps = np.linalg.norm(steps, axis=1)
        fits = steps @ direction >= gaps * np.cos(np.radians(_SHARPEST_BEND_DEG))
        if chain:
            fits &= gaps <= _LONGEST_GAP_M
        if not fits.any():
            break
        k = int(np.argmin(np.where(fits, gaps, np.inf)))
        if chain:
            direction = steps[k] / max(gaps[k], 1e-9)
        here = left[k]
        chain.append(here)
        left = np.delete(left, k, axis=0)
    return np.array(chain).reshape(-1, 2)


def line_at(line_m: NDArray[np.float64], x_m: float) -> tuple[float, float, float]:
    """Return offset y (m), slope dy/dx and curvature (1/m) of the line at x, from the (k, 2) next markers, k ≥ 1.

    A parabola through them, near ones weighing more; with two a straight line, with one the line from the robot to it.
    """
    x, y = line_m[:, 0], line_m[:, 1]
    if len(line_m) == 1:
        slope = float(y[0] / max(x[0], 1e-3))
        return slope * x_m, slope, 0.0
    degree = 1 if len(line_m) == 2 else 2
    parabola = np.polynomial.Polynomial.fit(x, y, degree, w=1 / np.maximum(x, 0.2) ** 2)
    offset, slope, bend = parabola(x_m), parabola.deriv()(x_m), parabola.deriv(2)(x_m)
    return float(offset), float(slope), float(bend / (1 + slope**2) ** 1.5)
