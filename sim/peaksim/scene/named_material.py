"""The materials of a scene file by their names; each error starts with the field."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from peaksim.errors import SceneError
from peaksim.scene import schema as schema
from peaksim.scene.material import PRINT, Material

Materials = Mapping[str, Material]
PLAIN: Materials = MappingProxyType({})
"""No materials."""


def material_of(table: Any, materials: Materials, field: str) -> Material:
    """Return the material that a table names, `PRINT` if it names none."""
    if table.material is None:
        return PRINT
    if table.material not in materials:
        known = ", ".join(materials) or "the materials of the file"
        raise SceneError(f"{field}.material: expected one of {known}, got {table.material!r}")
    return materials[table.material]


def load_materials(tables: Mapping[str, schema.MaterialTable]) -> dict[str, Material]:
    """Return the materials of `[materials]`."""
    made = {}
    for name, table in tables.items():
        try:
            made[name] = Material(**table.model_dump())
        except SceneError as error:
            raise SceneError(f"materials.{name}: {error}") from error
    return made
