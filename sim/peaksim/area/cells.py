"""Cells: parts of a band, by default its tiles, whose pixels have the same candidate faces."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import FaceViews
from peaksim.area.owner import TILE, find_faces, find_owners, keep_faces
from peaksim.native import function

PERSPECTIVE = 0.02
"""Where depth varies by more than this share within a pixel, the pixel is split: image area counts, not the face's.

`benchmarks/fidelity_render.py` measures what comes of it."""
MOST_SPLITS = 8
"""Most parts of a pixel along each axis."""
_FEW_FACES = 32
"""Most faces that are visible in most bands."""
_SAMPLED_EVERY = 5
"""Every fifth row and column of a tile tells how steep its faces are."""

Rays = NDArray[np.float64]


_bound_tiles = function("void bound_tiles(const f8[rows,columns,3] rays, f8[tiles,6] boxes)")
_find_steepest = function(
    "void find_steepest(const f8[rows,columns,3] rays, const f8[poses,faces,5,3] sides, const b1[poses,faces] printed, "
    "const f8[faces] least_w, const i8[height,width] owners, i8 sampled_every, f8[2] steepest)"
)


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
    return cells_with_owners(views, rays, tile_cells(rays.shape[0] - 1, rays.shape[1] - 1), tiles)


class InCells(NamedTuple):
    """Which faces may be visible in each cell of a band."""

    found: NDArray[np.int64]
    """(t, n) faces."""
    counts: NDArray[np.int64]
    """(t,) how many of them."""
    alone: NDArray[np.int64]
    """(t,) owner of all its pixels, MIXED where each pixel must be examined."""


@lru_cache(maxsize=4)
def tile_cells(height: int, width: int) -> NDArray[np.int64]:
    """Return the (height, width) tile of each pixel of a band, read-only."""
    tiles = np.broadcast_to(np.arange(width) // TILE, (height, width)).copy()
    tiles.flags.writeable = False
    return tiles


def cells_with_owners(views: FaceViews, rays: Rays, cells: NDArray[np.int64], faces: InCells) -> Cells:
    """Return the cells of a band with the owner of each pixel, given its (h, w) cell."""
    owners = np.empty_like(cells)
    find_owners(rays, views.sides, cells, *faces, owners)
    return Cells(owners, cells, faces.found, faces.counts)


SideRanges = tuple[NDArray[np.float64], NDArray[np.float64]]


def side_ranges(views: FaceViews) -> SideRanges:
    """Return the (f, 5, 3) least and largest sides over the poses."""
    if len(views.sides) == 1:
        return views.sides[0], views.sides[0]
    return views.sides.min(axis=0), views.sides.max(axis=0)


def faces_in_tiles(views: FaceViews, rays: Rays, faces: NDArray[np.int64]) -> InCells:
    """Return which of (n,) faces may be visible in each tile of a band."""
    ranges, boxes = side_ranges(views), tile_boxes(rays)
    candidates, left = faces.copy(), np.zeros(1, np.int64)
    counts, alone = np.empty(len(boxes), np.int64), np.empty(len(boxes), np.int64)
    found = np.empty((len(boxes), _FEW_FACES), np.int64)
    find_faces(*ranges, boxes, candidates, left, found, counts, alone)
    if left[0] > _FEW_FACES:
        found = np.empty((len(boxes), left[0]), np.int64)
        find_faces(*ranges, boxes, candidates[: left[0]], left, found, counts, alone)
    return InCells(found, counts, alone)


def listed_in_boxes(
    ranges: SideRanges, boxes: NDArray[np.float64], found: NDArray[np.int64], counts: NDArray[np.int64]
) -> InCells:
    """Return which of the faces found in (t, 6) boxes of directions are not hidden there; see `keep_faces`."""
    found, counts, alone = found.copy(), counts.copy(), np.empty(len(boxes), np.int64)
    keep_faces(*ranges, boxes, found, counts, alone)
    return InCells(found, counts, alone)


def tile_boxes(rays: Rays) -> NDArray[np.float64]:
    """Return (t, 6) least and largest directions of the corners of each tile of a band."""
    boxes = np.empty((-(-(rays.shape[1] - 1) // TILE), 6))
    _bound_tiles(rays, boxes)
    return boxes


def count_splits(views: FaceViews, rays: Rays, cells: Cells) -> tuple[int, int]:
    """Return into how many parts across and down pixels must be split so that depth is nearly constant in each.

    Sampled are 4 × 4 pixels of a tile, on its border too: a face is steepest where it ends.
    """
    steepest = np.empty(2)
    _find_steepest(rays, views.sides, views.printed, views.least, cells.owners, _SAMPLED_EVERY, steepest)
    across, down = np.clip(np.ceil(steepest / PERSPECTIVE), 1, MOST_SPLITS)
    return int(across), int(down)


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
