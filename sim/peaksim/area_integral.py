"""The area integral: every pixel is the mean of what it sees, in bands of rows that threads share.

Which faces a pixel may see is found by interval arithmetic over tiles.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area_cut import MAX_PIECES, cut_mixed
from peaksim.area_owner import COVERS, MIXED, NOTHING, TILE, find_faces, find_owners
from peaksim.area_piece import add_pieces
from peaksim.area_polygon import MAX_VERTICES
from peaksim.area_run import CHUNK, fill_owned
from peaksim.camera import Camera
from peaksim.faces import DEPTH, Faces, Views, channels_of, faces_of, look
from peaksim.rays import Solids, solids_of
from peaksim.scene import Scene

BAND_ROWS = 16
"""Rows a thread takes at a time; fixed, so that bytes do not depend on the number of threads."""
PERSPECTIVE = 0.02
"""Where depth varies by more than this share within a pixel, the pixel is split: image area counts, not the face's."""
MOST_SPLITS = 8
"""Most parts of a pixel along each axis."""
_LOOK_EVERY = 5
_PIECES = 8192

Rays = NDArray[np.float64]
Levels = NDArray[np.float32]
Lists = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]


class Seen(NamedTuple):
    """A scene as the kernels need it."""

    faces: Faces
    """Quads and triangles."""
    lights: NDArray[np.float64]
    """Table of lights, (0, 7) where things are shown as printed."""
    solids: Solids
    """The meshes, which throw shadows."""
    background: float
    """Level where nothing is."""


class Cells(NamedTuple):
    """Who fills the pixels of a band, and who shares them."""

    owners: NDArray[np.int64]
    """(h, w) face, NOTHING or MIXED."""
    cells: NDArray[np.int64]
    """(h, w) row of `found` for a MIXED pixel."""
    found: NDArray[np.int64]
    """(t, n) faces."""
    counts: NDArray[np.int64]
    """(t,) how many of them."""


def integrate(scene: Scene, camera: Camera, poses: NDArray[np.float64]) -> Levels:
    """Return the (h, w, channels) linear grey levels of a scene.

    Parameters
    ----------
    scene, camera
        What is seen, and by what.
    poses
        (1, 4, 4) `world_from_camera`, or (h, 4, 4), one a row.
    """
    seen = see(scene)
    lattice = corner_rays(camera)
    still = look(seen.faces, poses) if len(poses) == 1 else None
    out = np.empty((camera.height, camera.width, channels_of(scene)), dtype=np.float32)

    def band(first: int) -> None:
        rows = slice(first, min(first + BAND_ROWS, camera.height))
        rays = band_rays(camera, rows) if lattice is None else lattice[rows.start : rows.stop + 1]
        band_poses = poses if still else poses[rows]
        views = still or look(seen.faces, band_poses)
        draw_split(seen, views, band_poses[:, :3, 3], rays, cells_in_tiles(views, rays), out[rows])

    in_threads(band, range(0, camera.height, BAND_ROWS))
    return out


def see(scene: Scene) -> Seen:
    """Return a scene as the kernels need it."""
    lights = np.zeros((0, 7))
    if scene.lights:
        from peaksim.area_light import pack_lights  # its kernels compile only where there is light

        lights = pack_lights(scene.lights)
    return Seen(faces_of(scene), lights, solids_of(scene, quads=False), float(scene.background))


# --- one band of rows: (h, w, channels) pixels between (h + 1, w + 1, 3) corners ---------------------------------


def draw_split(seen: Seen, views: Views, eyes: NDArray[np.float64], rays: Rays, cells: Cells, out: Levels) -> None:
    """Write a band with pixels split where depth is steep; `eyes` is (1 or h, 3), the camera's place."""
    across, down = splits(views, rays, cells)
    if across == down == 1:
        draw_band(seen, views, eyes, rays, cells, out)
        return
    fine = refined(rays, across, down)
    if len(views.sides) > 1:
        sides, printed = np.repeat(views.sides, down, axis=0), np.repeat(views.printed, down, axis=0)
        views, eyes = Views(sides, printed, views.least), np.repeat(eyes, down, axis=0)
    parts = np.empty((len(fine) - 1, fine.shape[1] - 1, out.shape[2]), dtype=np.float32)
    draw_band(seen, views, eyes, fine, refined_cells(cells, across, down), parts)
    out[:] = parts.reshape(out.shape[0], down, out.shape[1], across, out.shape[2]).mean(axis=(1, 3))


