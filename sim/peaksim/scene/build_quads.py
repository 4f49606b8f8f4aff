"""The flat surfaces of a scene file: its quads, and the papered faces of its room; each error starts with the field."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike

from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, compose
from peaksim.scene import schema as schema
from peaksim.scene.bend import Bend
from peaksim.scene.paper import Paper
from peaksim.scene.scene import Quad


def quad_pose(normal: ArrayLike, up: ArrayLike, center_m: ArrayLike, field: str) -> Pose:
    """Return `world_from_quad` of a quad whose printed face points along `normal` and whose top is towards `up`."""
    z = np.asarray(normal, dtype=np.float64)
    x = np.cross(np.asarray(up, dtype=np.float64), z)
    if not (np.linalg.norm(z) > 1e-9 and np.linalg.norm(x) > 1e-9):
        raise SceneError(f"{field}: expected normal and up that are not zero and not parallel, got {normal!r}, {up!r}")
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    return compose(np.stack([x, np.cross(z, x), z], axis=1), center_m)


def build_quads(tables: tuple[schema.QuadTable, ...], textures: Mapping[str, Paper]) -> Iterator[Quad]:
    """Yield the quads of `[[quads]]`."""
    for i, table in enumerate(tables):
        paper = _texture(textures, table.texture, f"quads[{i}].texture")
        texture = paper.cover_surface(table.size_m, f"quads[{i}].size_m")
        pose = quad_pose(table.normal, table.up, table.center_m, f"quads[{i}]")
        bend = bend_of(table, table.size_m, f"quads[{i}]")
        yield Quad(table.name, texture, table.size_m, pose, material=paper.material, bend=bend)


def bend_of(table: schema.BentTable, size_m: tuple[float, float], field: str) -> Bend | None:
    """Return how paper of this width and height is bent; None for flat."""
    return None if table.bend_radius_m is None else Bend(table.bend_radius_m, table.bend_axis).checked(size_m, field)


def _texture(textures: Mapping[str, Paper], name: str, field: str) -> Paper:
    if name not in textures:
        raise SceneError(f"{field}: expected one of {', '.join(textures) or 'the textures of the file'}, got {name!r}")
    return textures[name]


def room_quads(room: schema.RoomTable | None, textures: Mapping[str, Paper]) -> Iterator[Quad]:
    """Yield the papered faces of the room, printed side inwards."""
    if room is None:
        return
    low, high = np.array(room.min_m), np.array(room.max_m)
    middle, (width, depth, height) = (low + high) / 2, high - low
    walls = room.walls if isinstance(room.walls, tuple) else (room.walls,) * 4
    faces: list[tuple[str, str | None, str, tuple[float, float], list[float], list[float], list[float]]] = [
        ("floor", room.floor, "floor", (width, depth), [middle[0], middle[1], low[2]], [0, 0, 1], [0, 1, 0]),
        ("ceiling", room.ceiling, "ceiling", (width, depth), [middle[0], middle[1], high[2]], [0, 0, -1], [0, 1, 0]),
        ("wall_x_min", walls[0], "walls", (depth, height), [low[0], middle[1], middle[2]], [1, 0, 0], [0, 0, 1]),
        ("wall_x_max", walls[1], "walls", (depth, height), [high[0], middle[1], middle[2]], [-1, 0, 0], [0, 0, 1]),
        ("wall_y_min", walls[2], "walls", (width, height), [middle[0], low[1], middle[2]], [0, 1, 0], [0, 0, 1]),
        ("wall_y_max", walls[3], "walls", (width, height), [middle[0], high[1], middle[2]], [0, -1, 0], [0, 0, 1]),
    ]
    for name, texture, field, size_m, center_m, normal, up in faces:
        if texture is not None:
            paper = _texture(textures, texture, f"room.{field}")
            size = (float(size_m[0]), float(size_m[1]))
            pose = quad_pose(normal, up, center_m, f"room.{field}")
            yield Quad(name, paper.cover_surface(size, f"room.{field}"), size, pose, material=paper.material)
