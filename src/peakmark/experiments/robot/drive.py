"""A robot that drives along markers by its camera alone (paper, Section 4.2, with the loop closed).

    path ─▶ scene ─▶ image ─▶ markers found ─▶ command ─▶ wheels, with noise and latency ─▶ the next image

The controller knows the camera's height and pitch, its own wheels' distance, and the detections: no map, no path.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.sensor import apply_sensor
from peaksim.geometry.floor_path import FloorPath
from peaksim.scene.file import Setup, build_setup, read_table
from peaksim.scene.ride import Mount, smooth_noise
from peaksim.scene.schema import RoomTable, SceneTable, WaypointTable

from peakmark.errors import InputError
from peakmark.experiments.drawing import Drawing
from peakmark.experiments.floor.flight import score_flight_view
from peakmark.experiments.floor.flight_records import FrameRecord, record_of
from peakmark.experiments.floor.view import FloorView
from peakmark.experiments.option import check_range
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
from peakmark.identification.stretch import Stretch, floor_stretch

BEYOND_M = 0.6
"""How far the markers continue beyond the path's end: the camera cannot see the floor below it."""

FIRST_M = 0.3
"""Where on the path the first marker lies: in view of the robot, which starts at 0."""

PATIENCE = 8
"""Frames in a row that the robot stands still before the drive is over: longer than its latency."""

_ROOM_M = 3.0
"""Of floor around the markers, so that the camera's view rarely ends before it."""

_STEP_M = 0.25
"""Between the waypoints of a path."""

_BEND_PER_M = 0.35
"""Standard deviation of a path's curvature, rad/m, before it is limited; chosen by hand for paths that wind."""

_MOST_BEND_PER_M = 0.7
"""Largest curvature, a radius of 1.4 m."""

_APART_M = 1.5
"""Distance that a path keeps from its other parts: markers of one part should not be taken for those of another."""


@dataclass(frozen=True)
class DriveConfig(Drawing):
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
    frames_per_second: float = 5.0
    """Images that the robot takes."""
    camera: Camera = field(default_factory=lambda: Camera(640, 480, 420.0, 420.0, 319.5, 239.5))
    """The robot's."""
    mount: Mount = field(default_factory=lambda: Mount(0.7, 38.0))
    """Its height and pitch."""
    robot: Robot = field(default_factory=Robot)
    """Wheels and latency."""
    steering: Steering = field(default_factory=Steering)
    """How it follows the markers."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("paths", self.paths, 1, 10_000)
        check_range("length", self.length_m, 1, 100, " m")
        check_range("spacing", self.spacing_m, 0.15, 0.8 * self.length_m, " m")
        check_range("line-ends", self.line_ends_m, FIRST_M + self.spacing_m, self.length_m, " m")
        check_range("rate", self.frames_per_second, 1, 50, " frames a second")


@dataclass(frozen=True)
class DrivePath:
    """One path to drive."""

    number: int
    """Of the path, from 0."""
    path: FloorPath
    setup: Setup
    """The floor with its markers."""


@dataclass(frozen=True)
class DriveFrame:
    """A frame of a drive, and what the robot did."""

    record: FrameRecord
    state: State
    """Where the robot was when it was taken."""
    command: Command
    """That the frame led to."""


def build_path(config: DriveConfig, number: int) -> DrivePath:
    """Return one of the random paths, on the floor of the scene.

    The scene must have exactly one marker path, from which the markers' kind and size are taken; else an `InputError`.
    """
    path = winding_path(config.length_m, np.random.default_rng((config.seed, number)))
    table, folder = read_table(config.scene)
    if len(table.marker_paths) != 1:
        raise InputError(f"{config.scene}: expected one entry in marker_paths, found {len(table.marker_paths)}")
    variants = {} if config.texture is None else {"floor": config.texture}
    setup = build_setup(_laid_out(table, path, config), folder, variants)
    return DrivePath(number, path, setup.seen_by(config.sensor))


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
    """Return the scene with the path's markers instead of its own, in a room around them."""
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
    config: DriveConfig, drive_path: DrivePath, on_view: Callable[[FloorView], None] = lambda view: None
) -> list[DriveFrame]:
    """Drive along one path until the robot has stood still for `PATIENCE` frames, and return its frames."""
    rng = np.random.default_rng((config.seed, drive_path.number, 1))
    state, bias = start(drive_path.path, rng), rng.normal(0, config.robot.wheel_bias, 2)
    commands: list[Command] = []
    frames = []
    most_frames = round(4 * config.length_m / config.steering.speed_m_s * config.frames_per_second) + 20
    for index in range(most_frames):  # enough at a quarter of the speed
        view = render_view(config, drive_path, state, index)
        commands.append(decide(config, view, commands[-1] if commands else STOP))
        frames.append(DriveFrame(record_of(view), state, commands[-1]))
        on_view(view)
        if commands[-PATIENCE:] == [STOP] * PATIENCE:
            break
        state = moved(config, state, commands, bias, rng)
    return frames


def start(path: FloorPath, rng: np.random.Generator) -> State:
    """Return where the robot is put: near the path's start, roughly along it."""
    x, y = path.at(0.0)[0] + rng.normal(0, 0.03, 2)
    return State(float(x), float(y), float(path.heading_rad(0.0)[0] + rng.normal(0, 0.05)))


def decide(config: DriveConfig, view: FloorView, last: Command) -> Command:
    """Return what the robot does about the markers in its image."""
    xy = np.array([detection.xy for detection in view.found.detections]).reshape(-1, 2)
    markers_m = seen_from_robot(config.robot, config.mount, config.camera, xy)
    return steer(config.robot, config.steering, markers_m, last.speed_m_s)


def moved(
    config: DriveConfig, state: State, commands: list[Command], bias: NDArray[np.float64], rng: np.random.Generator
) -> State:
    """Return where the robot is at the next image; each command takes effect `latency_s` after its image."""
    frame_s = 1 / config.frames_per_second
    for step in range(round(frame_s / NOISE_S)):
        late = (step * NOISE_S - config.robot.latency_s) / frame_s
        index = len(commands) - 1 + int(np.floor(late + 1e-9))
        state = driven(config.robot, state, commands[index] if index >= 0 else STOP, NOISE_S, bias, rng)
    return state


def render_view(config: DriveConfig, drive_path: DrivePath, state: State, index: int) -> FloorView:
    """Render and score what the robot's camera sees."""
    begin = perf_counter()
    time_s = index / config.frames_per_second
    pose = robot_camera_pose(config.robot, state, config.mount)
    seeds = config.seed, drive_path.number, index
    frame = config.frame(drive_path.setup.scene, config.camera, pose, time_s, seeds)
    frame = apply_sensor(
        frame, drive_path.setup.sensor, np.random.default_rng((config.seed, drive_path.number, 2, index))
    )
    return score_flight_view(index, frame, perf_counter() - begin, stretch_of(config), "joint")


def stretch_of(config: DriveConfig) -> Stretch:
    """Return the vertical stretch of each row that the camera's pitch implies."""
    return floor_stretch(config.camera, config.mount.pitch_deg)
