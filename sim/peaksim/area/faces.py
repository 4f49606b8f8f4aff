"""Flat faces from a camera's pose: quads and triangles as projective maps of viewing directions.

A face maps a viewing direction d (camera frame) to p = m_p·d, q = m_q·d and w = m_w·d. With t the distance along d at
which the ray meets the plane, w = 1/t, and p/w and q/w are coordinates on the face: texels for a quad, barycentric for
a triangle. All are linear in d, so that face sides, depth order and intersections are straight cuts of a pixel.
"""

from functools import lru_cache
from math import prod
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.area.texture_sums import sums_shape, write_sums
from peaksim.scene.material import Material
from peaksim.scene.scene import Mesh, Quad, Scene
from peaksim.scene.texture import Texture

BACK_LEVEL = 128.0
"""Grey level of a quad from behind."""
START, STRIDE, PLANE, CONTRAST, EXTENT_P, EXTENT_Q, LEVEL, NORMAL = 0, 1, 2, 3, 4, 5, 6, 9
"""Columns of `Faces.table`."""
DEPTH = 4
"""Row of `FaceViews.sides` that is w."""
_EDGE_ON = 1e-12
"""Sine of the angle below which the camera lies in a face's plane."""


class Faces(NamedTuple):
    """All faces of a scene, world frame: quads first, then triangles in mesh order."""

    planes: NDArray[np.float64]
    """(f, 3, 3) where p/w = q/w = 0, one unit of p/w, and one unit of q/w; metres."""
    table: NDArray[np.float64]
    """(f, 12): START of the texture's table (−1 for none), STRIDE of its rows, PLANE between channels (0 for grey),
    CONTRAST; EXTENT_P and EXTENT_Q, where p/w and q/w end; three LEVELs of the unprinted face; NORMAL, unit."""
    texels: NDArray[np.float64]
    """Summed-area tables of all textures, one after another."""


class FaceViews(NamedTuple):
    """All faces from n poses: one, or one for each row of a rolling shutter."""

    sides: NDArray[np.float64]
    """(n, f, 5, 3) vectors m; a direction d meets the face where all five m·d ≥ 0. The first four are its sides (a
    triangle has three, and w again), of which the first two are p and q; the last is w. All zero where the camera
    lies in the plane."""
    printed: NDArray[np.bool_]
    """(n, f) whether the textured side faces the camera."""
    least: NDArray[np.float64]
    """(f,) w of the farthest corner, along a direction of unit length, from the first pose; metres⁻¹."""
    eyes: NDArray[np.float64]
    """(n, 3) camera centres, world, metres."""


def faces_of(scene: Scene) -> Faces:
    """Return the faces of a scene."""
    quads = np.array([_quad_plane(quad) for quad in scene.quads]).reshape(-1, 3, 3)
    triangles = triangles_m(scene.meshes)
    planes = np.concatenate([quads, triangles - triangles[:, :1] * [[0], [1], [1]]])
    table = np.ones((len(planes), 12))
    table[:, START : CONTRAST + 1] = (-1, 0, 0, 0)
    table[:, NORMAL:] = unit_normals(planes[:, 1], planes[:, 2])
    table[:, LEVEL:NORMAL] = BACK_LEVEL
    first = len(quads)
    for mesh in scene.meshes:
        table[first : first + len(mesh.faces), LEVEL:NORMAL] = mesh_levels(mesh, channels_of(scene))
        first += len(mesh.faces)
    prints = tuple(dict.fromkeys((q.texture, q.material) for q in scene.quads))
    texels, texture_rows = pack_textures(prints)
    for row, quad in zip(table, scene.quads, strict=False):
        row[: CONTRAST + 1] = texture_rows[prints.index((quad.texture, quad.material))]
        row[EXTENT_P : EXTENT_Q + 1] = quad.texture.size
    return Faces(np.ascontiguousarray(planes), table, texels)


def triangles_m(meshes: tuple[Mesh, ...]) -> NDArray[np.float64]:
    """Return the (m, 3, 3) world corners of all triangles, in mesh order."""
    return np.concatenate([np.zeros((0, 3, 3)), *(mesh.triangles_m for mesh in meshes)])


def _quad_plane(quad: Quad) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    top_left, top_right, _, bottom_left = quad.corners_m
    width, height = quad.texture.size
    return top_left, (top_right - top_left) / width, (bottom_left - top_left) / height


