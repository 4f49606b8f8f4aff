"""Bands of rows: each is drawn by itself, in a thread of its own."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.cells import Cells, Rays, refined, refined_cells, splits
from peaksim.area.cut import MAX_PIECES, cut_mixed
from peaksim.area.faces import Faces, Views, faces_of
from peaksim.area.light import light_owned, light_pieces, pack_lights
from peaksim.area.owner import MIXED
from peaksim.area.piece import add_pieces
from peaksim.area.polygon import MAX_VERTICES
from peaksim.area.rays import Solids, solids_of
from peaksim.area.run import CHUNK, fill_owned
from peaksim.scene.scene import Scene

BAND_ROWS = 16
"""Rows a thread takes at a time; fixed, so that bytes do not depend on the number of threads."""


_PIECES = 8192


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


def see(scene: Scene) -> Seen:
    """Return a scene as the kernels need it."""
    lights = np.zeros((0, 7))
    if scene.plain_lights:
        lights = pack_lights(scene.plain_lights)
    return Seen(faces_of(scene), lights, solids_of(scene, quads=False), float(scene.background))


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
        light_pieces(*_lighting(seen, eyes), n, *lists)
    add_pieces(views.printed, seen.faces.table, seen.faces.texels, n, *lists, out)


def _lighting(seen: Seen, eyes: NDArray[np.float64]) -> tuple[NDArray[Any], ...]:
    return seen.faces.planes, seen.faces.table, eyes, seen.lights, *seen.solids[:3]


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
