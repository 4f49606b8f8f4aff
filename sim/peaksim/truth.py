"""Where everything truly is in a picture, from the camera's own projection and exact ray casting."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from peaksim.camera import Camera
from peaksim.frame import MarkerTruth, Surfaces
from peaksim.pose import Pose, invert, transform
from peaksim.scene import Mark, Quad, Scene, rectangle_m

if TYPE_CHECKING:
    from peaksim.rays import Solids

_SAMPLES = 48
"""Points along each side of a marker at which its visibility is asked: 2304 in all, an error of about 0.004."""


def marker_truth(scene: Scene, camera: Camera, world_from_camera: Pose) -> tuple[MarkerTruth, ...]:
    """Return one record a marker, in the scene's order."""
    from peaksim.rays import solids_of

    solids = solids_of(scene, quads=True)
    return tuple(
        _truth_of(camera, world_from_camera, solids, number, quad, mark)
        for number, quad in enumerate(scene.quads)
        for mark in quad.marks
    )


def _truth_of(camera: Camera, pose: Pose, solids: "Solids", number: int, quad: Quad, mark: Mark) -> MarkerTruth:
    corners = rectangle_m(quad, mark.center_m, (mark.side_m, mark.side_m))
    center = corners.mean(axis=0)
    in_camera = invert(pose)
    ray = pose[:3, 3] - center
    distance = float(np.linalg.norm(ray))
    cosine = float(quad.world_from_quad[:3, 2] @ ray) / distance
    corners_xy = camera.project(transform(in_camera, corners))
    return MarkerTruth(
        name=mark.name,
        kind=mark.kind,
        center_xy=camera.project(transform(in_camera, center))[0],
        corners_xy=corners_xy,
        side_px=float(np.sqrt(abs(polygon_area(corners_xy)))),
        distance_m=distance,
        tilt_deg=float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
        visible_fraction=visible_fraction(camera, pose, solids, number, corners)
        if cosine > 0 and _may_be_seen(camera, transform(in_camera, corners), corners_xy)
        else 0.0,
    )


def _may_be_seen(camera: Camera, corners: NDArray[np.float64], corners_xy: NDArray[np.float64]) -> bool:
    """Return False for a rectangle that is surely out of view: a cheap test that spares most markers the exact one.

    Between corners that are seen, a lens bends an edge by less than the rectangle is large.
    """
    if camera.model == "brown" and (corners[:, 2] <= 0).all():
        return False
    if not np.isfinite(corners_xy).all():
        return True
    low, high = corners_xy.min(axis=0), corners_xy.max(axis=0)
    reach = high - low + 1
    return bool((high + reach >= 0).all() and (low - reach <= [camera.width, camera.height]).all())


def polygon_area(corners_xy: NDArray[np.float64]) -> float:
    """Return the signed area of a polygon, px², positive if its corners run clockwise on the screen."""
    x, y = corners_xy.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def visible_fraction(camera: Camera, pose: Pose, solids: "Solids", number: int, corners: NDArray[np.float64]) -> float:
    """Return the share of a rectangle's image area that is inside the picture and in front of all else.

    The rectangle is sampled evenly; each sample counts by the image area that it stands for.
    """
    from peaksim.rays import first_faces

    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    points = corners[0] + u[:, None] * (corners[1] - corners[0]) + v[:, None] * (corners[3] - corners[0])
    in_camera = transform(invert(pose), points)
    xy = camera.project(in_camera)
    weights = _area_weights(camera, in_camera, transform(invert(pose), corners))
    inside = ((xy >= -0.5) & (xy <= [camera.width - 0.5, camera.height - 0.5])).all(axis=1)
    seen = np.zeros(len(points), dtype=bool)
    seen[inside] = first_faces(solids, pose[:3, 3], points[inside] - pose[:3, 3]) == number
    return float(weights[seen].sum() / total) if (total := weights.sum()) > 0 else 0.0


def _area_weights(camera: Camera, points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the image area, in any unit, of equal patches of a plane at (n, 3) points, camera frame."""
    step = 1e-4
    u, v = step * (corners[1] - corners[0]), step * (corners[3] - corners[0])
    along_u = camera.project(points + u) - camera.project(points - u)
    along_v = camera.project(points + v) - camera.project(points - v)
    return np.nan_to_num(np.abs(along_u[:, 0] * along_v[:, 1] - along_u[:, 1] * along_v[:, 0]))


def surfaces(scene: Scene, camera: Camera, world_from_camera: Pose) -> Surfaces:
    """Return depth, ids and normals at pixel centres, by one exact ray each."""
    from peaksim.rays import nearest_faces, solids_of

    x, y = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    faces, parameters = nearest_faces(
        solids_of(scene, quads=True), world_from_camera[:3, 3], rays @ world_from_camera[:3, :3].T
    )
    shape = (camera.height, camera.width)
    mesh_of_face = np.repeat(np.arange(len(scene.meshes)), [len(m.faces) for m in scene.meshes])
    quads, hit = len(scene.quads), faces >= 0
    mesh_ids = np.full(len(faces), -1, np.int32)
    mesh_ids[faces >= quads] = mesh_of_face[faces[faces >= quads] - quads]
    normals = np.zeros((len(faces), 3))
    normals[hit] = _normals(scene)[faces[hit]] @ world_from_camera[:3, :3]
    normals *= -np.sign((normals * rays).sum(axis=1, keepdims=True))
    return Surfaces(
        depth_m=(parameters * rays[:, 2]).astype(np.float32).reshape(shape),
        quad_ids=np.where(faces < quads, faces, -1).astype(np.int32).reshape(shape),
        mesh_ids=mesh_ids.reshape(shape),
        normals=normals.astype(np.float32).reshape(*shape, 3),
    )


def _normals(scene: Scene) -> NDArray[np.float64]:
    """Return the (f, 3) unit normals of all faces, quads first, world frame."""
    triangles = np.concatenate([np.zeros((0, 3, 3)), *(mesh.triangles_m for mesh in scene.meshes)])
    crossed = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    crossed /= np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-300)
    return np.concatenate([np.array([q.world_from_quad[:3, 2] for q in scene.quads]).reshape(-1, 3), crossed])