def draw_band(seen: Seen, views: Views, eyes: NDArray[np.float64], rays: Rays, cells: Cells, out: Levels) -> None:
    """Write a band: first the pixels that one face fills, then those that several share."""
    width, channels = out.shape[1:]
    memory = np.empty((2, 2, CHUNK + 1)), np.empty((channels, width)), np.full(width, -1)
    table, texels = seen.faces.table, seen.faces.texels
    fill_owned(rays, views.sides, views.printed, table, texels, cells.owners, seen.background, *memory, out)
    if len(seen.lights):
        from peaksim.area_light import light_owned

        light_owned(rays, views.sides, *_lighting(seen, eyes), cells.owners, out)
    if (cells.owners == MIXED).any():
        draw_mixed(seen, views, eyes, rays, cells, out)


def draw_mixed(seen: Seen, views: Views, eyes: NDArray[np.float64], rays: Rays, cells: Cells, out: Levels) -> None:
    """Write the pixels of a band that several faces share."""
    most = max(_PIECES, int(cells.counts.max()) * MAX_PIECES)
    lists = new_lists(most)
    first = 0
    while first < cells.owners.size:
        n, first = cut_mixed(rays, views.sides, *cells, seen.background, first, *lists, out)
        draw_pieces(seen, views, eyes, n, lists, out)


def new_lists(most: int) -> Lists:
    """Return room for pieces of pixels: `polygons`, `pieces` and `shares` of `cut_mixed`."""
    return np.empty((most, MAX_VERTICES, 2)), np.empty((most, 4), np.int64), np.empty(most)


def draw_pieces(seen: Seen, views: Views, eyes: NDArray[np.float64], n: int, lists: Lists, out: Levels) -> None:
    """Add the first n pieces to a band."""
    if len(seen.lights):
        from peaksim.area_light import light_pieces

        light_pieces(*_lighting(seen, eyes), n, *lists)
    add_pieces(views.printed, seen.faces.table, seen.faces.texels, n, *lists, out)


def _lighting(seen: Seen, eyes: NDArray[np.float64]) -> tuple[NDArray[Any], ...]:
    return seen.faces.planes, seen.faces.table, eyes, seen.lights, *seen.solids[:3]


# --- what a band sees -----------------------------------------------------------------------------------------


def cells_in_tiles(views: Views, rays: Rays) -> Cells:
    """Return what a band sees, each tile being a cell."""
    tiles = faces_in_tiles(views, rays, np.arange(views.sides.shape[1]))
    return owned(views, rays, tile_cells(rays), tiles)


class InCells(NamedTuple):
    """Which faces each cell of a band may see."""

    found: NDArray[np.int64]
    """(t, n) faces."""
    counts: NDArray[np.int64]
    """(t,) how many of them."""
    alone: NDArray[np.int64]
    """(t,) owner of all its pixels, MIXED where they have to be looked at."""


def tile_cells(rays: Rays) -> NDArray[np.int64]:
    """Return the (h, w) tile of each pixel of a band."""
    height, width = rays.shape[0] - 1, rays.shape[1] - 1
    return np.broadcast_to(np.arange(width) // TILE, (height, width)).copy()


def owned(views: Views, rays: Rays, cells: NDArray[np.int64], faces: InCells) -> Cells:
    """Return what a band sees, given the (h, w) cell of each pixel."""
    owners = np.empty_like(cells)
    find_owners(rays, views.sides, cells, *faces, owners)
    return Cells(owners, cells, faces.found, faces.counts)


def faces_in_tiles(views: Views, rays: Rays, faces: NDArray[np.int64]) -> InCells:
    """Return which of some faces each tile of a band may see."""
    ranges, boxes = side_ranges(views), tile_boxes(rays)
    if len(faces) == 0:
        empty = np.zeros((len(boxes), 0), np.int64)
        return InCells(empty, np.zeros(len(boxes), np.int64), np.full(len(boxes), NOTHING))
    whole = np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])[None]
    in_band = seen_in(ranges, whole, faces[None], np.full(1, len(faces)))
    n = in_band.counts[0]
    return seen_in(ranges, boxes, np.repeat(in_band.found[:, :n], len(boxes), axis=0), np.full(len(boxes), n))


def side_ranges(views: Views) -> NDArray[np.float64]:
    """Return the (2, f, 5, 3) least and largest sides over the poses."""
    return np.stack([views.sides.min(axis=0), views.sides.max(axis=0)])


def seen_in(ranges: NDArray[np.float64], boxes: NDArray[np.float64], found: NDArray[np.int64],
            counts: NDArray[np.int64]) -> InCells:  # fmt: skip
    """Return which of the faces found in (t, 6) boxes of directions may truly be seen there; see `find_faces`."""
    found, counts, states = found.copy(), counts.copy(), np.zeros((len(boxes), found.shape[1] + 1), np.int64)
    find_faces(ranges, boxes, found, states, counts)
    first = np.concatenate([found, np.full((len(boxes), 1), NOTHING)], axis=1)[:, 0]
    alone = np.where((counts == 1) & (states[:, 0] == COVERS), first, MIXED)
    return InCells(found, counts, np.where(counts == 0, NOTHING, alone))


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


