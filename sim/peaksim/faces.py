"""Flat faces as a camera sees them: quads and triangles as projective maps of viewing directions.

A face maps a viewing direction d (camera frame) to (p, q, w) = M d. With t the distance along d at which the ray
meets the plane, w = 1/t, p/w and q/w are coordinates on the face: texels for a quad, barycentric for a triangle.
All three are linear in d, so face edges, depth order and intersections are straight cuts of a pixel.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.scene import Mesh, Quad, Scene
from peaksim.texture import Texture

BACK_LEVEL = 128.0
"""Grey level of a quad from behind."""

QUAD, TRIANGLE = 0, 1
_EDGE_ON = 1e-12


class Faces(NamedTuple):
    """All faces of a scene, seen from n poses (one, or one a row of a rolling shutter)."""

    maps: NDArray[np.float64]
    """(n, f, 3, 3) camera direction → (p, q, w); all zero where the camera lies in the plane."""
    kinds: NDArray[np.int64]
    """(f,) QUAD or TRIANGLE."""
    extents: NDArray[np.float64]
    """(f, 2) a quad's p/w and q/w end here, texels; 1 for triangles."""
    textures: NDArray[np.int64]
    """(f,) index into the texture set, −1 for a plain level."""
    fronts: NDArray[np.bool_]
    """(n, f) whether the printed face is seen (always, for triangles)."""
    levels: NDArray[np.float64]
    """(f, c) plain grey levels."""
    normals: NDArray[np.float64]
    """(f, 3) unit normals, world."""


class Textures(NamedTuple):
    """The distinct textures of a scene in one buffer."""

    tables: NDArray[np.float64]
    """Summed-area tables, one after another."""
    places: NDArray[np.int64]
    """(t, 4) offset of the first table, its row length, distance between channels (0 for grey), height + 3."""
    contrasts: NDArray[np.float64]
    """(t,) standard deviations in grey levels."""


def pack_textures(distinct: tuple[Texture, ...]) -> Textures:
    """Return textures in one buffer."""
    tables = [t.tables for t in distinct]
    offsets = np.cumsum([0, *(t.size for t in tables)])[: len(tables)]
    places = [
        (offset, t.shape[2], t[0].size if len(t) == 3 else 0, t.shape[1])
        for offset, t in zip(offsets, tables, strict=True)
    ]
    buffer = tables[0].reshape(-1) if len(tables) == 1 else np.concatenate([np.zeros(0), *(t.ravel() for t in tables)])
    return Textures(buffer, np.array(places, dtype=np.int64).reshape(-1, 4), np.array([t.contrast for t in distinct]))


def distinct_textures(scene: Scene) -> tuple[tuple[Texture, ...], NDArray[np.int64]]:
    """Return the textures of a scene, each once, and every quad's index into them."""
    distinct = tuple({id(q.texture): q.texture for q in scene.quads}.values())
    index = {id(texture): k for k, texture in enumerate(distinct)}
    return distinct, np.array([index[id(q.texture)] for q in scene.quads], dtype=np.int64)


def see_faces(scene: Scene, textures: NDArray[np.int64], poses: NDArray[np.float64], channels: int) -> Faces:
    """Return the faces of `scene` from (n, 4, 4) `world_from_camera`; quads first, then triangles in mesh order."""
    origins, us, vs, extents = _planes(scene)
    normals = np.cross(us, vs)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    maps, away = _maps(origins, us, vs, normals, poses)
    n_quads = len(scene.quads)
    fronts = away > 0  # u × v of a quad points into the page: v runs down
    fronts[:, n_quads:] = True
    return Faces(
        maps=maps,
        kinds=np.repeat(np.array([QUAD, TRIANGLE]), [n_quads, len(origins) - n_quads]),
        extents=extents,
        textures=np.concatenate([textures, np.full(len(origins) - n_quads, -1)]),
        fronts=fronts,
        levels=_levels(scene, channels),
        normals=normals,
    )


def _planes(scene: Scene) -> tuple[NDArray[np.float64], ...]:
    """Return (f, 3) origin and the two edge vectors of one unit of p/w and q/w, and (f, 2) extents."""
    rows = [_quad_plane(quad) for quad in scene.quads]
    quads = np.array([r[:3] for r in rows]).reshape(-1, 3, 3)
    triangles = np.concatenate([np.zeros((0, 3, 3)), *(mesh.triangles_m for mesh in scene.meshes)])
    planes = np.concatenate([quads, triangles - triangles[:, :1] * [[0], [1], [1]]])
    extents = np.concatenate(
        [np.array([r[3] for r in rows], dtype=np.float64).reshape(-1, 2), np.ones((len(triangles), 2))]
    )
    return planes[:, 0], planes[:, 1], planes[:, 2], extents


def _quad_plane(quad: Quad) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], tuple[int, int]]:
    top_left, top_right, _, bottom_left = quad.corners_m
    width, height = quad.texture.size
    return top_left, (top_right - top_left) / width, (bottom_left - top_left) / height, (width, height)


def _maps(
    origins: NDArray[np.float64],
    us: NDArray[np.float64],
    vs: NDArray[np.float64],
    normals: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n, f, 3, 3) maps and (n, f) signed distance of the camera behind each plane along its normal."""
    dual_u, dual_v = _dual(us, vs)
    maps = np.zeros((len(poses), len(origins), 3, 3))
    away = np.zeros((len(poses), len(origins)))
    for k, pose in enumerate(poses):
        from_eye = origins - pose[:3, 3]
        away[k] = (from_eye * normals).sum(axis=1)
        size = np.linalg.norm(from_eye, axis=1)
        seen = np.abs(away[k]) > _EDGE_ON * np.maximum(size, 1e-300)
        w = normals[seen] / away[k, seen, None]
        p = dual_u[seen] - (from_eye[seen] * dual_u[seen]).sum(axis=1, keepdims=True) * w
        q = dual_v[seen] - (from_eye[seen] * dual_v[seen]).sum(axis=1, keepdims=True) * w
        maps[k, seen] = np.stack([p, q, w], axis=1) @ pose[:3, :3]
    return maps, away


def _dual(us: NDArray[np.float64], vs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the in-plane vectors that measure coordinates along u and v."""
    uu, vv, uv = (us * us).sum(1), (vs * vs).sum(1), (us * vs).sum(1)
    det = (uu * vv - uv * uv)[:, None]
    return (vv[:, None] * us - uv[:, None] * vs) / det, (uu[:, None] * vs - uv[:, None] * us) / det


def _levels(scene: Scene, channels: int) -> NDArray[np.float64]:
    """Return (f, channels) plain levels; a mesh's RGB becomes its luma in a grey picture."""
    quads = np.full((len(scene.quads), channels), BACK_LEVEL)
    meshes = [np.tile(mesh_levels(mesh, channels), (len(mesh.faces), 1)) for mesh in scene.meshes]
    return np.concatenate([quads, *meshes])


def mesh_levels(mesh: Mesh, channels: int) -> NDArray[np.float64]:
    """Return a mesh's colour as `channels` linear grey levels (grey: Rec. 709 luma)."""
    color = np.array(mesh.color, dtype=np.float64)
    return color if channels == 3 else np.array([color @ [0.2126, 0.7152, 0.0722]])


def channels_of(scene: Scene) -> int:
    """Return 3 if anything in the scene is coloured, else 1."""
    colored = any(q.texture.channels == 3 for q in scene.quads) or any(len(set(m.color)) > 1 for m in scene.meshes)
    return 3 if colored else 1
