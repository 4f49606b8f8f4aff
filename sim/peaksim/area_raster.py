"""Kernels: the exact area integral of flat faces over every pixel of a band of rows.

Tiles first: faces that cannot touch a tile, or lie behind one that covers it, are dropped by interval arithmetic over
the tile's viewing directions. Then pixels: one covering face in front owns the pixel, and runs of pixels with the same
owner share their edges' line integrals. All other pixels are cut into the visible piece of every face.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peaksim.area_light import Lights
from peaksim.area_pixel import PERSPECTIVE, TIE, mixed_pixel, new_work, whole_pixel
from peaksim.area_texture import POINT_FOOTPRINT, edge_integral, edge_steps, sample
from peaksim.faces import QUAD, Faces, Textures
from peaksim.rays import Solids

TILE = 16
CHUNK = 16
OUTSIDE, TOUCHES, COVERS = 0, 1, 2
NOTHING, MIXED = -1, -2


class Seen(NamedTuple):
    """A scene as the kernels need it."""

    faces: Faces
    textures: Textures
    lights: Lights
    solids: Solids
    background: float


class View(NamedTuple):
    """A camera's pixels as viewing directions."""

    lattice: NDArray[np.float64]
    """(h + 1, w + 1, 3) directions of the pixel corners; empty for a pinhole."""
    pinhole: NDArray[np.float64]
    """fx, fy, cx, cy."""
    width: int
    height: int


@njit(cache=True, nogil=True, error_model="numpy")
def corner_row(view, y, rays):  # type: ignore[no-untyped-def]
    """Write the (w + 1, 3) directions of the corners above pixel row y."""
    if view.lattice.size:
        for x in range(view.width + 1):
            for k in range(3):
                rays[x, k] = view.lattice[y, x, k]
        return
    down = (y - 0.5 - view.pinhole[3]) / view.pinhole[1]
    for x in range(view.width + 1):
        rays[x, 0] = (x - 0.5 - view.pinhole[2]) / view.pinhole[0]
        rays[x, 1] = down
        rays[x, 2] = 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _range(low, high, ray_low, ray_high):  # type: ignore[no-untyped-def]
    """Return the range of Σ m·d for m and d in boxes."""
    least = most = 0.0
    for k in range(3):
        a, b = low[k] * ray_low[k], low[k] * ray_high[k]
        c, d = high[k] * ray_low[k], high[k] * ray_high[k]
        least += min(min(a, b), min(c, d))
        most += max(max(a, b), max(c, d))
    return least, most


@njit(cache=True, nogil=True, error_model="numpy")
def box_state(low, high, kind, extents, ray_low, ray_high):  # type: ignore[no-untyped-def]
    """Return whether a face with maps within (low, high) is outside, touches or covers a box of directions."""
    state = COVERS
    row_low, row_high = np.empty(3), np.empty(3)
    for side in range(4 if kind == QUAD else 3):
        axis = side // 2 if kind == QUAD else side
        for k in range(3):
            if (kind == QUAD and side % 2 == 0) or (kind != QUAD and side < 2):
                row_low[k], row_high[k] = low[axis, k], high[axis, k]
            elif kind == QUAD:
                row_low[k] = extents[axis] * low[2, k] - high[axis, k]
                row_high[k] = extents[axis] * high[2, k] - low[axis, k]
            else:
                row_low[k] = low[2, k] - high[0, k] - high[1, k]
                row_high[k] = high[2, k] - low[0, k] - low[1, k]
        least, most = _range(row_low, row_high, ray_low, ray_high)
        if most < 0.0:
            return OUTSIDE
        if least < 0.0:
            state = TOUCHES
    return state


@njit(cache=True, nogil=True, error_model="numpy")
def candidates(low, high, kinds, extents, ray_low, ray_high, source, n, found, states):  # type: ignore[no-untyped-def]
    """Write those of the first n faces in `source` that may be seen within a box of directions; return their number."""
    m = 0
    for k in range(n):
        face = source[k]
        state = box_state(low[face], high[face], kinds[face], extents[face], ray_low, ray_high)
        if state != OUTSIDE:
            found[m] = face
            states[m] = state
            m += 1
    kept = 0
    for k in range(m):
        hidden = False
        for other in range(m):
            if (other < kept or other > k) and states[other] == COVERS:
                hidden = hidden or _in_front(low, high, found[other], found[k], ray_low, ray_high)
        if not hidden:
            found[kept] = found[k]
            states[kept] = states[k]
            kept += 1
    return kept


