"""Markers, images and sheets as paper, and paper put on walls, floors and boxes: one line of Python each."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, compose, rotation_about
from peaksim.scene.bend import Bend
from peaksim.scene.build_markers import marker_pattern
from peaksim.scene.material import PRINT, Material
from peaksim.scene.scene import Mark, Mesh, Quad, Scene
from peaksim.scene.sheet_file import read_sheet
from peaksim.scene.texture import Texture

GAP_M = 1e-3
"""Distance of paper from what it hangs on: every renderer tells them apart."""
_FLAT = np.cos(np.radians(1))


def marker(
    kind: str | Path,
    side_m: float,
    *,
    name: str | None = None,
    border_m: float = 0.0,
    material: Material = PRINT,
    bend: Bend | None = None,
) -> Quad:
    """Return one marker on white paper, lying on the world's origin.

    Parameters
    ----------
    kind
        A shipped marker such as "surf-dark", or a square image file.
    side_m, border_m
        Side of the pattern, and the white around it, rounded to whole texels, metres.
    name
        Of paper and marker; by default the kind.
    material, bend
        As in `Quad`.

    Raises
    ------
    SceneError, ImageError
        One line that names the argument.
    """
    own = Path(kind)
    pattern = marker_pattern(own.name if own.suffix else str(kind), "kind", own.parent if own.suffix else None)
    if not (np.isfinite([side_m, border_m]).all() and side_m > 0 and border_m >= 0):
        raise SceneError(f"marker: expected side_m > 0 and border_m ≥ 0, got {side_m!r} and {border_m!r}")
    border = round(border_m / side_m * len(pattern))
    edges = [(border, border), (border, border), (0, 0)][: pattern.ndim]
    paper_m = side_m * (1 + 2 * border / len(pattern))
    texture = Texture.from_array(np.pad(pattern, edges, constant_values=255))
    called = name or own.stem
    return Quad(called, texture, (paper_m, paper_m), np.eye(4), Mark(called, str(kind), side_m), material, bend)


def sheet(
    path: str | Path, page: int = 1, *, name: str = "sheet", material: Material = PRINT, bend: Bend | None = None
) -> Quad:
    """Return a page that `peakmark marker` printed, lying on the world's origin; its markers are NAME.m1 and so on.

    `path` is the sheet's result.json or its folder; the rest as in `read_sheet` and `marker`.

    Raises
    ------
    SceneError
        As `read_sheet`.
    """
    texture, size_m, marks = read_sheet(path, page)
    named = tuple(replace(mark, name=f"{name}.{mark.name}") for mark in marks)
    return Quad(name, texture, size_m, np.eye(4), named, material, bend)


def put_on(
    scene: Scene,
    paper: Quad,
    on: str,
    at_m: tuple[float, float] = (0.0, 0.0),
    *,
    facing: tuple[float, float, float] = (0.0, 0.0, 1.0),
    turn_deg: float = 0.0,
    gap_m: float = GAP_M,
) -> Scene:
    """Return a scene with paper put on one of its surfaces: `put_on(scene, marker("surf-dark", 0.1), "wall_x_min")`.

    Parameters
    ----------
    scene, paper
        What there is, and what is added; the paper's own pose does not count.
    on
        Name of a quad, such as "floor" and the walls of a room, or of a mesh.
    at_m
        Where on it the paper's middle is, from the surface's middle: right and up as the surface is seen upright, for
        level ones east (x) and north (y), metres.
    facing
        Of a mesh: the world direction that its side faces, by default its top.
    turn_deg
        Counter-clockwise rotation of the paper in its plane.
    gap_m
        Distance from the surface, ≥ 0.

    Raises
    ------
    SceneError
        If nothing is called so, or a mesh has no flat side that faces this direction.
    """
    surfaces: dict[str, Quad | Mesh] = {quad.name: quad for quad in scene.quads}
    surfaces |= {mesh.name: mesh for mesh in scene.meshes}
    if on not in surfaces:
        raise SceneError(f"on: expected one of {', '.join(surfaces) or 'the names of the scene'}, got {on!r}")
    if not (np.isfinite([*at_m, turn_deg, gap_m]).all() and gap_m >= 0):
        raise SceneError(f"put_on: expected finite numbers and gap_m ≥ 0, got {at_m}, {turn_deg}, {gap_m}")
    surface = surfaces[on]
    frame = _quad_frame(surface, at_m) if isinstance(surface, Quad) else _side_frame(surface, facing, at_m)
    pose = frame @ compose(rotation_about("z", turn_deg), [0.0, 0.0, gap_m])
    return replace(scene, quads=(*scene.quads, replace(paper, world_from_quad=pose)))


def _quad_frame(quad: Quad, at_m: tuple[float, float]) -> Pose:
    return compose(quad.rotation_at(at_m), quad.points_m([at_m])[0])


def _side_frame(mesh: Mesh, facing: tuple[float, float, float], at_m: tuple[float, float]) -> Pose:
    """Return the frame of a mesh's outermost flat side that faces a direction: x right, y up, z outwards."""
    triangles = mesh.triangles_m
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    towards = np.asarray(facing, dtype=np.float64)
    length = float(np.linalg.norm(towards))
    is_direction = bool(np.isfinite(length)) and length > 0
    faces = np.flatnonzero((normals @ towards > _FLAT * length) & is_direction)
    if len(faces) == 0:
        raise SceneError(f"on: expected a mesh with a flat side that faces {facing}, {mesh.name!r} has none")
    heights = triangles[faces].mean(axis=1) @ normals[faces[0]]
    outermost = faces[np.flatnonzero(heights > heights.max() - 1e-6)]
    axes = _upright(normals[outermost[0]])
    flat = triangles[outermost].reshape(-1, 3) @ axes
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2 + np.array([*at_m, 0.0])
    return compose(axes, axes @ middle)


def _upright(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (3, 3) directions right, up and normal, in columns; up is y where the normal is vertical."""
    up = np.array([0.0, 1.0, 0.0]) if abs(normal[2]) > _FLAT else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, normal)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(normal, right), normal], axis=1)
