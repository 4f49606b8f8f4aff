"""A robot that drives along markers by what its camera sees (paper, Section 4.2, with the loop closed).

    path ─▶ scene ─▶ picture ─▶ markers seen ─▶ command ─▶ wheels, with noise and latency ─▶ the next picture

The controller knows the camera's height and pitch, its own wheels' distance, and the detections: no map, no path.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import apply_sensor
from peaksim.geometry.floor_path import FloorPath
from peaksim.rendering import Renderer, render
from peaksim.scene.file import Setup, build_setup, read_table
from peaksim.scene.ride import Mount, smooth_noise
from peaksim.scene.schema import RoomTable, SceneTable, WaypointTable

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import Shot, judge, quicker
from peakmark.experiments.robot.robot import (
    NOISE_S,
    STOP,
    Command,
    Robot,
    State,
    Steering,
    driven,
    robot_camera_pose,
    seen_from_robot,
    steer,
)
from peakmark.identification.stretch import floor_stretch

BEYOND_M = 0.6
"""How far the markers go on beyond the path's end: the camera cannot see the floor below it."""

FIRST_M = 0.3
"""Where on the path the first marker lies; the robot starts at 0."""

PATIENCE = 8
"""Frames in a row that it stands still before the drive is over."""

_ROOM_M = 3.0
_STEP_M = 0.25
_BEND_PER_M = 0.35
_MOST_BEND_PER_M = 0.7
_APART_M = 1.5


@dataclass(frozen=True)
class DriveConfig:
    """How many paths, of what kind, and who drives."""

    paths: int = 20
    """Random paths, each driven once."""
    length_m: float = 10.0
    """Of each path."""
    spacing_m: float = 0.3
    """From marker to marker."""
    line_ends_m: float | None = None
    """Where on the path the markers stop short, to see what the robot does; None: beyond its end."""
    scene: str = "hall"
    """Scene file or name whose floor, sensor and kind of marker are used."""
    texture: str | None = None
    """Variant of the texture named "floor"; None takes the first."""
    renderer: Renderer = "auto"
    """"gl", "exact", "traced" or "auto": exact without furniture."""
    seed: int = 0
    """Of paths, wheels and sensor."""
    frames_per_second: float = 5.0
    """Pictures that the robot takes."""
    camera: Camera = field(default_factory=lambda: Camera(640, 480, 420.0, 420.0, 319.5, 239.5))
    """The robot's."""
    mount: Mount = field(default_factory=lambda: Mount(0.7, 38.0))
    """Its height and pitch."""
    robot: Robot = field(default_factory=Robot)
    steering: Steering = field(default_factory=Steering)
    samples: int = 64
    """Paths a pixel of the traced renderer."""

    def __post_init__(self) -> None:
        longest_gap, end = 0.8 * self.length_m, self.length_m if self.line_ends_m is None else self.line_ends_m
        second = FIRST_M + self.spacing_m
        for name, value, fits, expected in (
            ("paths", self.paths, 1 <= self.paths <= 10_000, "1…10000"),
            ("length", self.length_m, 1 <= self.length_m <= 100, "1…100 m"),
            ("spacing", self.spacing_m, 0.15 <= self.spacing_m <= longest_gap, f"0.15…{longest_gap:g} m"),
            ("line-ends", end, second <= end <= self.length_m, f"{second:g}…{self.length_m:g} m"),
            ("seed", self.seed, self.seed >= 0, "0 or more"),
            ("rate", self.frames_per_second, 1 <= self.frames_per_second <= 50, "1…50 frames a second"),
            ("renderer", self.renderer, self.renderer in get_args(Renderer), "auto, gl, exact or traced"),
            ("samples", self.samples, self.samples >= 1, "1 or more"),
        ):
            if not fits:
                raise InputError(f"--{name}: expected {expected}, got {value}")


@dataclass(frozen=True)
class Course:
    """One path to drive."""

    number: int
    path: FloorPath
    setup: Setup
    """The floor with its markers."""


def course(config: DriveConfig, number: int) -> Course:
    """Return one of the random paths, on the floor of the scene.

    Raises
    ------
    InputError
        One line for a faulty scene, or one without exactly one marker path to take the markers' kind and size from.
    """
    path = winding_path(config.length_m, np.random.default_rng((config.seed, number)))
    table, folder = read_table(config.scene)
    if len(table.marker_paths) != 1:
        raise InputError(f"{config.scene}: expected one entry in marker_paths, found {len(table.marker_paths)}")
    variants = {} if config.texture is None else {"floor": config.texture}
    return Course(number, path, build_setup(_laid_out(table, path, config), folder, variants))


