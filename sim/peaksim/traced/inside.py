"""Lights that are shut in: they would light the inside of a solid that nobody sees."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.area.rays import build_tree, first_faces
from peaksim.errors import SceneError
from peaksim.scene.lamps import AreaLight
from peaksim.scene.scene import Light, Scene

_DIRECTIONS = np.array([[1.0, 0.011, 0.023], [0.017, 1.0, 0.013], [0.019, 0.007, 1.0]])
"""Near the axes, but along no side of a box."""


def check_lights(scene: Scene, eye_m: NDArray[np.float64]) -> None:
    """Refuse lights inside a closed mesh that the camera is outside of.

    Raises
    ------
    SceneError
        One line that names the light and the mesh.
    """
    for k, light in enumerate(scene.lights):
        if isinstance(light, AreaLight):
            position = light.world_from_light[:3, 3]
        elif isinstance(light, Light) and light.kind == "point" and light.casts_shadows:
            position = np.asarray(light.position_m)
        else:
            continue
        for mesh in scene.meshes:
            if is_inside(mesh.triangles_m, position) and not is_inside(mesh.triangles_m, eye_m):
                raise SceneError(f"lights[{k}]: expected a light outside of mesh {mesh.name!r}, got one inside it")


def is_inside_many(triangles_m: NDArray[np.float64], points_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (n,) whether rays from points in six directions all meet (m, 3, 3) triangles from within.

    For closed meshes of many faces, this is `is_inside` in far less time.
    """
    solids = build_tree(triangles_m, np.zeros(len(triangles_m), dtype=bool), np.arange(len(triangles_m)))
    normals = np.cross(triangles_m[:, 1] - triangles_m[:, 0], triangles_m[:, 2] - triangles_m[:, 0])
    inside = np.arange(len(points_m))
    for direction in np.concatenate([_DIRECTIONS, -_DIRECTIONS]):
        rays = np.broadcast_to(direction, (len(inside), 3))
        found, _ = first_faces(solids, points_m[inside], rays)
        inside = inside[(found >= 0) & (normals[found] @ direction > 0)]
    return np.isin(np.arange(len(points_m)), inside)


def is_inside(triangles_m: NDArray[np.float64], points_m: ArrayLike) -> NDArray[np.bool_]:
    """Return whether (m, 3, 3) triangles wind around (…, 3) points: the sum of their solid angles is then ±4π.

    Van Oosterom and Strackee 1983, doi:10.1109/TBME.1983.325207.
    """
    a, b, c = np.moveaxis(triangles_m - np.asarray(points_m)[..., None, None, :], -2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=-1)
    below = la * lb * lc + (a * b).sum(axis=-1) * lc + (b * c).sum(axis=-1) * la + (c * a).sum(axis=-1) * lb
    return np.asarray(abs(np.arctan2(volume, below).sum(axis=-1)) > np.pi)
