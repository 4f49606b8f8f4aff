"""Flat faces from a camera's pose: quads and triangles as projective maps of viewing directions.

A face maps a viewing direction d (camera frame) to p = m_p·d, q = m_q·d and w = m_w·d. With t the distance along d at
which the ray meets the plane, w = 1/t, and p/w and q/w are coordinates on the face: texels for a quad, barycentric for
a triangle. All are linear in d, so that face sides, depth order and intersections are straight cuts of a pixel. A
linear map leads from these coordinates to those of the face's texture.
"""

from math import prod
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.area.texel_memory import empty_texels
from peaksim.area.texture_sums import sums_shape, write_sums
from peaksim.keep_last import keep_last
from peaksim.scene.material import LUMA, Material
from peaksim.scene.scene import Mesh, Quad, Scene
from peaksim.scene.texture import Texture

BACK_LEVEL = 128.0
"""Grey level of a quad from behind."""
START, STRIDE, PLANE, CONTRAST, EXTENT_P, EXTENT_Q, LEVEL, NORMAL = 0, 1, 2, 3, 4, 5, 6, 9
MAP, SLOPE, IS_SLOPED, IS_QUAD, EXTENT_U, EXTENT_V, COLUMNS = 12, 18, 24, 25, 26, 27, 28
"""Columns of `Faces.table`."""
DEPTH = 4
"""Row of `FaceViews.sides` that is w."""
Print = tuple[Texture, Material]
"""What is printed, and on what."""
_FLAT = 1e-5
"""Ratio of area to squared length below which a triangle on a texture is a line."""
_POINT = 0.02
"""Texels below which it is a point."""
_EDGE_ON = 1e-12
"""Sine of the angle below which the camera lies in a face's plane."""


class Faces(NamedTuple):
    """All faces of a scene, world frame: the panels of quads first, then triangles in mesh order."""

    planes: NDArray[np.float64]
    """(f, 3, 3) where p/w = q/w = 0, one unit of p/w, and one unit of q/w; metres."""
    table: NDArray[np.float64]
    """(f, COLUMNS): START of the texture's table (−1: none), STRIDE of its rows, PLANE between channels (0 for grey),
    CONTRAST; EXTENT_P and EXTENT_Q, where p/w and q/w end; three LEVELs of the unprinted face where p = q = 0; NORMAL,
    unit; MAP, two rows of three, from (1, p/w, q/w) to texels; SLOPE of the three levels along p/w and q/w, and 1 for
    IS_SLOPED if any is not 0; 1 for IS_QUAD, printed on one side only; EXTENT_U and EXTENT_V of the texture, texels."""
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
    rotations: NDArray[np.float64]
    """(n, 3, 3) from camera to world."""


def faces_of(scene: Scene) -> Faces:
    """Return the faces of a scene."""
    return _faces(scene.quads, scene.meshes, channels_of(scene))


@keep_last
def _faces(quads: tuple[Quad, ...], meshes: tuple[Mesh, ...], channels: int) -> Faces:
    """Return the faces; frames of one scene share them, whatever their lights."""
    prints = _prints(quads, meshes)
    texels, texture_rows = pack_textures(prints)
    rows = dict(zip(prints, texture_rows, strict=True))
    parts = [_quad_faces(quads, rows), *(_mesh_faces(mesh, rows, channels) for mesh in meshes)]
    planes, table = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    table[:, NORMAL : NORMAL + 3] = unit_normals(planes[:, 1], planes[:, 2])
    return Faces(planes, table, texels)


def triangles_m(meshes: tuple[Mesh, ...]) -> NDArray[np.float64]:
    """Return the (m, 3, 3) world corners of all triangles, in mesh order."""
    return np.concatenate([np.zeros((0, 3, 3)), *(mesh.triangles_m for mesh in meshes)])


def panels_m(quads: tuple[Quad, ...]) -> NDArray[np.float64]:
    """Return the (p, 4, 3) world corners of the panels of all quads: the first p faces of a scene."""
    return np.concatenate([np.zeros((0, 4, 3)), *(quad.panels_m for quad in quads)])


def panel_counts(quads: tuple[Quad, ...]) -> NDArray[np.int64]:
    """Return the (q,) number of panels of each quad."""
    return np.array([len(quad.panels_m) for quad in quads], dtype=np.int64)


def count_faces(scene: Scene) -> int:
    """Return how many faces a scene has: panels and triangles."""
    return int(panel_counts(scene.quads).sum()) + sum(len(mesh.faces) for mesh in scene.meshes)


def _prints(quads: tuple[Quad, ...], meshes: tuple[Mesh, ...]) -> tuple[Print, ...]:
    """Return every texture with its material, once."""
    of_meshes = [(t, mesh.material) for mesh in meshes if mesh.skin is not None for t in mesh.skin.textures]
    return tuple(dict.fromkeys([*((quad.texture, quad.material) for quad in quads), *of_meshes]))


