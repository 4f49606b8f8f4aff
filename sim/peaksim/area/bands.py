"""Bands of rows: each is drawn independently, in any thread."""

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.cells import Cells, Rays, count_splits, split_cells, split_rays
from peaksim.area.cut import MAX_PIECES, Lists, cut_mixed, new_lists
from peaksim.area.faces import Faces, FaceViews, faces_of
from peaksim.area.light import light_owned, light_pieces, pack_lights
from peaksim.area.light_map import LightMaps, PackedMaps, light_owned_baked, pack_maps
from peaksim.area.owner import MIXED
from peaksim.area.piece import add_pieces
from peaksim.area.rays import Solids, solids_of
from peaksim.area.run import fill_owned
from peaksim.area.sky import Sky, sky_levels, sky_of
from peaksim.errors import InputError
from peaksim.scene.scene import Scene
from peaksim.threads import map_in_threads, processor_count

BAND_ROWS = 16
"""Rows a thread takes at a time; fixed, so that bytes do not depend on the number of threads."""
_PIECES = 8192
"""Pieces that are cut before they are added up: 3 MB of memory a thread."""

Levels = NDArray[np.float32]


class PackedScene(NamedTuple):
    """A scene as tables for the kernels."""

    faces: Faces
    """Quads and triangles."""
    lights: NDArray[np.float64]
    """Table of lights, (0, 7) if surfaces are shown as printed."""
    solids: Solids
    """The meshes, which cast shadows."""
    sky: Sky
    """What is shown where nothing is."""
    maps: PackedMaps
    """Baked light."""

    @property
    def is_lit(self) -> bool:
        """Whether surfaces show anything else than their print."""
        return len(self.lights) > 0 or len(self.maps.table) > 0


def pack_scene(scene: Scene, maps: LightMaps | None = None) -> PackedScene:
    """Return a scene and the light baked for it as tables for the kernels."""
    lights, solids = pack_lights(scene.plain_lights), solids_of(scene, quads=False)
    sky = sky_of(scene, is_baked=maps is not None)
    return PackedScene(faces_of(scene), lights, solids, sky, pack_maps(maps))


def draw_split(packed: PackedScene, views: FaceViews, rays: Rays, cells: Cells, out: Levels) -> None:
    """Write a band with pixels split where depth is steep."""
    across, down = count_splits(views, rays, cells)
    if across == down == 1:
        draw_band(packed, views, rays, cells, out)
        return
    fine = split_rays(rays, across, down)
    if len(views.sides) > 1:
        sides, printed = np.repeat(views.sides, down, axis=0), np.repeat(views.printed, down, axis=0)
        views = FaceViews(
            sides, printed, views.least, np.repeat(views.eyes, down, axis=0), np.repeat(views.rotations, down, axis=0)
        )
    parts = np.empty((len(fine) - 1, fine.shape[1] - 1, out.shape[2]), dtype=np.float32)
    draw_band(packed, views, fine, split_cells(cells, across, down), parts)
    out[:] = parts.reshape(out.shape[0], down, out.shape[1], across, out.shape[2]).mean(axis=(1, 3))


def draw_band(packed: PackedScene, views: FaceViews, rays: Rays, cells: Cells, out: Levels) -> None:
    """Write a band: first the pixels that one face fills, then those that several share."""
    background = sky_levels(packed.sky, rays, views.rotations, out.shape[2])
    fill_owned(rays, views, packed.faces, cells.owners, background, out)
    if packed.is_lit:
        multiply_owned(packed, views, rays, cells.owners, out)
    if (cells.owners == MIXED).any():
        draw_mixed(packed, views, rays, cells, background, out)


def multiply_owned(packed: PackedScene, views: FaceViews, rays: Rays, owners: NDArray[np.int64], out: Levels) -> None:
    """Multiply the pixels of a band that one face fills by the light on them."""
    planes, table, eyes, *lighting, maps, texels = _lighting(packed, views)
    light = np.ones(out.shape) if len(packed.lights) else np.zeros(out.shape)
    if len(packed.lights):
        light_owned(rays, views.sides, planes, table, eyes, *lighting, owners, light)
    if len(maps):
        light_owned_baked(rays, views.sides, planes, table, eyes, maps, texels, owners, light, out)
    else:
        out *= light


def draw_mixed(
    packed: PackedScene, views: FaceViews, rays: Rays, cells: Cells, background: NDArray[np.float64], out: Levels
) -> None:
    """Write the pixels of a band that several faces share."""
    most = max(_PIECES, int(cells.counts.max()) * MAX_PIECES)
    lists = new_lists(most)
    first = 0
    while first < cells.owners.size:
        n, first = cut_mixed(rays, views.sides, cells, background, first, lists, out)
        draw_pieces(packed, views, n, lists, out)


def draw_pieces(packed: PackedScene, views: FaceViews, n: int, lists: Lists, out: Levels) -> None:
    """Add the first n pieces to a band."""
    light = np.ones((n, out.shape[2]))
    if packed.is_lit:
        light_pieces(*_lighting(packed, views), n, *lists[:2], light)
    add_pieces(views.printed, packed.faces.table, packed.faces.texels, n, *lists, light, out)


def _lighting(packed: PackedScene, views: FaceViews) -> tuple[NDArray[Any], ...]:
    return packed.faces.planes, packed.faces.table, views.eyes, packed.lights, *packed.solids[:3], *packed.maps


def run_in_threads(work: Callable[[int], None], items: range) -> None:
    """Do the work for all items, in as many threads as the process may use processors."""
    map_in_threads(work, items, thread_count())


def thread_count() -> int:
    """Return how many threads render: PEAKSIM_THREADS, else the processors this process may use.

    Raises
    ------
    InputError
        If PEAKSIM_THREADS is not a whole number; 0 is as if it were not set.
    """
    wanted = os.environ.get("PEAKSIM_THREADS") or "0"
    if not wanted.isdecimal():
        raise InputError(f"PEAKSIM_THREADS: expected a whole number of threads, got {wanted!r}")
    return int(wanted) or processor_count()