def winding_path(length_m: float, rng: np.random.Generator) -> FloorPath:
    """Return a random path of a length, nowhere sharper than a radius of 1.4 m, that does not come near itself."""
    count = round(length_m / _STEP_M) + 1
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) * _STEP_M > 1.3 * _APART_M
    while True:
        bend = np.clip(_BEND_PER_M * smooth_noise(count, 0.12, rng), -_MOST_BEND_PER_M, _MOST_BEND_PER_M)
        heading = np.cumsum(bend * _STEP_M)
        points = np.cumsum(_STEP_M * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
        if gaps[apart].min(initial=np.inf) > _APART_M:
            return FloorPath(points * length_m / FloorPath(points).length_m)


def _laid_out(table: SceneTable, path: FloorPath, config: DriveConfig) -> SceneTable:
    """Return the scene with the path's markers in the place of its own, in a room around them."""
    end = config.length_m + BEYOND_M if config.line_ends_m is None else config.line_ends_m
    arcs = np.arange(FIRST_M, end + 1e-9, config.spacing_m)
    line = path.at(arcs)
    low, high = line.min(axis=0) - _ROOM_M, line.max(axis=0) + _ROOM_M
    room = RoomTable(min_m=(*low, 0.0), max_m=(*high, 3.0), floor=None if table.room is None else table.room.floor)
    markers = table.marker_paths[0].model_copy(
        update={"count": len(arcs), "waypoints_m": tuple((float(x), float(y)) for x, y in line)}
    )
    eye = WaypointTable(eye_m=(*line[0], 1.0), target_m=(*line[-1], 0.0))
    return table.model_copy(update={"marker_paths": (markers,), "room": room, "trajectory": (eye,)})


def drive(
    config: DriveConfig, way: Course, on_frame: Callable[[Shot], None] = lambda shot: None
) -> list[dict[str, Any]]:
    """Drive along one path until the robot has stood still for `PATIENCE` frames, and return a record a frame.

    A record is that of `flight.judge` with `state` (x, y in m, heading in rad) when the picture was taken and
    `command` (m/s, rad/s) that it led to.
    """
    rng = np.random.default_rng((config.seed, way.number, 1))
    state, bias = start(way.path, rng), rng.normal(0, config.robot.wheel_bias, 2)
    stretch = floor_stretch(config.camera, config.mount.pitch_deg)
    commands: list[Command] = []
    records = []
    for index in range(_most_frames(config)):
        frame, render_s = _picture(config, way, state, index)
        shot = judge(frame, stretch, "joint", index, render_s)
        command = decide(config, shot, commands[-1] if commands else STOP)
        commands.append(command)
        place = {"state": [state.x_m, state.y_m, state.heading_rad], "command": [command.speed_m_s, command.turn_rad_s]}
        records.append({**shot.record, **place})
        on_frame(shot)
        if commands[-PATIENCE:] == [STOP] * PATIENCE:
            break
        state = moved(config, state, commands, bias, rng)
    return records


def start(path: FloorPath, rng: np.random.Generator) -> State:
    """Return where the robot is put: near the path's start, roughly along it."""
    x, y = path.at(0.0)[0] + rng.normal(0, 0.03, 2)
    return State(float(x), float(y), float(path.heading_rad(0.0)[0] + rng.normal(0, 0.05)))


def decide(config: DriveConfig, shot: Shot, last: Command) -> Command:
    """Return what the robot does about the markers in its picture."""
    xy = np.array([detection.xy for detection in shot.found.detections]).reshape(-1, 2)
    seen = seen_from_robot(config.robot, config.mount, config.camera, xy)
    return steer(config.robot, config.steering, seen, last.speed_m_s)


def moved(
    config: DriveConfig, state: State, commands: list[Command], bias: NDArray[np.float64], rng: np.random.Generator
) -> State:
    """Return where the robot is at the next picture; each command takes effect `latency_s` after its picture."""
    frame_s = 1 / config.frames_per_second
    for step in range(round(frame_s / NOISE_S)):
        late = (step * NOISE_S - config.robot.latency_s) / frame_s
        index = len(commands) - 1 + int(np.floor(late + 1e-9))
        state = driven(config.robot, state, commands[index] if index >= 0 else STOP, NOISE_S, bias, rng)
    return state


def _picture(config: DriveConfig, way: Course, state: State, index: int) -> tuple[Frame, float]:
    """Return the frame that the robot sees, and the seconds that it took to render."""
    begin = perf_counter()
    scene = way.setup.scene
    pose = robot_camera_pose(config.robot, state, config.mount)
    frame = render(
        scene,
        config.camera,
        pose,
        quicker(config.renderer, scene),
        time_s=index / config.frames_per_second,
        samples=config.samples,
        seed=(config.seed, way.number, index),
    )
    frame = apply_sensor(frame, way.setup.sensor, np.random.default_rng((config.seed, way.number, 2, index)))
    return frame, perf_counter() - begin


def _most_frames(config: DriveConfig) -> int:
    """Return a number of frames that is enough at a quarter of the speed."""
    return round(4 * config.length_m / config.steering.speed_m_s * config.frames_per_second) + 20
