"""Cells: parts of a band, by default its tiles, whose pixels have the same candidate faces."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import DEPTH, FaceViews
from peaksim.area.owner import NOTHING, TILE, find_faces, find_owners

PERSPECTIVE = 0.02
"""Where depth varies by more than this share within a pixel, the pixel is split: image area counts, not the face's.

`benchmarks/fidelity_render.py` measures what comes of it."""
MOST_SPLITS = 8
"""Most parts of a pixel along each axis."""
_SAMPLED_EVERY = 5
"""Every fifth row and column of a tile tells how steep its faces are."""

Rays = NDArray[np.float64]


class Cells(NamedTuple):
    """Which face fills each pixel of a band, and which faces share it."""

    owners: NDArray[np.int64]
    """(h, w) face, NOTHING or MIXED."""
    cells: NDArray[np.int64]
    """(h, w) row of `found` for a MIXED pixel."""
    found: NDArray[np.int64]
    """(t, n) faces."""
    counts: NDArray[np.int64]
    """(t,) how many of them."""


def cells_in_tiles(views: FaceViews, rays: Rays) -> Cells:
    """Return the cells of a band, one for each tile."""
    tiles = faces_in_tiles(views, rays, np.arange(views.sides.shape[1]))
    return cells_with_owners(views, rays, tile_cells(rays), tiles)


class InCells(NamedTuple):
    """Which faces may be visible in each cell of a band."""

    found: NDArray[np.int64]
    """(t, n) faces."""
    counts: NDArray[np.int64]
    """(t,) how many of them."""
    alone: NDArray[np.int64]
    """(t,) owner of all its pixels, MIXED where each pixel must be examined."""


def tile_cells(rays: Rays) -> NDArray[np.int64]:
    """Return the (h, w) tile of each pixel of a band."""
    height, width = rays.shape[0] - 1, rays.shape[1] - 1
    return np.broadcast_to(np.arange(width) // TILE, (height, width)).copy()


def cells_with_owners(views: FaceViews, rays: Rays, cells: NDArray[np.int64], faces: InCells) -> Cells:
    """Return the cells of a band with the owner of each pixel, given its (h, w) cell."""
    owners = np.empty_like(cells)
    find_owners(rays, views.sides, cells, *faces, owners)
    return Cells(owners, cells, faces.found, faces.counts)


def faces_in_tiles(views: FaceViews, rays: Rays, faces: NDArray[np.int64]) -> InCells:
    """Return which of some faces may be visible in each tile of a band."""
    ranges, boxes = side_ranges(views), tile_boxes(rays)
    if len(faces) == 0:
        empty = np.zeros((len(boxes), 0), np.int64)
        return InCells(empty, np.zeros(len(boxes), np.int64), np.full(len(boxes), NOTHING))
    whole = np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])[None]
    in_band = faces_in_boxes(ranges, whole, faces[None], np.full(1, len(faces)))
    n = in_band.counts[0]
    return faces_in_boxes(ranges, boxes, np.repeat(in_band.found[:, :n], len(boxes), axis=0), np.full(len(boxes), n))


def side_ranges(views: FaceViews) -> NDArray[np.float64]:
    """Return the (2, f, 5, 3) least and largest sides over the poses."""
    return np.stack([views.sides.min(axis=0), views.sides.max(axis=0)])


def faces_in_boxes(
    ranges: NDArray[np.float64], boxes: NDArray[np.float64], found: NDArray[np.int64], counts: NDArray[np.int64]
) -> InCells:
    """Return which of the faces found in (t, 6) boxes of directions are not hidden there; see `find_faces`."""
    found, counts, alone = found.copy(), counts.copy(), np.empty(len(boxes), np.int64)
    find_faces(ranges, boxes, found, counts, alone)
    return InCells(found, counts, alone)


def tile_boxes(rays: Rays) -> NDArray[np.float64]:
    """Return (t, 6) least and largest directions of the corners of each tile of a band."""
    ends = _tile_ends(rays)
    low, high = rays.min(axis=0), rays.max(axis=0)
    # a tile's last corners are the next one's first
    low = np.minimum(np.minimum.reduceat(low[:-1], ends[:-1]), low[ends[1:]])
    high = np.maximum(np.maximum.reduceat(high[:-1], ends[:-1]), high[ends[1:]])
    return np.concatenate([low, high], axis=1)


def _tile_ends(rays: Rays) -> NDArray[np.int64]:
    """Return the columns of corners at which tiles begin, and the last one."""
    return np.append(np.arange(0, rays.shape[1] - 1, TILE), rays.shape[1] - 1)


def count_splits(views: FaceViews, rays: Rays, cells: Cells) -> tuple[int, int]:
    """Return into how many parts across and down pixels must be split so that depth is nearly constant in each."""
    ends = _tile_ends(rays)
    faces, seen = textured_in_tiles(views, cells)
    corners = rays[:: len(rays) - 1, ends] @ views.sides[0, faces, DEPTH].T
    across = np.abs(np.diff(corners, axis=1)).max(axis=0) / np.diff(ends)[:, None]
    down = np.abs(np.diff(corners, axis=0))[0] / (len(rays) - 1)
    w = np.maximum(np.minimum(corners[:, :-1], corners[:, 1:]).min(axis=0), views.least[faces])
    steps = (across, np.maximum(down[:-1], down[1:]))
    parts = [int(np.ceil((step / w)[seen].max(initial=0) / PERSPECTIVE)) for step in steps]
    return min(MOST_SPLITS, max(1, parts[0])), min(MOST_SPLITS, max(1, parts[1]))


def textured_in_tiles(views: FaceViews, cells: Cells) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the (n,) textured faces that fill a sampled pixel, and (t, n) in which tile.

    Sampled are 4 × 4 pixels of a tile, on its border too: a face is steepest where it ends.
    """
    sampled_columns = np.flatnonzero(np.arange(cells.owners.shape[1]) % TILE % _SAMPLED_EVERY == 0)
    shown = cells.owners[::_SAMPLED_EVERY, sampled_columns]
    printed = np.append(views.printed[0], [False])  # the last one stands for no face
    shown = np.where(printed[np.maximum(shown, -1)], shown, NOTHING)
    faces = np.unique(shown[shown >= 0])
    columns = (shown[:, :, None] == faces).any(axis=0)
    return faces, np.logical_or.reduceat(columns, np.flatnonzero(sampled_columns % TILE == 0))


def split_rays(rays: Rays, across: int, down: int) -> Rays:
    """Return the corners of `across` × `down` equal parts of each pixel."""
    for axis, parts in ((0, down), (1, across)):
        rays = np.moveaxis(rays, axis, 0)
        steps = (np.arange(parts) / parts).reshape(1, parts, 1, 1)
        between = rays[:-1, None] + steps * (rays[1:] - rays[:-1])[:, None]
        rays = np.moveaxis(np.concatenate([between.reshape(-1, *rays.shape[1:]), rays[-1:]]), 0, axis)
    return np.ascontiguousarray(rays)


def split_cells(cells: Cells, across: int, down: int) -> Cells:
    """Return the cells of the parts of pixels: each part has the owner and the candidates of its pixel."""
    owners, rows = (np.repeat(np.repeat(a, down, axis=0), across, axis=1) for a in cells[:2])
    return Cells(owners, rows, cells.found, cells.counts)
