"""The surface at each pixel's centre: depth, ids and normals, by one exact ray each."""

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import panel_counts, panels_m, triangles_m, unit_normals
from peaksim.area.rays import first_faces, solids_of
from peaksim.camera.frame import Surfaces
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.pose import invert, transform
from peaksim.scene.scene import Quad, Scene


def surfaces(scene: Scene, posed: PosedCamera) -> Surfaces:
    """Return depth, ids and normals at pixel centres."""
    return surfaces_at(scene, posed, posed.camera.pixel_centers())


def surfaces_at(scene: Scene, posed: PosedCamera, xy: NDArray[np.float64]) -> Surfaces:
    """Return depth, ids and normals at (h, w, 2) px."""
    shape = xy.shape[:2]
    poses, rays, world_rays = posed.rays(xy)
    faces, parameters = first_faces(solids_of(scene, quads=True), poses[:, :3, 3], world_rays)
    counts, hit = panel_counts(scene.quads), faces >= 0
    quad_of_face = np.repeat(np.arange(len(counts)), counts)
    mesh_of_face = np.repeat(np.arange(len(scene.meshes)), [len(m.faces) for m in scene.meshes])
    # the last one is that of no face
    quad_ids = np.concatenate([quad_of_face, np.full(len(mesh_of_face) + 1, -1)])[faces]
    mesh_ids = np.concatenate([np.full(len(quad_of_face), -1), mesh_of_face, [-1]])[faces]
    normals = np.zeros((len(faces), 3))
    normals[hit] = _normals(scene)[faces[hit]]
    for k, quad in enumerate(scene.quads):
        if quad.bend is not None and (some := quad_ids == k).any():
            origins = np.broadcast_to(poses[:, :3, 3], world_rays.shape)[some]
            normals[some] = normals_near(quad, origins + parameters[some, None] * world_rays[some])
    normals = (normals[:, None, :] @ poses[:, :3, :3])[:, 0]
    normals *= -np.sign((normals * rays).sum(axis=1, keepdims=True))
    with np.errstate(invalid="ignore"):
        depths = np.where(hit, parameters * rays[:, 2], np.inf)
    return Surfaces(
        depth_m=depths.astype(np.float32).reshape(shape),
        quad_ids=quad_ids.astype(np.int32).reshape(shape),
        mesh_ids=mesh_ids.astype(np.int32).reshape(shape),
        normals=normals.astype(np.float32).reshape(*shape, 3),
    )


def normals_near(quad: Quad, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n, 3) normals of a bent quad at (n, 3) world points near it."""
    assert quad.bend is not None
    along, radius = quad.bend.along, quad.bend.radius_m
    local = transform(invert(quad.world_from_quad), points_m)
    xy = np.zeros((len(local), 2))
    angles = np.arctan2(np.sign(radius) * local[:, along], np.sign(radius) * (local[:, 2] + radius))
    xy[:, along] = radius * angles
    return quad.normals_at(xy)


def _normals(scene: Scene) -> NDArray[np.float64]:
    """Return the (f, 3) unit normals of all faces, panels first, world frame."""
    corners = np.concatenate([panels_m(scene.quads)[:, [3, 1, 0]], triangles_m(scene.meshes)])
    return unit_normals(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
