"""Wallpapers: the textures of a scene file, each of which covers surfaces of any size."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peaksim import shipped
from peaksim.errors import InputError, SceneError
from peaksim.image_file import read_image_8_bits
from peaksim.scene import schema as schema
from peaksim.scene.material import PRINT, Material
from peaksim.scene.named_material import PLAIN, Materials, material_of
from peaksim.scene.texture import Texture

_LARGEST_TEXTURE = 200_000_000  # texels of one papered surface, refused before they are made


class Paper:
    """A wallpaper: a photograph of known physical size, repeated by mirroring to cover any surface."""

    def __init__(self, photo: NDArray[np.uint8], photo_m: float, material: Material = PRINT) -> None:
        self.photo = photo
        self.material = material
        self.texels_per_m = photo.shape[1] / photo_m

    def cover_surface(self, size_m: tuple[float, float], name: str) -> Texture:
        """Return the texture of a surface of this width and height."""
        width, height = (max(1, round(side * self.texels_per_m)) for side in size_m)
        if width * height > _LARGEST_TEXTURE:
            raise SceneError(f"{name}: expected at most {_LARGEST_TEXTURE} texels, got {width}×{height}; raise photo_m")
        rows, columns = _mirrored(height, self.photo.shape[0]), _mirrored(width, self.photo.shape[1])
        return Texture.from_array(np.take(np.take(self.photo, columns, axis=1), rows, axis=0))


def _mirrored(length: int, period: int) -> NDArray[np.int64]:
    """Return `length` indices that run 0…period−1, back to 0, and so on."""
    phase = np.arange(length) % (2 * period)
    return np.minimum(phase, 2 * period - 1 - phase)


def load_textures(
    tables: Mapping[str, schema.TextureTable], variants: Mapping[str, str], folder: Path, materials: Materials = PLAIN
) -> dict[str, Paper]:
    """Read every texture table; `variants` picks among a texture's variants (default: the first)."""
    for name in variants:
        if name not in tables or not tables[name].variants:
            raise SceneError(f"textures.{name}: expected a texture with variants, the file has none")
    return {
        name: _load_texture(name, table, variants.get(name), folder, material_of(table, materials, f"textures.{name}"))
        for name, table in tables.items()
    }


def _load_texture(
    name: str, table: schema.TextureTable, variant: str | None, folder: Path, material: Material
) -> Paper:
    if table.level is not None:
        return Paper(np.full((1, 1), round(table.level), np.uint8), table.photo_m, material)
    field, file = f"textures.{name}.file", table.file
    if table.variants:
        variant = variant or next(iter(table.variants))
        if variant not in table.variants:
            raise SceneError(f"textures.{name}: expected one of {', '.join(table.variants)}, got {variant!r}")
        field, file = f"textures.{name}.variants.{variant}", table.variants[variant]
    photo = read_photo(shipped.file_beside(folder, str(file), field), field)
    return Paper(scale_contrast(photo, table.contrast, table.mean), table.photo_m, material)


def read_photo(path: Path, field: str) -> NDArray[np.uint8]:
    """Read an image file of 8 bits; errors start with the field that names it."""
    try:
        return read_image_8_bits(path)
    except InputError as error:
        raise SceneError(f"{field}: {error}") from error


def scale_contrast(photo: NDArray[np.uint8], contrast: float, mean: float | None) -> NDArray[np.uint8]:
    """Scale the deviations from the mean grey level by `contrast` and move the mean to `mean`."""
    own_mean = photo.mean(axis=(0, 1))
    levels = contrast * (photo - own_mean) + (own_mean if mean is None else mean)
    return np.asarray(np.clip(np.rint(levels), 0, 255), dtype=np.uint8)