@njit(cache=True, nogil=True, error_model="numpy")
def _in_front(low, high, front, back, ray_low, ray_high):  # type: ignore[no-untyped-def]
    """Return whether one face is nearer than another along every direction of a box."""
    gap_low, gap_high = np.empty(3), np.empty(3)
    for i in range(3):
        gap_low[i] = low[front, 2, i] - high[back, 2, i]
        gap_high[i] = high[front, 2, i] - low[back, 2, i]
    least, _ = _range(gap_low, gap_high, ray_low, ray_high)
    _, deepest = _range(low[back, 2], high[back, 2], ray_low, ray_high)
    return least > TIE * abs(deepest)


@njit(cache=True, nogil=True, error_model="numpy")
def _dot(row, ray):  # type: ignore[no-untyped-def]
    return row[0] * ray[0] + row[1] * ray[1] + row[2] * ray[2]


@njit(cache=True, nogil=True, error_model="numpy")
def pixel_state(face_map, kind, extents, above, below, x, depths):  # type: ignore[no-untyped-def]
    """Return whether a face is outside, touches or covers pixel x between two rows of corners; write its 4 depths w."""
    outs = 0
    common = 15
    for corner in range(4):
        ray = above[x + corner % 2] if corner < 2 else below[x + corner % 2]
        p, q, w = _dot(face_map[0], ray), _dot(face_map[1], ray), _dot(face_map[2], ray)
        depths[corner] = w
        far_p = extents[0] * w - p if kind == QUAD else w - p - q
        far_q = extents[1] * w - q if kind == QUAD else w
        out = (p < 0.0) * 1 + (q < 0.0) * 2 + (far_p < 0.0) * 4 + (far_q < 0.0) * 8
        outs |= out
        common &= out
    if common:
        return OUTSIDE
    return TOUCHES if outs else COVERS


@njit(cache=True, nogil=True, error_model="numpy")
def pixel_owner(view_maps, faces, found, n, above, below, x, depths, states):  # type: ignore[no-untyped-def]
    """Return the face that alone fills a pixel, NOTHING, or MIXED."""
    touched = 0
    nearest = -1
    for k in range(n):
        face = found[k]
        states[k] = pixel_state(view_maps[face], faces.kinds[face], faces.extents[face], above, below, x, depths[k])
        touched += states[k] != OUTSIDE
    if touched == 0:
        return NOTHING
    for k in range(n):
        if states[k] == COVERS:
            nearest = k
            for other in range(n):
                if other != k and states[other] != OUTSIDE and not _hides(depths, k, other, found[k] > found[other]):
                    nearest = -1
                    break
            if nearest >= 0:
                return found[nearest]
    return MIXED


@njit(cache=True, nogil=True, error_model="numpy")
def _hides(depths, front, back, later):  # type: ignore[no-untyped-def]
    """Return whether a covering face hides another one at all four corners of a pixel."""
    for corner in range(4):
        gap = depths[front, corner] - depths[back, corner]
        tie = TIE * abs(depths[back, corner])
        if gap < -tie or (gap <= tie and not later):
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _tile_box(view, first, last, x0, x1, above, low, high):  # type: ignore[no-untyped-def]
    """Write the box of directions of the corners of pixels x0 … x1 − 1 in rows first … last − 1."""
    for k in range(3):
        low[k], high[k] = np.inf, -np.inf
    for y in range(first, last + 1):
        if view.lattice.size == 0 and first < y < last:
            continue
        corner_row(view, y, above)
        for x in range(x0, x1 + 1):
            for k in range(3):
                low[k], high[k] = min(low[k], above[x, k]), max(high[k], above[x, k])


@njit(cache=True, nogil=True, error_model="numpy")
def _map_range(maps, low, high):  # type: ignore[no-untyped-def]
    """Write the least and largest entries of (n, f, 3, 3) maps."""
    for face in range(maps.shape[1]):
        for row in range(3):
            for column in range(3):
                least = most = maps[0, face, row, column]
                for k in range(1, len(maps)):
                    least, most = min(least, maps[k, face, row, column]), max(most, maps[k, face, row, column])
                low[face, row, column], high[face, row, column] = least, most


