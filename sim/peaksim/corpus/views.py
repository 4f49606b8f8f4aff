"""The pose of the camera in each frame, from the three kinds of views."""

from collections.abc import Iterator
from typing import assert_never

import numpy as np

from peaksim.camera.camera import Camera, Points
from peaksim.corpus.draws import Draws
from peaksim.corpus.spec_views import AnyView, FlightView, MarkerView, RandomView
from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, compose, invert, look_at, rotation_about, transform
from peaksim.geometry.trajectory import Trajectory
from peaksim.scene.scene import Mark, Mesh, Quad, Scene

_ROOM_M = 0.02
"""The camera keeps this distance from walls and furniture."""


def random_view(view: RandomView, draws: Draws) -> Pose:
    """Return a pose in the view's box."""
    eye, target = (
        [draws.value(f"view.{name}.{axis}", spread) for axis, spread in zip("xyz", box, strict=True)]
        for name, box in (("eye", view.eye_m), ("target", view.target_m))
    )
    return roll_camera(look_at(eye, target), draws.value("view.roll_deg", view.roll_deg))


def marker_view(view: MarkerView, scene: Scene, camera: Camera, draws: Draws) -> Pose:
    """Return a pose that shows one of the scene's markers as the view states.

    Raises
    ------
    SceneError
        If the scene has no markers.
    """
    marks = list(marks_of(scene))
    if not marks:
        raise SceneError('views: expected a scene with markers for kind = "marker", this one has none')
    quad, mark = marks[draws.index("view.marker", (1.0,) * len(marks))]
    tilt, azimuth = (
        np.radians(draws.value(f"view.{name}", spread))
        for name, spread in (("tilt_deg", view.tilt_deg), ("azimuth_deg", view.azimuth_deg))
    )
    out = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    center, rotation = quad.points_m([mark.center_m])[0], quad.rotation_at(mark.center_m)
    eye = center + draws.value("view.distance_m", view.distance_m) * (rotation @ out)
    up = rotation[:, 1 if tilt < np.radians(1) else 2]
    head_on = roll_camera(look_at(eye, center, up), draws.value("view.roll_deg", view.roll_deg))
    return _aim_off_axis(
        head_on, camera, draws.value("view.off_axis", view.off_axis), draws.share("view.off_axis.turn")
    )


def _aim_off_axis(pose: Pose, camera: Camera, off_axis: float, direction: float) -> Pose:
    """Rotate a camera so that its axis projects to a share `off_axis` from the centre to the border.

    `direction` is a share of a full circle, clockwise from the right.
    """
    angle = 2 * np.pi * direction
    reach = off_axis * np.array([camera.width, camera.height]) / 2
    pixel = np.array([camera.width - 1, camera.height - 1]) / 2 + reach * [np.cos(angle), np.sin(angle)]
    ray = camera.unproject(pixel)[0]
    ray /= np.linalg.norm(ray)
    axis = np.array([0.0, 0.0, 1.0])
    # the shortest rotation that takes the ray to the axis (Rodrigues)
    v, c = np.cross(ray, axis), float(ray @ axis)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    shortest = np.eye(3) + cross + cross @ cross / (1 + c)
    return compose(pose[:3, :3] @ shortest, pose[:3, 3])


def flight_view(view: FlightView, trajectory: Trajectory, position: float, draws: Draws) -> tuple[Pose, float]:
    """Return the pose at a share `position` (0…1) of the trajectory's time, shaken, and its time in seconds."""
    time_s = float(trajectory.times_s[0] + position * trajectory.duration_s)
    pose = trajectory.at(time_s)
    shift = [draws.value(f"view.shift_m.{axis}", view.shift_m) for axis in "xyz"]
    for axis in "xyz":
        rotation = rotation_about(axis, draws.value(f"view.shake_deg.{axis}", view.shake_deg))
        pose = compose(pose[:3, :3] @ rotation, pose[:3, 3])
    return compose(pose[:3, :3], pose[:3, 3] + shift), time_s


def view_pose(
    view: AnyView, scene: Scene, camera: Camera, trajectory: Trajectory, position: float, draws: Draws
) -> tuple[Pose, float]:
    """Return a view's pose and time; the time of a still view is 0.

    Raises
    ------
    SceneError
        If the drawn numbers give no pose, such as an eye at its target.
    """
    if isinstance(view, FlightView):
        return flight_view(view, trajectory, position, draws)
    if isinstance(view, MarkerView):
        return marker_view(view, scene, camera, draws), 0.0
    if isinstance(view, RandomView):
        return random_view(view, draws), 0.0
    assert_never(view)


def roll_camera(pose: Pose, roll_deg: float) -> Pose:
    """Rotate a camera about its viewing axis."""
    return compose(pose[:3, :3] @ rotation_about("z", roll_deg), pose[:3, 3])


# --- requirements of a view --------------------------------------------------------------------------------


def marks_of(scene: Scene) -> Iterator[tuple[Quad, Mark]]:
    """Yield every marker with the quad that it is printed on."""
    return ((quad, mark) for quad in scene.quads for mark in quad.marks)


def markers_ahead(scene: Scene, camera: Camera, pose: Pose) -> int:
    """Count the markers that face the camera with their centre in the image, covered or not."""
    marks = list(marks_of(scene))
    if not marks:
        return 0
    centers = np.array([quad.points_m([mark.center_m])[0] for quad, mark in marks])
    normals = np.array([quad.normals_at([mark.center_m])[0] for quad, mark in marks])
    faces_us = ((pose[:3, 3] - centers) * normals).sum(axis=1) > 0
    xy = camera.project(transform(invert(pose), centers))
    return int((faces_us & camera.contains(xy)).sum())


def is_free(meshes: tuple[Mesh, ...], room: tuple[Points, Points] | None, pose: Pose) -> bool:
    """Return whether the camera is inside the room (opposite corners, m) and in no mesh's bounding box."""
    eye = pose[:3, 3]
    if room is not None and not ((eye > room[0] + _ROOM_M) & (eye < room[1] - _ROOM_M)).all():
        return False
    for mesh in meshes:
        corners = mesh.triangles_m.reshape(-1, 3)
        if ((eye > corners.min(axis=0) - _ROOM_M) & (eye < corners.max(axis=0) + _ROOM_M)).all():
            return False
    return True
