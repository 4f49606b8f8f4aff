"""TOML → ride: how a robot drives through a scene; `scenes/README.md` is the manual of the fields."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from peaksim import shipped
from peaksim.errors import InputError, SceneError
from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import load_trajectory
from peaksim.scene.build_camera import build_camera
from peaksim.scene.file import Setup, build_sensor, find_scene_beside, load_scene, read_table
from peaksim.scene.ride import Bumps, ExposureChange, Mount, Ride, follow_path
from peaksim.scene.schema import CameraTable, Name, NotNegative, Number, Point2, Positive, SceneTable, StrictTable
from peaksim.toml_file import parse_toml, validate

TRAJECTORIES = shipped.SCENES / "trajectories"


class StopTable(StrictTable):
    """`[[drive.stops]]`."""

    at_m: Number
    duration_s: Positive


class DriveTable(StrictTable):
    """`[drive]`."""

    path: Name | None = None
    waypoints_m: Annotated[tuple[Point2, ...], Field(min_length=2)] | None = None
    height_m: Positive
    pitch_deg: Annotated[float, Field(ge=-60, le=89)]
    speed_m_s: Positive
    acceleration_m_s2: Positive = 0.5
    start_m: Number = -0.5
    end_m: Number | None = None
    sway_m: NotNegative = 0.0
    sway_length_m: Positive = 4.0
    stops: tuple[StopTable, ...] = ()

    @model_validator(mode="after")
    def _one_path(self) -> "DriveTable":
        if (self.path is None) == (self.waypoints_m is None):
            raise ValueError("expected exactly one of path and waypoints_m")
        return self


class BumpsTable(StrictTable):
    """`[bumps]`."""

    roll_deg: NotNegative = 0.0
    pitch_deg: NotNegative = 0.0
    height_m: NotNegative = 0.0
    rate_hz: Positive = 2.0


class ExposureTable(StrictTable):
    """`[light]`."""

    low: Positive = 1.0
    high: Positive = 1.0
    period_s: Positive = 10.0


class RideTable(StrictTable):
    """The whole file."""

    scene: str
    frames_per_second: Positive = 10.0
    exposure_s: NotNegative = 0.0
    camera: CameraTable | None = None
    sensor: dict[str, Any] | None = None
    drive: DriveTable
    bumps: BumpsTable = BumpsTable()
    light: ExposureTable = ExposureTable()


def load_ride(
    path: str | Path, scene: str | None = None, texture: str | None = None, seed: int = 0
) -> tuple[Setup, Ride]:
    """Read a ride and the scene that it leads through.

    Parameters
    ----------
    path
        A ride (TOML), the bare name of one that ships with the package, or a TUM, EuRoC or KITTI file.
    scene
        Scene file or name; None takes the one that the ride names. A pose file needs it.
    texture
        Variant of the texture named "floor"; None takes the first.
    seed
        Of the bumps.

    Raises
    ------
    SceneError
        One line that names the file, the field, what was expected and what came; also where the camera leaves the room.
    """
    file = _find_ride(path)
    table = validate(RideTable, parse_toml(file), str(path)) if file.suffix == ".toml" else None
    named: str | Path | None = scene
    if named is None and table is not None:
        named = find_scene_beside(file.parent, table.scene, f"{path}: scene")
    if named is None:
        raise SceneError(f"{path}: expected --scene beside a file of poses")
    setup = load_scene(named, {} if texture is None else {"floor": texture})
    layout = read_table(named)[0]
    try:
        ride = _ride(table, setup, layout, seed) if table else _ride_on_poses(file, setup)
        _check_inside(ride, layout)
    except InputError as error:
        raise SceneError(str(error) if str(path) in str(error) else f"{path}: {error}") from error
    return setup, ride


def _find_ride(path: str | Path) -> Path:
    shipped_file = TRAJECTORIES / f"{path}.toml"
    return shipped_file if Path(path).name == str(path) and shipped_file.is_file() else Path(path)


def _ride_on_poses(file: Path, setup: Setup) -> Ride:
    trajectory = load_trajectory(file)
    rate = (len(trajectory) - 1) / trajectory.duration_s if len(trajectory) > 1 else 1.0
    return Ride(trajectory, rate, setup.camera, setup.sensor)


def _ride(table: RideTable, setup: Setup, layout: SceneTable, seed: int) -> Ride:
    drive, mount = table.drive, Mount(table.drive.height_m, table.drive.pitch_deg)
    path = _path(drive, layout)
    trajectory = follow_path(
        path,
        mount,
        drive.speed_m_s,
        drive.start_m,
        path.length_m if drive.end_m is None else drive.end_m,
        np.random.default_rng((seed, 0x62756D70)),  # a stream of its own: "bump"
        stops=tuple((stop.at_m, stop.duration_s) for stop in drive.stops),
        acceleration_m_s2=drive.acceleration_m_s2,
        bumps=Bumps(**table.bumps.model_dump()),
        sway_m=drive.sway_m,
        sway_length_m=drive.sway_length_m,
        frames_per_second=table.frames_per_second,
    )
    lens = setup.camera if table.camera is None else build_camera(table.camera)
    sensor = setup.sensor if table.sensor is None else build_sensor(table.sensor)
    lens = replace(lens, exposure_s=table.exposure_s or lens.exposure_s)
    return Ride(trajectory, table.frames_per_second, lens, sensor, ExposureChange(**table.light.model_dump()), mount)


def _path(drive: DriveTable, layout: SceneTable) -> FloorPath:
    if drive.waypoints_m is not None:
        return FloorPath(np.array(drive.waypoints_m))
    known = {path.name: path for path in layout.marker_paths}
    if drive.path not in known:
        names = ", ".join(known) or "a scene with marker_paths"
        raise SceneError(f"drive.path: expected one of {names}, got {drive.path!r}")
    return FloorPath(np.array(known[drive.path].waypoints_m))


def _check_inside(ride: Ride, layout: SceneTable) -> None:
    """Refuse a camera that leaves the room."""
    if layout.room is None:
        return
    low, high = np.array(layout.room.min_m), np.array(layout.room.max_m)
    times = ride.trajectory.frame_times_s(ride.frames_per_second)
    for time, eye in zip(times, ride.trajectory.poses_at(times)[:, :3, 3], strict=True):
        if not ((low < eye) & (eye < high)).all():
            position = ", ".join(f"{c:.3g}" for c in eye)
            raise SceneError(
                f"expected a camera inside the room {low.tolist()}…{high.tolist()}, "
                f"at {time:.3g} s it is at ({position})"
            )


def shortened(ride: Ride, frames: int) -> Ride:
    """Return the first frames of a ride."""
    times = ride.trajectory.frame_times_s(ride.frames_per_second)[:frames]
    return replace(ride, trajectory=Trajectory(times, ride.trajectory.poses_at(times)))