@njit(cache=True, nogil=True, error_model="numpy")
def _tile_faces(view, faces, maps, first, last, rays):  # type: ignore[no-untyped-def]
    """Return (tiles, f) candidates, their (tiles,) numbers, and the face that alone covers a tile, else MIXED."""
    n_faces = faces.kinds.size
    low, high = np.empty((n_faces, 3, 3)), np.empty((n_faces, 3, 3))
    _map_range(maps, low, high)
    ray_low, ray_high = np.empty(3), np.empty(3)
    states = np.empty(n_faces, np.int64)
    in_band = np.empty(n_faces, np.int64)
    _tile_box(view, first, last, np.int64(0), view.width, rays, ray_low, ray_high)
    every = np.empty(n_faces, np.int64)
    for face in range(n_faces):
        every[face] = face
    n_band = candidates(low, high, faces.kinds, faces.extents, ray_low, ray_high, every, n_faces, in_band, states)
    tiles = (view.width + TILE - 1) // TILE
    found = np.empty((tiles, n_band), np.int64)
    counts, alone = np.empty(tiles, np.int64), np.empty(tiles, np.int64)
    for tile in range(tiles):
        _tile_box(view, first, last, tile * TILE, min((tile + 1) * TILE, view.width), rays, ray_low, ray_high)
        n = candidates(low, high, faces.kinds, faces.extents, ray_low, ray_high, in_band, n_band, found[tile], states)
        counts[tile] = n
        alone[tile] = MIXED
        if n == 1 and states[0] == COVERS:
            alone[tile] = found[tile, 0]
        if n == 0:
            alone[tile] = NOTHING
    return found, counts, alone


@njit(cache=True, nogil=True, error_model="numpy")
def render_band(view, poses, seen, first, last, out):  # type: ignore[no-untyped-def]
    """Write rows first … last − 1 of the (h, w, channels) picture.

    `poses` is (1, 4, 4), or (h, 4, 4) for a rolling shutter.
    """
    faces = seen.faces
    still = len(poses) == 1
    width = view.width
    above, below = np.empty((width + 1, 3)), np.empty((width + 1, 3))
    owners, previous = np.empty(width, np.int64), np.empty(width, np.int64)
    forget(previous, np.int64(0), width)
    shared = np.empty((out.shape[2], width))
    found, counts, alone = _tile_faces(view, faces, faces.maps if still else faces.maps[first:last], first, last, above)
    most = np.int64(1)
    for tile in range(counts.size):
        most = max(most, counts[tile])
    work = new_work(most)
    depths, states = np.empty((most, 4)), np.empty(most, np.int64)
    chunk = np.empty((4, CHUNK + 1))
    for y in range(first, last):
        place = np.int64(0) if still else y
        corner_row(view, y, above)
        corner_row(view, y + 1, below)
        own_row(faces, place, found, counts, alone, above, below, owners, depths, states)
        if not still:
            forget(previous, np.int64(0), width)
        fill_row(seen, poses[place], place, found, counts, owners, above, below, out[y], previous, shared, chunk, work)


@njit(cache=True, nogil=True, error_model="numpy")
def own_row(faces, place, found, counts, alone, above, below, owners, depths, states):  # type: ignore[no-untyped-def]
    """Write the owner of each pixel of a row: a face, NOTHING, or MIXED."""
    for x in range(owners.size):
        tile = x // TILE
        owners[x] = alone[tile]
        if owners[x] == MIXED:
            maps, candidates_here = faces.maps[place], found[tile]
            owners[x] = pixel_owner(maps, faces, candidates_here, counts[tile], above, below, x, depths, states)


@njit(cache=True, nogil=True, error_model="numpy")
def fill_row(  # type: ignore[no-untyped-def]
    seen, pose, place, found, counts, owners, above, below, row, previous, shared, chunk, work
):
    """Write a row of pixels, in runs of equal owners."""
    x = np.int64(0)
    while x < owners.size:
        owner = owners[x]
        end = x + 1
        while owner != MIXED and end < owners.size and end - x < CHUNK and owners[end] == owner:
            end += 1
        if owner >= 0:
            fill_run(seen, pose, place, owner, above, below, x, end, row, previous, shared, chunk, work)
        else:
            forget(previous, x, end)
        if owner == NOTHING:
            for k in range(x, end):
                for channel in range(row.shape[1]):
                    row[k, channel] = seen.background
        if owner == MIXED:
            tile = x // TILE
            mixed_pixel(seen, pose, place, found[tile], counts[tile], above, below, x, row[x], work)
        x = end


@njit(cache=True, nogil=True, error_model="numpy")
def forget(previous, x0, x1):  # type: ignore[no-untyped-def]
    """Mark that the lower edges of pixels x0 … x1 − 1 were not integrated."""
    for x in range(x0, x1):
        previous[x] = NOTHING


