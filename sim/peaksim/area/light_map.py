"""Baked light, the multiplier of every face, path-traced once, as maps.

A map is bilinear between the centres of its texels. A pixel is the mean of the print times that of the light, which is
off only where both vary within it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.native import function


@dataclass(frozen=True, eq=False)
class LightMaps:
    """Multipliers of all faces of a scene, by the light that the exact renderer has not of its own."""

    shapes: NDArray[np.int64]
    """(f, 2, 2) rows and columns of each map; the first is that of the side that the face's normal points to."""
    texels: NDArray[np.float32]
    """(t, channels) multipliers, map after map, row by row along the face's own coordinates."""
    texel_m: float
    """Longest side of a texel, metres."""
    noise: float
    """Rms error by noise on white, grey levels, estimated from two halves of the samples."""
    detail: float
    """Rms error by the size of texels on white, grey levels: half of what doubling it would change."""


class PackedMaps(NamedTuple):
    """Light maps as tables for the kernels."""

    table: NDArray[np.int64]
    """(f, 2, 3) start, rows and columns of both maps of a face; (0, 2, 3) without maps."""
    texels: NDArray[np.float32]
    """(t, channels)."""


NO_MAPS = PackedMaps(np.zeros((0, 2, 3), np.int64), np.zeros((1, 1), np.float32))


def pack_maps(maps: LightMaps | None) -> PackedMaps:
    """Return light maps as tables for the kernels."""
    if maps is None:
        return NO_MAPS
    shapes = maps.shapes.reshape(-1, 2)
    sizes = shapes.prod(axis=1)
    table = np.column_stack([np.cumsum(sizes) - sizes, shapes])
    return PackedMaps(table.reshape(-1, 2, 3), maps.texels)


def split_maps(shapes: NDArray[np.int64], values: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Return the (h, w, channels) maps of (m, 2) shapes whose (t, channels) values lie one after another."""
    parts = np.split(values, np.cumsum(shapes.prod(axis=1))[:-1])
    return [part.reshape(*shape, -1) for part, shape in zip(parts, shapes, strict=True)]


light_owned_baked = function(
    "void light_owned_baked(const f8[rows,columns,3] rays, const f8[poses,faces,5,3] sides, "
    "const f8[faces,3,3] planes, const f8[faces,28] table, const f8[poses,3] eyes, const i8[faces,2,3] maps, "
    "const f4[n_texels,channels] texels, const i8[height,width] owners, const f8[height,width,channels] light, "
    "f4[height,width,channels] out)"
)
"""Multiply all pixels of a band that have an owner by the plain light on them plus the baked one.

rays, sides, owners
    As in `find_owners`.
planes, table, eyes
    As in `Faces` and `FaceViews`.
maps, texels
    As in `PackedMaps`.
light
    Multipliers of the plain light.
out
    Multiplied.
"""
