"""The boxes, desks and mesh files of a scene file as triangle meshes; each error starts with the field."""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from peaksim import shipped
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import compose, rotation_about
from peaksim.scene import schema as schema
from peaksim.scene.material import Material
from peaksim.scene.named_material import PLAIN, Materials, material_of
from peaksim.scene.scene import Mesh

_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
"""(8, 3) corners of a cube of side 1."""
_FACES = np.array(
    [
        *([1, 3, 0], [4, 1, 0], [0, 3, 2], [2, 4, 0], [1, 7, 3], [5, 1, 4]),
        *([5, 7, 1], [3, 7, 2], [6, 4, 2], [2, 7, 6], [6, 5, 4], [7, 5, 6]),
    ]
)
"""(12, 3) its triangles, counter-clockwise from outside."""


def build_meshes(
    boxes: tuple[schema.BoxTable, ...], tables: tuple[schema.DeskTable, ...], materials: Materials = PLAIN
) -> tuple[Mesh, ...]:
    """Return the boxes and desks as triangle meshes."""
    return (
        *(
            _mesh(
                table, [(table.size_m, (0.0, 0.0, table.size_m[2] / 2))], material_of(table, materials, f"boxes[{i}]")
            )
            for i, table in enumerate(boxes)
        ),
        *(
            _mesh(table, list(_desk_parts(table)), material_of(table, materials, f"tables[{i}]"))
            for i, table in enumerate(tables)
        ),
    )


def _desk_parts(table: schema.DeskTable) -> Iterator[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Yield (size, centre) of the top and the four legs, metres."""
    width, depth, height = table.size_m
    leg, leg_height = table.leg_m, height - table.top_m
    yield (width, depth, table.top_m), (0.0, 0.0, height - table.top_m / 2)
    for x in (-1, 1):
        for y in (-1, 1):
            yield (leg, leg, leg_height), (x * (width - leg) / 2, y * (depth - leg) / 2, leg_height / 2)


def _mesh(table: schema.BoxTable | schema.DeskTable, parts: list[tuple[Any, Any]], material: Material) -> Mesh:
    corners = np.concatenate([_CORNERS * size + center for size, center in parts])
    faces = np.concatenate([_FACES + k * len(_CORNERS) for k in range(len(parts))])
    pose = compose(rotation_about("z", table.yaw_deg), table.center_m)
    return Mesh(table.name, corners, faces, pose, (table.level,) * 3, material)


def file_meshes(tables: tuple[schema.MeshTable, ...], folder: Path, materials: Materials = PLAIN) -> Iterator[Mesh]:
    """Yield the meshes of `[[meshes]]`, from files in `folder` or below it, or else among the assets."""
    for i, table in enumerate(tables):
        field = f"meshes[{i}]"
        file = shipped.file_beside(folder, table.file, f"{field}.file")
        x, y, z = (rotation_about(axis, angle) for axis, angle in zip("xyz", table.rotation_deg, strict=True))
        try:
            yield Mesh.from_file(
                file,
                table.name,
                scale=table.scale,
                world_from_mesh=compose(z @ y @ x, table.center_m),
                material=material_of(table, materials, field),
                color=(table.level,) * 3,
                up=table.up,
            )
        except InputError as error:
            raise SceneError(f"{field}.file: {error}") from error
