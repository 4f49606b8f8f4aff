"""Where everything truly is in a picture, from the camera's own projection and exact ray casting."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from peaksim.camera import Camera
from peaksim.frame import MarkerTruth, Surfaces
from peaksim.pose import Pose, invert, transform
from peaksim.scene import Quad, Scene, rectangle_m

if TYPE_CHECKING:
    from peaksim.rays import Solids

_SAMPLES = 48
"""Points along each side of a marker at which its visibility is asked: 2304 in all, an error of about 0.004."""


def marker_truth(scene: Scene, camera: Camera, world_from_camera: Pose) -> tuple[MarkerTruth, ...]:
    """Return one record a marker, in the scene's order."""
    from peaksim.rays import solids_of

    solids, faces = solids_of(scene, quads=True), face_corners_m(scene)
    return tuple(
        truth
        for number, quad in enumerate(scene.quads)
        if quad.marks
        for truth in _truths_on(camera, world_from_camera, solids, faces, number, quad)
    )


def face_corners_m(scene: Scene) -> NDArray[np.float64]:
    """Return the (f, 4, 3) world corners of all faces, quads first; a triangle's last corner is repeated."""
    quads = [quad.corners_m[None] for quad in scene.quads]
    triangles = [mesh.triangles_m[:, [0, 1, 2, 2]] for mesh in scene.meshes]
    return np.concatenate([np.zeros((0, 4, 3)), *quads, *triangles])


def _truths_on(
    camera: Camera, pose: Pose, solids: "Solids", faces: NDArray[np.float64], number: int, quad: Quad
) -> Iterator[MarkerTruth]:
    """Yield the truth of one quad's marks."""
    eye = pose[:3, 3]
    corners = np.array([rectangle_m(quad, mark.center_m, (mark.side_m, mark.side_m)) for mark in quad.marks])
    centers = corners.mean(axis=1)
    in_camera = transform(invert(pose), corners)
    corners_xy = camera.project(in_camera.reshape(-1, 3)).reshape(-1, 4, 2)
    centers_xy = camera.project(transform(invert(pose), centers))
    distances = np.linalg.norm(eye - centers, axis=1)
    cosines = (eye - centers) @ quad.world_from_quad[:3, 2] / distances
    tilts_deg = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    hidden = [cosine <= 0 or _is_outside(camera, *c) for cosine, *c in zip(cosines, in_camera, corners_xy, strict=True)]
    hiding = np.delete(faces, number, axis=0)[: 0 if all(hidden) else None]
    hiding = hiding[may_hide(eye, quad.corners_m, hiding)]
    for k, mark in enumerate(quad.marks):
        if hidden[k]:
            share = 0.0
        elif _is_inside(camera, corners_xy[k]) and not may_hide(eye, corners[k], hiding).any():
            share = 1.0
        else:
            share = visible_fraction(camera, pose, solids, number, corners[k])
        yield MarkerTruth(
            name=mark.name,
            kind=mark.kind,
            center_xy=centers_xy[k],
            corners_xy=corners_xy[k],
            side_px=float(np.sqrt(abs(polygon_area(corners_xy[k])))),
            distance_m=float(distances[k]),
            tilt_deg=float(tilts_deg[k]),
            visible_fraction=share,
        )


def _is_outside(camera: Camera, in_camera: NDArray[np.float64], corners_xy: NDArray[np.float64]) -> bool:
    """Return whether a rectangle is certainly not in the picture."""
    if camera.model == "brown" and bool((in_camera[:, 2] <= 0).all()):
        return True
    low, high, end = *_bounds(camera, corners_xy), np.array([camera.width, camera.height]) - 0.5
    return bool(np.any(high <= -0.5) or np.any(low >= end))


def _is_inside(camera: Camera, corners_xy: NDArray[np.float64]) -> bool:
    """Return whether a rectangle is certainly wholly in the picture."""
    low, high, end = *_bounds(camera, corners_xy), np.array([camera.width, camera.height]) - 0.5
    return bool(np.all(low >= -0.5) and np.all(high <= end))


def _bounds(camera: Camera, corners_xy: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the upper left and lower right of a box around a rectangle's picture; nan where that is not certain.

    A lens bends the sides of a rectangle that is small in the picture by far less than a quarter of its diameter.
    """
    low, high = corners_xy.min(axis=0), corners_xy.max(axis=0)
    if camera.is_pinhole:
        return low, high
    diameter = float(np.hypot(*(high - low)))
    slack = 0.25 * diameter if diameter < min(camera.width, camera.height) / 2 else np.nan
    return low - slack, high + slack


def may_hide(
    eye_m: NDArray[np.float64], corners_m: NDArray[np.float64], faces: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (f,) whether each of (f, 4, 3) faces may lie between the eye and a rectangle (4, 3): False is certain.

    A face cannot if it is wholly on the outer side of one of the four planes through the eye and a side of the
    rectangle, or wholly behind the rectangle, or if its own plane has eye and rectangle on one side.
    """
    if len(faces) == 0:
        return np.zeros(0, dtype=bool)
    rays = corners_m - eye_m
    inwards = _cross(rays, rays[[1, 2, 3, 0]])
    inwards *= np.sign(inwards @ rays.mean(axis=0))[:, None]
    beyond = np.any(np.all((faces - eye_m) @ inwards.T < 0, axis=1), axis=1)
    normal = _cross(corners_m[1] - corners_m[0], corners_m[3] - corners_m[0])
    normal *= -np.sign(normal @ rays[0])
    behind = ((faces - corners_m[0]) @ normal < -1e-9 * np.linalg.norm(normal)).all(axis=1)
    planes = _cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    sides = (np.vstack([corners_m, eye_m]) - faces[:, :1]) @ planes[:, :, None]
    least = 1e-9 * np.linalg.norm(planes, axis=1)[:, None]
    apart = (sides[:, :, 0] > least).all(axis=1) | (sides[:, :, 0] < -least).all(axis=1)
    return np.asarray(~beyond & ~behind & ~apart)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products of (..., 3) vectors; several times faster than NumPy's for a few of them."""
    x, y, z = np.moveaxis(a, -1, 0)
    u, v, w = np.moveaxis(b, -1, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def polygon_area(corners_xy: NDArray[np.float64]) -> float:
    """Return the signed area of a polygon, px², positive if its corners run clockwise on the screen."""
    (x, y), (next_x, next_y) = corners_xy.T, np.concatenate([corners_xy[1:], corners_xy[:1]]).T
    return float((x * next_y - next_x * y).sum() / 2)


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
    seen[inside] = first_faces(solids, pose[:3, 3], points[inside] - pose[:3, 3])[0] == number
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
    from peaksim.rays import first_faces, solids_of

    x, y = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    faces, parameters = first_faces(
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
