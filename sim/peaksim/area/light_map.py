"""Kernels: baked light, the multiplier of every face, path-traced once, as maps.

A map is bilinear between the centres of its texels. A pixel is the mean of the print times that of the light, which is
off only where both vary within it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import EXTENT_P, EXTENT_Q, NORMAL
from peaksim.area.run import footprints
from peaksim.kernel import kernel, part

START, ROWS, COLUMNS = 0, 1, 2
"""Columns of `PackedMaps.table`."""
_MOST_SAMPLES = 8


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
    """(f, 2, 3) START, ROWS and COLUMNS of both maps of a face; (0, 2, 3) without maps."""
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


@part
def map_value(texels, first, rows, columns, u, v, channel):
    """Return a map that begins at `first` at (u, v) texels: bilinear between their middles, clamped at the border."""
    x, y = min(max(u - 0.5, 0.0), columns - 1.0), min(max(v - 0.5, 0.0), rows - 1.0)
    i, j = int(x), int(y)
    f, g = x - i, y - j
    here = first + j * columns + i
    below = here + columns * int(j + 1 < rows)
    right = int(i + 1 < columns)
    upper, lower = texels[here, channel], texels[below, channel]
    upper += f * (texels[here + right, channel] - upper)
    lower += f * (texels[below + right, channel] - lower)
    return upper + g * (lower - upper)


@part
def facing_side(planes, faces, face, eyes, pose):
    """Return which side of a face is seen: 0 for the one that its normal points to, else 1."""
    facing = 0.0
    for axis in range(3):
        facing += faces[face, NORMAL + axis] * (eyes[pose, axis] - planes[face, 0, axis])
    return int(facing < 0.0)


@part
def add_baked_piece(planes, faces, face, polygons, k, n, eyes, pose, table, texels, light):
    """Add to light (channels,) the mean of a map over n + 1 points of polygon k: its middle, and halfway to corners."""
    side = facing_side(planes, faces, face, eyes, pose)
    first, rows, columns = table[face, side, START], table[face, side, ROWS], table[face, side, COLUMNS]
    across, down = columns / faces[face, EXTENT_P], rows / faces[face, EXTENT_Q]
    u = v = 0.0
    for i in range(n):
        u += polygons[k, i, 0] * across / n
        v += polygons[k, i, 1] * down / n
    for channel in range(light.size):
        total = map_value(texels, first, rows, columns, u, v, channel)
        for i in range(n):
            ui, vi = 0.5 * (u + polygons[k, i, 0] * across), 0.5 * (v + polygons[k, i, 1] * down)
            total += map_value(texels, first, rows, columns, ui, vi, channel)
        light[channel] += total / (n + 1)


@part
def count_samples(corners, n, across, down):
    """Return columns and rows of samples a texel apart, or `_MOST_SAMPLES`, in the pixels of a run of n pixels."""
    wide = high = 0.0
    for j in range(2):
        k = (n - 1) * j
        u, v = corners[1, 0, k], corners[1, 1, k]
        wide = max(wide, max(abs(corners[1, 0, k + 1] - u) * across, abs(corners[1, 1, k + 1] - v) * down))
        high = max(high, max(abs(corners[0, 0, k] - u) * across, abs(corners[0, 1, k] - v) * down))
    return int(min(wide, _MOST_SAMPLES - 1)) + 1, int(min(high, _MOST_SAMPLES - 1)) + 1


@part
def light_run(texels, first, rows, columns, corners, n, wide, high, across, down, light, is_lit, out, y, x0):
    """Multiply a run of n pixels from x0 on by light, if it is lit at all, plus the mean of a map."""
    share = 1.0 / (wide * high)
    for channel in range(out.shape[2]):
        for k in range(n):
            total = 0.0
            for j in range(high):
                t = (j + 0.5) / high
                for i in range(wide):
                    s = (i + 0.5) / wide
                    a, b, c, d = (1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t
                    u = (
                        a * corners[0, 0, k]
                        + b * corners[0, 0, k + 1]
                        + c * corners[1, 0, k]
                        + d * corners[1, 0, k + 1]
                    )
                    v = (
                        a * corners[0, 1, k]
                        + b * corners[0, 1, k + 1]
                        + c * corners[1, 1, k]
                        + d * corners[1, 1, k + 1]
                    )
                    total += map_value(texels, first, rows, columns, u * across, v * down, channel)
            plain = light[y, x0 + k, channel] if is_lit else 0.0
            out[y, x0 + k, channel] *= plain + share * total


@kernel
def light_owned_baked(rays, sides, planes, faces, eyes, table, texels, owners, corners, light, out):
    """Multiply all pixels of a band that have an owner by baked light, and the light that is given.

    Parameters
    ----------
    rays, sides, owners, corners
        As in `fill_owned`.
    planes, faces, eyes
        As in `Faces` and `FaceViews`.
    table, texels
        As in `PackedMaps`.
    light
        (h, w, channels) multipliers that are added, or nothing.
    out
        (h, w, channels) multiplied.
    """
    for y in range(owners.shape[0]):
        pose, x = y if sides.shape[0] > 1 else 0, 0
        while x < owners.shape[1]:
            face, end, most = owners[y, x], x + 1, min(owners.shape[1], x + corners.shape[2] - 1)
            while end < most and owners[y, end] == face:
                end += 1
            if face >= 0:
                n = end - x
                footprints(sides, pose, face, rays, y, x, n, corners)
                side = facing_side(planes, faces, face, eyes, pose)
                first, rows, columns = table[face, side, START], table[face, side, ROWS], table[face, side, COLUMNS]
                across, down = columns / faces[face, EXTENT_P], rows / faces[face, EXTENT_Q]
                wide, high = count_samples(corners, n, across, down)
                light_run(
                    texels, first, rows, columns, corners, n, wide, high, across, down, light, light.size > 0, out, y, x
                )
            x = end
