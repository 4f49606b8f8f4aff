"""The renderer that finds what is visible with OpenGL, which draws the numbers of the faces.

The exact kernels then integrate textures, edges, light and shadow over the faces that are shown in a pixel: hidden
faces cost nothing.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from peaksim.area.bands import BAND_ROWS, Levels, PackedScene, draw_pieces, draw_split, pack_scene, run_in_threads
from peaksim.area.cells import (
    Cells,
    InCells,
    Rays,
    cells_with_owners,
    faces_in_tiles,
    listed_in_boxes,
    side_ranges,
    tile_boxes,
    tile_cells,
)
from peaksim.area.cut import new_lists
from peaksim.area.faces import FaceViews, channels_of, distance_range, panel_counts, panels_m, view_faces
from peaksim.area.integrate import integrate as integrate_sky
from peaksim.area.light_map import LightMaps
from peaksim.area.owner import MIXED, TILE
from peaksim.area.shown import CROWDED, MOST_FACES, SAMPLES, cut_crowded, list_in_pixels, list_in_tiles
from peaksim.area.sky import sky_levels
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose
from peaksim.gl.context import draw_numbers, gl_renderer, is_available
from peaksim.gl.tiles import split_into_tiles, window_of, window_positions
from peaksim.scene.scene import Quad, Scene

__all__ = ["gl_renderer", "integrate", "is_available"]

NEAREST_M = 1e-3
"""Faces nearer to the camera are not drawn."""
TOUCH_M = 1e-3
"""Quads that lie this close to one plane touch: OpenGL may show one instead of another."""
_CROWDED_AT_ONCE = 512
"""Crowded pixels that are cut before their pieces are added up: 3 MB of memory."""


def integrate(scene: Scene, camera: Camera, world_from_camera: Pose, maps: LightMaps | None = None) -> Levels:
    """Return the (h, w, channels) linear grey levels of a scene, in the light that was baked for it, if any.

    Raises
    ------
    RendererError
        If OpenGL fails.
    """
    packed = pack_scene(scene, maps)
    views = view_faces(packed.faces, world_from_camera[None])
    if not len(packed.faces.planes):
        return integrate_sky(scene, camera, world_from_camera[None], maps)
    out = np.empty((camera.height, camera.width, channels_of(scene)), dtype=np.float32)
    nearest, farthest = distance_range(packed.faces, views.eyes[0])
    groups = touching_groups(scene)
    for tile in split_into_tiles(camera):
        window = window_of(tile, camera.is_pinhole)
        depths_m = max(NEAREST_M, 0.99 * window.slant * nearest), 1.01 * farthest + 2 * NEAREST_M
        numbers = draw_numbers(scene, world_from_camera, window, depths_m)
        levels = np.empty((len(tile.rays) - 1, tile.rays.shape[1] - 1, out.shape[2]), dtype=np.float32)
        draw_tile(packed, views, tile.rays, Shown(numbers, window.samples_from_camera, groups), levels)
        out[tile.rows, tile.columns] = levels
    return out


@lru_cache(maxsize=1)
def touching_groups(scene: Scene) -> NDArray[np.int64]:
    """Return (f,) numbers: panels that lie on each other, or are of one quad, have the same one ≥ 0; all others −1."""
    corners = panels_m(scene.quads)
    groups = np.full(len(corners) + sum(len(mesh.faces) for mesh in scene.meshes), -1)
    if len(corners):
        pairs = np.concatenate([_touching_pairs(corners), _neighbours(scene.quads)])
        links = scipy.sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(len(corners), len(corners)))
        _, labels = scipy.sparse.csgraph.connected_components(links)
        groups[: len(corners)] = np.where(np.bincount(labels)[labels] > 1, labels, -1)
    return groups


def _neighbours(quads: tuple[Quad, ...]) -> NDArray[np.intp]:
    """Return (p, 2) panels that are neighbours on a quad: those of bent paper may be too narrow to be shown."""
    counts = panel_counts(quads)
    quad = np.repeat(np.arange(len(quads)), counts)
    first = np.flatnonzero(quad[:-1] == quad[1:])
    return np.stack([first, first + 1], axis=1)


def _touching_pairs(corners_m: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return (p, 2) rectangles: the second lies in the plane of the first, within TOUCH_M, and may share its area.

    Those that touch are no farther apart than twice the larger one's radius, and a tree finds them.
    """
    middles = corners_m.mean(axis=1)
    radii = np.linalg.norm(corners_m[:, 0] - middles, axis=1)
    near = scipy.spatial.cKDTree(middles).query_ball_point(middles, 2 * radii + 2 * TOUCH_M)
    first = np.repeat(np.arange(len(corners_m)), [len(found) for found in near])
    second = np.concatenate([np.asarray(found, dtype=np.intp) for found in near])
    first, second = first[radii[second] <= radii[first]], second[radii[second] <= radii[first]]
    a, b = np.concatenate([first, second]), np.concatenate([second, first])
    rotations, sizes = rectangle_frames(corners_m)
    local = (corners_m[b] - middles[a, None]) @ rotations[a]
    flush = np.abs(local[:, :, 2]).max(axis=1) <= TOUCH_M
    low, high = local[:, :, :2].min(axis=1), local[:, :, :2].max(axis=1)
    reach = sizes[a] / 2 - TOUCH_M
    touches = flush & (low < reach).all(axis=1) & (high > -reach).all(axis=1)
    return np.stack([a[touches], b[touches]], axis=1)


