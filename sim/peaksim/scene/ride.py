"""Rides: a robot's camera at constant height and pitch along a path, with stops, bumps and changing light."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from peaksim.camera.camera import Camera
from peaksim.camera.sensor import Sensor
from peaksim.errors import SceneError
from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.pose import Pose, look_at, rotation_about
from peaksim.geometry.trajectory import Trajectory

_STEP_S = 0.01
"""Step of the table of arc length over time; between its rows braking at 0.5 m/s² is off by 0.006 mm at most."""


@dataclass(frozen=True)
class Mount:
    """How the camera sits on the robot."""

    height_m: float
    """Above the floor."""
    pitch_deg: float
    """Downwards from the horizon."""


@dataclass(frozen=True)
class Bumps:
    """A rough floor: smooth random angles and heights with these standard deviations."""

    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    height_m: float = 0.0
    rate_hz: float = 2.0
    """Frequency above which the shaking fades."""


@dataclass(frozen=True)
class ExposureChange:
    """Exposure between two multipliers, as a sine over time that starts half-way between them."""

    low: float = 1.0
    high: float = 1.0
    period_s: float = 10.0


@dataclass(frozen=True, eq=False)
class Ride:
    """Where the camera is over time, and what else changes."""

    trajectory: Trajectory
    """Poses of the camera."""
    frames_per_second: float
    """Frame rate."""
    camera: Camera
    """Intrinsics, lens and shutter."""
    sensor: Sensor
    """Its settings at exposure 1."""
    light: ExposureChange = field(default_factory=ExposureChange)
    """Changes of the exposure."""
    mount: Mount | None = None
    """The camera's height and pitch where they are constant but for bumps; None if not stated."""

    def sensor_at(self, time_s: float) -> Sensor:
        """Return the sensor with the exposure of a time."""
        wave = np.sin(2 * np.pi * time_s / self.light.period_s)
        factor = (self.light.low + self.light.high) / 2 + (self.light.high - self.light.low) / 2 * wave
        return replace(self.sensor, exposure=float(self.sensor.exposure * factor))

    def longest_step_m(self) -> float:
        """Return the longest distance that the camera moves between two frames."""
        times = self.trajectory.frame_times_s(self.frames_per_second)
        eyes = self.trajectory.poses_at(times)[:, :3, 3]
        return float(np.linalg.norm(np.diff(eyes, axis=0), axis=1).max(initial=0.0))


def camera_pose(xy_m: NDArray[np.float64], heading_rad: float, mount: Mount, roll_deg: float = 0.0) -> Pose:
    """Return `world_from_camera` of a robot's camera above a point of the floor."""
    down = np.radians(mount.pitch_deg)
    eye = np.array([*xy_m, mount.height_m])
    ahead = np.array([np.cos(heading_rad) * np.cos(down), np.sin(heading_rad) * np.cos(down), -np.sin(down)])
    pose = look_at(eye, eye + ahead)
    pose[:3, :3] = pose[:3, :3] @ rotation_about("z", roll_deg)
    return pose


def follow_path(
    path: FloorPath,
    mount: Mount,
    speed_m_s: float,
    start_m: float,
    end_m: float,
    rng: np.random.Generator,
    *,
    stops: tuple[tuple[float, float], ...] = (),
    acceleration_m_s2: float = 0.5,
    bumps: Bumps = Bumps(),
    sway_m: float = 0.0,
    sway_length_m: float = 4.0,
    frames_per_second: float = 10.0,
) -> Trajectory:
    """Return the trajectory of a camera along a path, with one pose a frame.

    Parameters
    ----------
    path, mount
        Of the robot on the floor, and of the camera on the robot.
    speed_m_s, acceleration_m_s2
        Cruising speed, and how fast it is reached and left.
    start_m, end_m
        Arc lengths between which the robot drives; outside 0…length the path continues straight.
    rng
        Source of the bumps.
    stops
        (arc length in metres, duration in seconds) at which it waits, in order.
    bumps
        Shaking of the camera.
    sway_m, sway_length_m
        Amplitude and length of slow swings to both sides of the path.
    frames_per_second
        Poses a second.

    Raises
    ------
    SceneError
        If the speeds are not positive, the end is not beyond the start, or a stop is not between them.
    """
    _check(speed_m_s, acceleration_m_s2, frames_per_second, start_m, end_m, stops)
    arc = _arc_over_time(speed_m_s, acceleration_m_s2, start_m, end_m, stops)
    count = int((len(arc) - 1) * _STEP_S * frames_per_second) + 1
    times = np.arange(count) / frames_per_second
    at = np.interp(times, np.arange(len(arc)) * _STEP_S, arc)
    heading = path.heading_rad(at)
    swing = 2 * np.pi * at / sway_length_m
    side = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    xy_m = path.at(at) + sway_m * np.sin(swing)[:, None] * side
    heading = heading + np.arctan(sway_m * 2 * np.pi / sway_length_m * np.cos(swing))
    roll, pitch, lift = (
        sigma * smooth_noise(count, bumps.rate_hz / frames_per_second, rng)
        for sigma in (bumps.roll_deg, bumps.pitch_deg, bumps.height_m)
    )
    poses = [
        camera_pose(xy_m[k], heading[k], Mount(mount.height_m + lift[k], mount.pitch_deg + pitch[k]), roll[k])
        for k in range(count)
    ]
    return Trajectory(times, np.stack(poses))


def smooth_noise(count: int, cutoff: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return (count,) normal values of standard deviation 1, low-pass filtered at `cutoff` cycles a value."""
    margin = int(np.ceil(4 / max(cutoff, 1e-3)))
    white = rng.standard_normal(count + 2 * margin)
    width = np.arange(-margin, margin + 1) * max(cutoff, 1e-3) * 2
    kernel = np.exp(-(width**2))
    return np.asarray(np.convolve(white, kernel / np.linalg.norm(kernel), mode="valid"))


def _arc_over_time(
    speed: float, acceleration: float, start: float, end: float, stops: tuple[tuple[float, float], ...]
) -> NDArray[np.float64]:
    """Return arc lengths every `_STEP_S`: speed up, cruise, and brake to a halt at each stop and the end."""
    pieces = [np.array([start])]
    for goal, wait in (*stops, (end, 0.0)):
        begin = float(pieces[-1][-1])
        length = goal - begin
        top = min(speed, np.sqrt(acceleration * length))
        ramp = top / acceleration
        duration = ramp + length / top
        time = np.append(np.arange(_STEP_S, duration, _STEP_S), duration)
        left = np.clip(duration - time, 0, ramp)
        rise = np.clip(time, 0, ramp)
        cruise = np.clip(time - ramp, 0, max(duration - 2 * ramp, 0))
        driven = acceleration * rise**2 / 2 + top * cruise + acceleration * (ramp**2 - left**2) / 2
        pieces += [begin + driven, np.full(round(wait / _STEP_S), goal)]
    return np.concatenate(pieces)


def _check(
    speed: float, acceleration: float, rate: float, start: float, end: float, stops: tuple[tuple[float, float], ...]
) -> None:
    for name, value in (("speed_m_s", speed), ("acceleration_m_s2", acceleration), ("frames_per_second", rate)):
        if not 0 < value < np.inf:
            raise SceneError(f"{name}: expected a positive number, got {value}")
    marks = [start, *(at for at, _ in stops), end]
    if not (np.diff(marks) > 0).all():
        raise SceneError(f"drive: expected start, stops and end in rising order, got {marks} m")