def splits(views: Views, rays: Rays, cells: Cells) -> tuple[int, int]:
    """Return into how many parts across and down pixels must be split for depth to be even in each."""
    ends = _tile_ends(rays)
    faces, seen = textured_in_tiles(views, cells)
    corners = rays[:: len(rays) - 1, ends] @ views.sides[0, faces, DEPTH].T
    across = np.abs(np.diff(corners, axis=1)).max(axis=0) / np.diff(ends)[:, None]
    down = np.abs(np.diff(corners, axis=0))[0] / (len(rays) - 1)
    w = np.maximum(np.minimum(corners[:, :-1], corners[:, 1:]).min(axis=0), views.least[faces])
    steps = (across, np.maximum(down[:-1], down[1:]))
    parts = [int(np.ceil((step / w)[seen].max(initial=0) / PERSPECTIVE)) for step in steps]
    return min(MOST_SPLITS, max(1, parts[0])), min(MOST_SPLITS, max(1, parts[1]))


def textured_in_tiles(views: Views, cells: Cells) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the (n,) textured faces that fill one of the pixels looked at, and (t, n) in which tile.

    Looked at are 4 × 4 pixels of a tile, on its border too: a face is steepest where it ends.
    """
    columns_looked_at = np.flatnonzero(np.arange(cells.owners.shape[1]) % TILE % _LOOK_EVERY == 0)
    shown = cells.owners[::_LOOK_EVERY, columns_looked_at]
    printed = np.append(views.printed[0], [False])  # the last one stands for no face
    shown = np.where(printed[np.maximum(shown, -1)], shown, NOTHING)
    faces = np.unique(shown[shown >= 0])
    columns = (shown[:, :, None] == faces).any(axis=0)
    return faces, np.logical_or.reduceat(columns, np.flatnonzero(columns_looked_at % TILE == 0))


def refined(rays: Rays, across: int, down: int) -> Rays:
    """Return the corners of `across` × `down` equal parts of each pixel."""
    for axis, parts in ((0, down), (1, across)):
        rays = np.moveaxis(rays, axis, 0)
        steps = (np.arange(parts) / parts).reshape(1, parts, 1, 1)
        between = rays[:-1, None] + steps * (rays[1:] - rays[:-1])[:, None]
        rays = np.moveaxis(np.concatenate([between.reshape(-1, *rays.shape[1:]), rays[-1:]]), 0, axis)
    return np.ascontiguousarray(rays)


def refined_cells(cells: Cells, across: int, down: int) -> Cells:
    """Return the cells of the parts of pixels: what fills or may be seen in a pixel, fills or may be seen in each."""
    owners, rows = (np.repeat(np.repeat(a, down, axis=0), across, axis=1) for a in cells[:2])
    return Cells(owners, rows, cells.found, cells.counts)


# --- the whole picture ----------------------------------------------------------------------------------------


@lru_cache(maxsize=2)
def corner_rays(camera: Camera) -> Rays | None:
    """Return (h + 1, w + 1, 3) directions of the pixel corners; None for a pinhole, which needs no table."""
    if camera.is_pinhole:
        return None
    x, y = np.meshgrid(np.arange(camera.width + 1) - 0.5, np.arange(camera.height + 1) - 0.5)
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    return rays.reshape(camera.height + 1, camera.width + 1, 3)


def band_rays(camera: Camera, rows: slice) -> Rays:
    """Return (h + 1, w + 1, 3) directions of the pixel corners of rows of a pinhole."""
    rays = np.ones((rows.stop - rows.start + 1, camera.width + 1, 3))
    rays[:, :, 0] = (np.arange(camera.width + 1) - 0.5 - camera.cx) / camera.fx
    rays[:, :, 1] = ((np.arange(rows.start, rows.stop + 1) - 0.5 - camera.cy) / camera.fy)[:, None]
    return rays


def in_threads(work: Callable[[int], None], items: range) -> None:
    """Do the work for all items, in as many threads as the process may use processors."""
    if (count := threads()) == 1:
        for item in items:
            work(item)
        return
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(work, items))


def threads() -> int:
    """Return how many threads render: PEAKSIM_THREADS, else the processors this process may use."""
    return max(1, int(os.environ.get("PEAKSIM_THREADS", 0)) or len(os.sched_getaffinity(0)))