def rectangle_frames(corners_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (n, 3, 3) world_from_rectangle rotations and (n, 2) sizes, m, of (n, 4, 3) rectangles."""
    sides = np.stack([corners_m[:, 1] - corners_m[:, 0], corners_m[:, 0] - corners_m[:, 3]], axis=2)
    sizes = np.linalg.norm(sides, axis=1)
    x, y = np.moveaxis(sides / sizes[:, None], 2, 0)
    return np.stack([x, y, np.cross(x, y)], axis=2), sizes


class Shown(NamedTuple):
    """What OpenGL shows of a tile."""

    numbers: NDArray[np.uint32]
    """(r, c) numbers of faces, from `draw_numbers`."""
    samples_from_camera: NDArray[np.float64]
    """(3, 3) matrix from directions to columns and rows of `numbers`."""
    groups: NDArray[np.int64]
    """(f,) from `touching_groups`."""


# --- one tile -------------------------------------------------------------------------------------------------


def draw_tile(packed: PackedScene, views: FaceViews, rays: Rays, shown: Shown, out: Levels) -> None:
    """Write a tile, in bands that threads share."""

    def band(first: int) -> None:
        rows = slice(first, min(first + BAND_ROWS, len(out)))
        corners = np.ascontiguousarray(rays[rows.start : rows.stop + 1])
        positions = window_positions(corners, shown.samples_from_camera)
        cells = cells_shown(views, corners, positions, shown)
        draw_split(packed, views, corners, cells, out[rows])
        pixels = np.argwhere(cells.owners == CROWDED)
        if len(pixels):
            draw_crowded(packed, views, corners, positions, shown.numbers, pixels, out[rows])

    run_in_threads(band, range(0, len(out), BAND_ROWS))


def cells_shown(views: FaceViews, rays: Rays, positions: Rays, shown: Shown) -> Cells:
    """Return the cells of a band: tiles, or single pixels where many faces are shown in their tile."""
    touching_faces = faces_in_tiles(views, rays, np.flatnonzero(shown.groups >= 0))
    hints = shown.numbers, shown.groups, *touching_faces[:2]
    boxes, cells = tile_boxes(positions), tile_cells(rays.shape[0] - 1, rays.shape[1] - 1)
    found, counts = np.empty((len(boxes), MOST_FACES + 1), np.int64), np.empty(len(boxes), np.int64)
    list_in_tiles(*hints, boxes, found, counts)
    full = counts > MOST_FACES
    faces = listed_in_boxes(side_ranges(views), tile_boxes(rays), found, np.where(full, 0, counts))
    if full.any():
        more = int(full[cells].sum())
        found = np.concatenate([faces.found, np.empty((more, MOST_FACES + 1), np.int64)])
        counts, alone = np.pad(faces.counts, (0, more)), np.pad(faces.alone, (0, more), constant_values=MIXED)
        cells = cells.copy()
        list_in_pixels(*hints, positions, rays, views.sides, TILE, full, found, counts, alone, cells)
        faces = InCells(found, counts, alone)
    return cells_with_owners(views, rays, cells, faces)


def draw_crowded(
    packed: PackedScene,
    views: FaceViews,
    rays: Rays,
    positions: Rays,
    numbers: NDArray[np.uint32],
    pixels: NDArray[np.int64],
    out: Levels,
) -> None:
    """Add the (n, 2) pixels of a band, row and column, that show too many faces."""
    lists = new_lists(_CROWDED_AT_ONCE * SAMPLES**2)
    background = sky_levels(packed.sky, rays, views.rotations, out.shape[2])
    for first in range(0, len(pixels), _CROWDED_AT_ONCE):
        some = pixels[first : first + _CROWDED_AT_ONCE]
        n = cut_crowded(rays, views.sides, numbers, positions, some, background, *lists, out)
        draw_pieces(packed, views, n, lists, out)