def _quad_faces(
    quads: tuple[Quad, ...], texture_rows: dict[Print, NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (p, 3, 3) planes and (p, COLUMNS) table rows of the panels, equal shares of each quad's texture."""
    corners, counts = panels_m(quads), panel_counts(quads)
    quad = np.repeat(np.arange(len(quads)), counts)
    number = np.arange(len(quad)) - np.repeat(np.cumsum(counts) - counts, counts)
    whole = np.array([q.texture.size for q in quads], dtype=np.float64).reshape(-1, 2)[quad]
    is_down = np.array([q.bend is not None and q.bend.along == 1 for q in quads], dtype=bool)[quad]
    sizes = whole / np.where(is_down[:, None] == [False, True], counts[quad, None], 1)
    sides = (corners[:, [1, 3]] - corners[:, :1]) / sizes[:, :, None]
    planes = np.concatenate([corners[:, :1], sides], axis=1)
    table = np.zeros((len(quad), COLUMNS))
    table[:, : CONTRAST + 1] = np.array([texture_rows[q.texture, q.material] for q in quads]).reshape(-1, 4)[quad]
    table[:, EXTENT_P : EXTENT_Q + 1] = sizes
    table[:, LEVEL:NORMAL] = BACK_LEVEL
    table[:, MAP : MAP + 6] = 0, 1, 0, 0, 0, 1
    table[:, MAP] = np.where(is_down, 0, number * sizes[:, 0])
    table[:, MAP + 3] = np.where(is_down, number * sizes[:, 1], 0)
    table[:, IS_QUAD] = 1
    table[:, EXTENT_U : EXTENT_V + 1] = whole
    return planes, table


def _mesh_faces(
    mesh: Mesh, texture_rows: dict[Print, NDArray[np.float64]], channels: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n, 3, 3) planes and (n, COLUMNS) table rows of a mesh's triangles."""
    corners, n = mesh.triangles_m, len(mesh.faces)
    planes = corners - corners[:, :1] * [[0], [1], [1]]
    table = np.zeros((n, COLUMNS))
    table[:, : CONTRAST + 1] = (-1, 0, 0, 0)
    table[:, EXTENT_P : EXTENT_Q + 1] = 1
    table[:, LEVEL:NORMAL] = mesh_levels(mesh, channels)
    skin = mesh.skin
    if skin is not None and skin.colors is not None:
        _set_levels(table, np.arange(n), corner_levels(skin.colors, mesh.material, channels))
    if skin is not None and skin.uv is not None:
        numbers = skin.textured(n)
        for k, texture in enumerate(skin.textures):
            rows = np.flatnonzero(numbers == k)
            texels = np.stack([skin.uv[rows, :, 0], 1 - skin.uv[rows, :, 1]], axis=-1) * texture.size
            flat = _is_flat(texels)
            printed = table[rows[~flat]]
            printed[:, : CONTRAST + 1] = texture_rows[texture, mesh.material]
            printed[:, MAP : MAP + 6] = _linear_map(texels[~flat])
            printed[:, EXTENT_U : EXTENT_V + 1] = texture.size
            table[rows[~flat]] = printed
            _set_levels(table, rows[flat], texture_at(texture, mesh.material, texels[flat], channels))
    return planes, table


def _set_levels(table: NDArray[np.float64], rows: NDArray[np.intp], levels: NDArray[np.float64]) -> None:
    """Write the (r, 3, channels) levels at the corners of some triangles to their rows of a table."""
    slopes = levels[:, 1:] - levels[:, :1]
    table[rows, LEVEL : LEVEL + levels.shape[2]] = levels[:, 0]
    table[rows, SLOPE : SLOPE + 2 * levels.shape[2]] = np.swapaxes(slopes, 1, 2).reshape(len(rows), 2 * levels.shape[2])
    table[rows, IS_SLOPED] = (slopes != 0).any(axis=(1, 2))


def _is_flat(texels: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of (n, 3, 2) triangles on a texture are lines or points: their levels are linear between corners."""
    (u1, v1), (u2, v2) = (np.moveaxis(texels[:, k] - texels[:, 0], 1, 0) for k in (1, 2))
    reach = np.abs(texels - texels[:, :1]).max(axis=(1, 2), initial=0)
    return np.asarray((np.abs(u1 * v2 - u2 * v1) <= _FLAT * reach**2) | (reach < _POINT))


def texture_at(texture: Texture, material: Material, texels: NDArray[np.float64], channels: int) -> NDArray[np.float64]:
    """Return the (…, channels) levels of a texture at (…, 2) texels: bilinear between their middles."""
    width, height = texture.size
    x, y = np.clip(texels[..., 0] - 0.5, 0, width - 1), np.clip(texels[..., 1] - 0.5, 0, height - 1)
    i, j = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    f, g = (x - i)[..., None], (y - j)[..., None]
    right, below = np.minimum(i + 1, width - 1), np.minimum(j + 1, height - 1)
    pixels = np.atleast_3d(texture.pixels)
    corners = (material.levels(pixels[b, a]) for a, b in ((i, j), (right, j), (i, below), (right, below)))
    a, b, c, d = (np.asarray(levels, dtype=np.float64) for levels in corners)
    mean = (1 - g) * ((1 - f) * a + f * b) + g * ((1 - f) * c + f * d)
    if mean.shape[-1] == channels:
        return np.asarray(mean)
    return np.repeat(mean, 3, axis=-1)


def _linear_map(texels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n, 6) MAP of triangles with (n, 3, 2) corners on a texture, texels."""
    return np.concatenate([texels[:, :1], texels[:, 1:] - texels[:, :1]], axis=1).swapaxes(1, 2).reshape(-1, 6)


@keep_last
def pack_textures(prints: tuple[Print, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the tables of all printed textures in one buffer, and (t, 4) START, STRIDE, PLANE and CONTRAST of each."""
    levels = [material.levels(texture.pixels) for texture, material in prints]
    shapes = [sums_shape(pixels) for pixels in levels]
    starts = np.cumsum([0, *(prod(shape) for shape in shapes)])
    texels, rows = empty_texels(int(starts[-1]) + 1), np.zeros((len(prints), 4))
    texels[-1] = 0  # kernels read three of four texels
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
    return corner_levels(np.array(mesh.color, dtype=np.float64), mesh.material, channels)


def corner_levels(colors: NDArray[np.float64], material: Material, channels: int) -> NDArray[np.float64]:
    """Return (…, 3) printed RGB levels as (…, channels) that show (grey: Rec. 709 luma)."""
    shown = np.asarray(material.levels(colors), dtype=np.float64)
    return shown if channels == 3 else np.asarray(shown @ LUMA)


def channels_of(scene: Scene) -> int:
    """Return 3 if anything in the scene is coloured, else 1."""
    colored = any(q.texture.channels == 3 for q in scene.quads) or any(mesh.is_colored for mesh in scene.meshes)
    return 3 if colored else 1


def view_faces(faces: Faces, poses: NDArray[np.float64]) -> FaceViews:
    """Return the faces from (n, 4, 4) `world_from_camera`."""
    dual_u, dual_v = _duals(faces.planes[:, 1], faces.planes[:, 2])
    normals = faces.table[:, NORMAL : NORMAL + 3]
    from_eye = faces.planes[:, 0] - poses[:, None, :3, 3]
    away = (from_eye * normals).sum(axis=2, keepdims=True)
    is_seen = np.abs(away) > _EDGE_ON * np.linalg.norm(from_eye, axis=2, keepdims=True)
    w = np.where(is_seen, normals / np.where(is_seen, away, 1.0), 0.0)
    p = np.where(is_seen, dual_u - (from_eye * dual_u).sum(axis=2, keepdims=True) * w, 0.0)
    q = np.where(is_seen, dual_v - (from_eye * dual_v).sum(axis=2, keepdims=True) * w, 0.0)
    extents = faces.table[:, EXTENT_P : EXTENT_Q + 1]
    is_quad = faces.table[:, IS_QUAD, None] > 0
    is_textured = faces.table[:, START] >= 0
    far_p = np.where(is_quad, extents[:, :1] * w - p, w - p - q)
    far_q = np.where(is_quad, extents[:, 1:] * w - q, w)
    rotations = poses[:, None, :3, :3]
    # u × v of a quad points into the page, for v runs down
    return FaceViews(
        sides=np.stack([p, q, far_p, far_q, w], axis=2) @ rotations,
        printed=((away[:, :, 0] > 0) | ~is_quad[:, 0]) & is_textured,
        least=1 / np.maximum(_farthest(faces, poses[0, :3, 3]), 1e-300),
        eyes=poses[:, :3, 3],
        rotations=poses[:, :3, :3],
    )


def distance_range(faces: Faces, eye: NDArray[np.float64]) -> tuple[float, float]:
    """Return a lower bound of the distance of all faces, and the distance of the farthest corner, m; (inf, 0) if empty.

    The bound of a face is the larger one of the distances from its plane and from the ball around it.
    """
    corners = _corners(faces)
    middles = (corners[1] + corners[2]) / 2
    radii = np.linalg.norm(corners - middles, axis=2).max(axis=0)
    from_plane = np.abs(((faces.planes[:, 0] - eye) * faces.table[:, NORMAL : NORMAL + 3]).sum(axis=1))
    nearest = np.maximum(from_plane, np.linalg.norm(middles - eye, axis=1) - radii)
    return float(nearest.min(initial=np.inf)), float(_farthest(faces, eye).max(initial=0))


def _farthest(faces: Faces, eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (f,) distance of each face's farthest corner from a point, metres."""
    return np.asarray(np.linalg.norm(_corners(faces) - eye, axis=2).max(axis=0))


def _corners(faces: Faces) -> NDArray[np.float64]:
    """Return the (4, f, 3) corners: first one, ends of both sides, and the fourth, which repeats a triangle's first."""
    p, q = faces.table[:, EXTENT_P], faces.table[:, EXTENT_Q]
    is_quad = faces.table[:, IS_QUAD] > 0
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