@njit(cache=True, nogil=True, error_model="numpy")
def fill_run(seen, pose, place, face, above, below, x0, x1, row, previous, shared, chunk, work):  # type: ignore[no-untyped-def]
    """Write pixels x0 … x1 − 1 of a row, which `face` fills alone."""
    texture = seen.faces.textures[face]
    if texture >= 0 and seen.faces.fronts[place, face]:
        done = _integrate_run(seen, place, face, above, below, x0, x1, row, previous, shared, chunk)
    else:
        done = True
        for x in range(x0, x1):
            for channel in range(row.shape[1]):
                row[x, channel] = seen.faces.levels[face, channel]
        forget(previous, x0, x1)
    if done and seen.lights.kinds.size == 0:
        return
    for x in range(x0, x1):
        whole_pixel(seen, pose, place, face, above, below, x, row[x], done, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _integrate_run(seen, place, face, above, below, x0, x1, row, previous, shared, chunk):  # type: ignore[no-untyped-def]
    """Write the texture's mean over each footprint; False where depth varies too much within one."""
    maps = seen.faces.maps[place, face]
    n = x1 - x0
    us0, vs0, us1, vs1 = chunk[0], chunk[1], chunk[2], chunk[3]
    for k in range(n + 1):
        w = 1.0 / _dot(maps[2], above[x0 + k])
        us0[k], vs0[k] = _dot(maps[0], above[x0 + k]) * w, _dot(maps[1], above[x0 + k]) * w
        w1 = 1.0 / _dot(maps[2], below[x0 + k])
        us1[k], vs1[k] = _dot(maps[0], below[x0 + k]) * w1, _dot(maps[1], below[x0 + k]) * w1
        if abs(w - w1) > PERSPECTIVE * w:
            forget(previous, x0, x1)
            return False
    last, first = _dot(maps[2], above[x1]), _dot(maps[2], above[x0])
    if abs(last - first) > PERSPECTIVE * n * min(last, first):
        forget(previous, x0, x1)
        return False
    texture = seen.faces.textures[face]
    start, stride, plane = (
        seen.textures.places[texture, 0],
        seen.textures.places[texture, 1],
        seen.textures.places[texture, 2],
    )
    contrast = seen.textures.contrasts[texture]
    across, down, reach = 1, 1, 0.0
    for k in (0, n // 2, n - 1):
        du, dv = us1[k + 1] - us1[k], vs1[k + 1] - vs1[k]
        eu, ev = us1[k] - us0[k], vs1[k] - vs0[k]
        area = abs(du * ev - dv * eu)
        across = max(across, edge_steps(du, dv, area, contrast))
        down = max(down, edge_steps(eu, ev, area, contrast))
        reach = max(reach, max(max(abs(du), abs(dv)), max(abs(eu), abs(ev))))
    for channel in range(row.shape[1]):
        if channel > 0 and plane == 0:
            for x in range(x0, x1):
                row[x, channel] = row[x, 0]
            continue
        first_node = start + channel * plane
        if reach < POINT_FOOTPRINT:
            for k in range(n):
                u, v = (
                    0.25 * (us0[k] + us0[k + 1] + us1[k] + us1[k + 1]),
                    0.25 * (vs0[k] + vs0[k + 1] + vs1[k] + vs1[k + 1]),
                )
                row[x0 + k, channel] = sample(seen.textures.tables, first_node, stride, u, v)
            forget(previous, x0, x1)
            continue
        before = edge_integral(seen.textures.tables, first_node, stride, us0[0], vs0[0], us1[0], vs1[0], down)
        for k in range(n):
            x = x0 + k
            after = edge_integral(
                seen.textures.tables, first_node, stride, us0[k + 1], vs0[k + 1], us1[k + 1], vs1[k + 1], down
            )
            bottom = edge_integral(
                seen.textures.tables, first_node, stride, us1[k], vs1[k], us1[k + 1], vs1[k + 1], across
            )
            if previous[x] == face:
                top = shared[channel, x]
            else:
                top = edge_integral(
                    seen.textures.tables, first_node, stride, us0[k], vs0[k], us0[k + 1], vs0[k + 1], across
                )
            area = 0.5 * ((us1[k + 1] - us0[k]) * (vs1[k] - vs0[k + 1]) - (vs1[k + 1] - vs0[k]) * (us1[k] - us0[k + 1]))
            row[x, channel] = (top + after - bottom - before) / area
            shared[channel, x] = bottom
            before = after
            if channel == row.shape[1] - 1 or plane == 0:
                previous[x] = face
    return True
