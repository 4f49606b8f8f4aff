"""The markers of a scene file as quads: each one alone, and those along paths; each error starts with the field."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peaksim import shipped
from peaksim.errors import SceneError
from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.pose import Pose, compose, rotation_about
from peaksim.scene import schema as schema
from peaksim.scene.build_quads import bend_of, quad_pose
from peaksim.scene.material import Material
from peaksim.scene.named_material import PLAIN, Materials, material_of
from peaksim.scene.paper import read_photo
from peaksim.scene.scene import Mark, Quad
from peaksim.scene.texture import Texture

_WHITE = 255


def marker_quads(
    markers: tuple[schema.MarkerTable, ...],
    paths: tuple[schema.MarkerPathTable, ...],
    room: schema.RoomTable | None,
    materials: Materials = PLAIN,
    folder: Path | None = None,
) -> Iterator[Quad]:
    """Yield every marker as a quad of white paper with the pattern in its middle; `folder` has those that are files."""
    for i, table in enumerate(markers):
        field = f"markers[{i}]"
        pose = quad_pose(table.normal, table.up, table.center_m, field)
        quad = _marker_quad(table.name, table, pose, field, material_of(table, materials, field), folder)
        quad = replace(quad, bend=bend_of(table, quad.size_m, field))
        yield check_inside(quad, room, f"{field}.center_m")
    for i, path in enumerate(paths):
        field = f"marker_paths[{i}]"
        material = material_of(path, materials, field)
        for j, pose in enumerate(path_poses(path)):
            quad = _marker_quad(f"{path.name}{j + 1:02d}", path, pose, field, material, folder)
            yield check_inside(quad, room, f"{field}.waypoints_m")


def _marker_quad(
    name: str,
    table: schema.MarkerTable | schema.MarkerPathTable,
    pose: Pose,
    field: str,
    material: Material,
    folder: Path | None,
) -> Quad:
    """Return the quad of one marker; its border is rounded to whole texels of the pattern."""
    pattern = marker_pattern(table.kind, f"{field}.kind", folder)
    texel_m = table.side_m / len(pattern)
    border = round(table.border_m / texel_m)
    side_m = (len(pattern) + 2 * border) * texel_m
    tile = _tile(pattern.tobytes(), pattern.shape, border)
    return Quad(name, tile, (side_m, side_m), pose, Mark(name, table.kind, table.side_m), material)


@lru_cache(maxsize=64)
def _tile(pattern: bytes, shape: tuple[int, ...], border: int) -> Texture:
    """Return a pattern with a white border of whole texels; equal markers share one texture."""
    edges = [(border, border), (border, border), (0, 0)][: len(shape)]
    return Texture.from_array(np.pad(np.frombuffer(pattern, np.uint8).reshape(shape), edges, constant_values=_WHITE))


def marker_pattern(kind: str, field: str, folder: Path | None = None) -> NDArray[np.uint8]:
    """Return the (side, side) image of a shipped marker, or of one's own: a square image in a folder, by its file."""
    known = _shipped_patterns()
    if kind in known:
        return _shipped_pattern(known[kind])
    if folder is None or "." not in kind:
        own = " or an image file" if folder is not None else ""
        raise SceneError(f"{field}: expected one of {', '.join(sorted(known))}{own}, got {kind!r}")
    pattern = read_photo(shipped.file_inside(folder, kind, field), field)
    if pattern.shape[0] != pattern.shape[1]:
        raise SceneError(f"{field}: expected a square image, got {pattern.shape[1]}×{pattern.shape[0]} in {kind!r}")
    return pattern


@lru_cache(maxsize=1)
def _shipped_patterns() -> dict[str, Path]:
    return {path.stem: path for path in (shipped.ASSETS / "markers").glob("*.png")}


@lru_cache(maxsize=64)
def _shipped_pattern(path: Path) -> NDArray[np.uint8]:
    """Return a marker's image, read-only: a scene may have thousands of one kind."""
    pattern = read_photo(path, path.name)
    pattern.setflags(write=False)
    return pattern


def path_poses(path: schema.MarkerPathTable) -> list[Pose]:
    """Return poses at equal arc lengths on a cubic spline through the waypoints, tops along the path."""
    curve = FloorPath(np.array(path.waypoints_m))
    arc = np.linspace(0, curve.length_m, path.count)
    return [
        compose(rotation_about("z", yaw_deg), [*xy, path.height_m])
        for xy, yaw_deg in zip(curve.at(arc), np.degrees(curve.heading_rad(arc)) - 90, strict=True)
    ]


def check_inside(quad: Quad, room: schema.RoomTable | None, field: str) -> Quad:
    """Return a quad with markers, refusing one outside the room."""
    if room is not None:
        corners = quad.panels_m.reshape(-1, 3)
        if not ((corners >= np.array(room.min_m) - 1e-9) & (corners <= np.array(room.max_m) + 1e-9)).all():
            center = ", ".join(f"{c:.3g}" for c in quad.world_from_quad[:3, 3])
            raise SceneError(
                f"{field}: expected markers inside the room {list(room.min_m)}…{list(room.max_m)}, "
                f"{quad.name!r} is at ({center})"
            )
    return quad
