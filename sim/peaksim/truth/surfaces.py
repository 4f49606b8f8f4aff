"""The surface at each pixel's centre: depth, ids and normals, by one exact ray each."""

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import triangles_m, unit_normals
from peaksim.area.rays import first_faces, solids_of
from peaksim.camera.frame import Surfaces
from peaksim.camera.shutter import PosedCamera
from peaksim.scene.scene import Scene


def surfaces(scene: Scene, posed: PosedCamera) -> Surfaces:
    """Return depth, ids and normals at pixel centres."""
    return surfaces_at(scene, posed, posed.camera.pixel_centers())


def surfaces_at(scene: Scene, posed: PosedCamera, xy: NDArray[np.float64]) -> Surfaces:
    """Return depth, ids and normals at (h, w, 2) px."""
    shape = xy.shape[:2]
    poses, rays, world_rays = posed.rays(xy)
    faces, parameters = first_faces(solids_of(scene, quads=True), poses[:, :3, 3], world_rays)
    mesh_of_face = np.repeat(np.arange(len(scene.meshes)), [len(m.faces) for m in scene.meshes])
    quads, hit = len(scene.quads), faces >= 0
    mesh_ids = np.full(len(faces), -1, np.int32)
    mesh_ids[faces >= quads] = mesh_of_face[faces[faces >= quads] - quads]
    normals = np.zeros((len(faces), 3))
    normals[hit] = _normals(scene)[faces[hit]]
    normals = (normals[:, None, :] @ poses[:, :3, :3])[:, 0]
    normals *= -np.sign((normals * rays).sum(axis=1, keepdims=True))
    with np.errstate(invalid="ignore"):
        depths = np.where(hit, parameters * rays[:, 2], np.inf)
    return Surfaces(
        depth_m=depths.astype(np.float32).reshape(shape),
        quad_ids=np.where(faces < quads, faces, -1).astype(np.int32).reshape(shape),
        mesh_ids=mesh_ids.reshape(shape),
        normals=normals.astype(np.float32).reshape(*shape, 3),
    )


def _normals(scene: Scene) -> NDArray[np.float64]:
    """Return the (f, 3) unit normals of all faces, quads first, world frame."""
    triangles = triangles_m(scene.meshes)
    of_triangles = unit_normals(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.concatenate([np.array([q.world_from_quad[:3, 2] for q in scene.quads]).reshape(-1, 3), of_triangles])
