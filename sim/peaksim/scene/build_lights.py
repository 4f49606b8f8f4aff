"""The lights of a scene file; each error starts with the field."""

from pathlib import Path

import numpy as np

from peaksim import shipped
from peaksim.errors import InputError, SceneError
from peaksim.image_file import read_image
from peaksim.scene import schema as schema
from peaksim.scene.lamps import WINDOW_RADIANCE, AreaLight, Environment
from peaksim.scene.material import linear_from_srgb
from peaksim.scene.scene import Light


def build_lights(tables: tuple[schema.AnyLightTable, ...], folder: Path) -> tuple[Light | AreaLight | Environment, ...]:
    """Return the lights; images of surroundings are looked for in `folder`, then among the assets."""
    return tuple(_light(table, folder, f"lights[{i}].file") for i, table in enumerate(tables))


def _light(table: schema.AnyLightTable, folder: Path, field: str) -> Light | AreaLight | Environment:
    if isinstance(table, schema.LightTable):
        return Light(**table.model_dump())
    if isinstance(table, schema.AreaLightTable):
        radiance = WINDOW_RADIANCE if table.radiance is None else table.radiance
        return AreaLight(table.center_m, table.size_m, radiance, table.normal, table.up)
    if table.file is None:
        return Environment(table.radiance, None, table.yaw_deg)
    path = shipped.file_beside(folder, table.file, field)
    try:
        image = read_image(path)
    except InputError as error:
        raise SceneError(f"{field}: {error}") from error
    shares = image / np.iinfo(image.dtype).max
    decoded = linear_from_srgb(shares) if table.curve == "srgb" else shares
    return Environment(table.radiance, decoded.astype(np.float32), table.yaw_deg)
