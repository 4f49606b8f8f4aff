"""The camera of a scene file and its trajectory; each error starts with the field."""

from dataclasses import replace

import numpy as np

from peaksim.camera.camera import Camera, from_sensor
from peaksim.camera.models import camera_named
from peaksim.camera.thin_lens import ThinLens, from_f_number
from peaksim.errors import SceneError
from peaksim.geometry.pose import look_at
from peaksim.geometry.trajectory import Trajectory
from peaksim.scene import schema as schema


def build_camera(table: schema.CameraTable) -> Camera:
    """Return the camera; focal length and principal point default to square pixels and the image centre."""
    base = _base_camera(table)
    own = {name: getattr(table, name) for name in ("fy", "cx", "cy") if getattr(table, name) is not None}
    built = replace(
        base,
        **own,
        distortion=table.distortion,
        model=table.model,
        row_time_s=table.row_time_s,
        exposure_s=table.exposure_s,
        thin_lens=_thin_lens(table),
    )
    return check_focal_length(built)


def check_focal_length(camera: Camera) -> Camera:
    """Return a camera from a file whose focal length can be one in px.

    Raises
    ------
    SceneError
        If its angle of view would be above 175°, or 360° for a fisheye: lengths in mm, or in image widths, give that.
    """
    most = np.pi if camera.model == "fisheye" else np.tan(np.deg2rad(87.5))
    for name, focal, size in (("fx", camera.fx, camera.width), ("fy", camera.fy, camera.height)):
        least = size / 2 / most
        if focal < least:
            raise SceneError(f"camera: {name}: expected px, at least {least:.3g} for {size} px, got {focal:g}")
    return camera


def _thin_lens(table: schema.CameraTable) -> ThinLens | None:
    if table.focus_m is None:
        return None
    if table.f_number is not None and table.focal_mm is not None:
        return from_f_number(table.focus_m, table.focal_mm, table.f_number)
    return ThinLens(table.focus_m, table.aperture_m or 0.0)


def _base_camera(table: schema.CameraTable) -> Camera:
    """Return the pinhole with square pixels and centred principal point that a table describes."""
    if table.name is not None:
        return camera_named(table.name, table.focal_mm)
    width, height = table.width or 1, table.height or 1
    if table.focal_mm is not None and table.sensor_width_mm is not None:
        return from_sensor(width, height, table.focal_mm, table.sensor_width_mm)
    focal = table.fx or 1.0
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def build_trajectory(tables: tuple[schema.WaypointTable, ...]) -> Trajectory:
    """Return the camera's trajectory through the waypoints."""
    poses = []
    for i, table in enumerate(tables):
        try:
            poses.append(look_at(table.eye_m, table.target_m))
        except SceneError as error:
            raise SceneError(f"trajectory[{i}]: {error}") from error
    return Trajectory(np.array([table.time_s for table in tables]), np.stack(poses))


def check_camera(tables: tuple[schema.WaypointTable, ...], room: schema.RoomTable | None) -> None:
    """Refuse a camera outside the room, for instance under its floor."""
    for i, table in enumerate(tables):
        if room is not None and not (np.less(room.min_m, table.eye_m) & np.less(table.eye_m, room.max_m)).all():
            raise SceneError(
                f"trajectory[{i}].eye_m: expected a point inside the room "
                f"{list(room.min_m)}…{list(room.max_m)}, got {list(table.eye_m)}"
            )