@lru_cache(maxsize=1)
def pack_textures(prints: tuple[tuple[Texture, Material], ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the tables of all printed textures in one buffer, and (t, 4) START, STRIDE, PLANE and CONTRAST of each."""
    levels = [material.levels(texture.pixels) for texture, material in prints]
    shapes = [sums_shape(pixels) for pixels in levels]
    starts = np.cumsum([0, *(prod(shape) for shape in shapes)])
    texels, rows = np.empty(starts[-1]), np.zeros((len(prints), 4))
    for pixels, shape, start, end, row in zip(levels, shapes, starts, starts[1:], rows, strict=False):
        write_sums(pixels, texels[start:end].reshape(shape))
        row[:] = start, shape[2], shape[1] * shape[2] if shape[0] == 3 else 0, contrast(pixels)
    return texels, rows


def contrast(levels: NDArray[Any]) -> float:
    """Return the standard deviation of (h, w) or (h, w, 3) grey levels, of the channel that varies most."""
    return float(cv2.meanStdDev(levels)[1].max())


def unit_normals(us: NDArray[np.float64], vs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit normals u × v, 0 where u and v are parallel."""
    normals = np.cross(us, vs)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def mesh_levels(mesh: Mesh, channels: int) -> NDArray[np.float64]:
    """Return a mesh's colour as `channels` linear grey levels (grey: Rec. 709 luma)."""
    color = np.asarray(mesh.material.levels(np.array(mesh.color, dtype=np.float64)), dtype=np.float64)
    return color if channels == 3 else np.array([color @ [0.2126, 0.7152, 0.0722]])


def channels_of(scene: Scene) -> int:
    """Return 3 if anything in the scene is coloured, else 1."""
    colored = any(q.texture.channels == 3 for q in scene.quads) or any(len(set(m.color)) > 1 for m in scene.meshes)
    return 3 if colored else 1


def view_faces(faces: Faces, poses: NDArray[np.float64]) -> FaceViews:
    """Return the faces from (n, 4, 4) `world_from_camera`."""
    dual_u, dual_v = _duals(faces.planes[:, 1], faces.planes[:, 2])
    normals = faces.table[:, NORMAL:]
    from_eye = faces.planes[:, 0] - poses[:, None, :3, 3]
    away = (from_eye * normals).sum(axis=2, keepdims=True)
    is_seen = np.abs(away) > _EDGE_ON * np.linalg.norm(from_eye, axis=2, keepdims=True)
    w = np.where(is_seen, normals / np.where(is_seen, away, 1.0), 0.0)
    p = np.where(is_seen, dual_u - (from_eye * dual_u).sum(axis=2, keepdims=True) * w, 0.0)
    q = np.where(is_seen, dual_v - (from_eye * dual_v).sum(axis=2, keepdims=True) * w, 0.0)
    extents = faces.table[:, EXTENT_P : EXTENT_Q + 1]
    is_quad = faces.table[:, START, None] >= 0
    far_p = np.where(is_quad, extents[:, :1] * w - p, w - p - q)
    far_q = np.where(is_quad, extents[:, 1:] * w - q, w)
    rotations = poses[:, None, :3, :3]
    # u × v of a quad points into the page, for v runs down
    return FaceViews(
        sides=np.stack([p, q, far_p, far_q, w], axis=2) @ rotations,
        printed=(away[:, :, 0] > 0) & is_quad[:, 0],
        least=1 / np.maximum(_farthest(faces, poses[0, :3, 3]), 1e-300),
        eyes=poses[:, :3, 3],
    )


def distance_range(faces: Faces, eye: NDArray[np.float64]) -> tuple[float, float]:
    """Return a lower bound of the distance of all faces, and the distance of the farthest corner, m; (inf, 0) if empty.

    The bound of a face is the larger one of the distances from its plane and from the ball around it.
    """
    corners = _corners(faces)
    middles = (corners[1] + corners[2]) / 2
    radii = np.linalg.norm(corners - middles, axis=2).max(axis=0)
    from_plane = np.abs(((faces.planes[:, 0] - eye) * faces.table[:, NORMAL:]).sum(axis=1))
    nearest = np.maximum(from_plane, np.linalg.norm(middles - eye, axis=1) - radii)
    return float(nearest.min(initial=np.inf)), float(_farthest(faces, eye).max(initial=0))


def _farthest(faces: Faces, eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (f,) distance of each face's farthest corner from a point, metres."""
    return np.asarray(np.linalg.norm(_corners(faces) - eye, axis=2).max(axis=0))


def _corners(faces: Faces) -> NDArray[np.float64]:
    """Return the (4, f, 3) corners: first one, ends of both sides, and the fourth, which repeats a triangle's first."""
    p, q = faces.table[:, EXTENT_P], faces.table[:, EXTENT_Q]
    is_quad = faces.table[:, START] >= 0
    return np.stack(
        [
            faces.planes[:, 0] + (a * p)[:, None] * faces.planes[:, 1] + (b * q)[:, None] * faces.planes[:, 2]
            for a, b in ((0, 0), (1, 0), (0, 1), (is_quad, is_quad))
        ]
    )


def _duals(us: NDArray[np.float64], vs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the in-plane vectors that measure coordinates along u and v."""
    uu, vv, uv = ((a * b).sum(axis=1, keepdims=True) for a, b in ((us, us), (vs, vs), (us, vs)))
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    return (vv * us - uv * vs) / det, (uu * vs - uv * us) / det
