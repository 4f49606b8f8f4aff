"""Kernels: one pixel that several faces share, cut into the visible piece of each."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peaksim.area_light import light_at
from peaksim.area_polygon import EMPTY, MAX_PIECES, MAX_VERTICES, area_of, copy_polygon, cut
from peaksim.area_texture import polygon_mean
from peaksim.faces import QUAD

TIE = 1e-9
"""Faces closer than this share of their depth are in one plane: the later one is seen."""
PERSPECTIVE = 0.02
"""A piece over which depth varies by more than this share is integrated in slabs."""
MAX_SLABS = 64
SHADOW_SAMPLES = 32
MAX_FACES = 32
"""Faces that one pixel can show; of more, the nearest at its middle."""


class Work(NamedTuple):
    """Memory for one pixel's polygons."""

    maps: NDArray[np.float64]
    sides: NDArray[np.float64]
    rays: NDArray[np.float64]
    axis: NDArray[np.float64]
    cutter: NDArray[np.float64]
    square: NDArray[np.float64]
    slab_a: NDArray[np.float64]
    slab_b: NDArray[np.float64]
    pieces: NDArray[np.float64]
    sizes: NDArray[np.int64]
    fresh: NDArray[np.float64]
    fresh_sizes: NDArray[np.int64]
    scratch: NDArray[np.float64]
    us: NDArray[np.float64]
    vs: NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy")
def new_work(n):  # type: ignore[no-untyped-def]
    """Return memory for pixels of up to n faces."""
    vertices = MAX_VERTICES
    return Work(
        np.empty((n, 3, 3)), np.empty((n, 4, 3)), np.empty((3, 3)), np.empty(3), np.empty((5, 3)),
        np.empty((vertices, 2)), np.empty((vertices, 2)), np.empty((vertices, 2)),
        np.empty((MAX_PIECES, vertices, 2)), np.empty(MAX_PIECES, np.int64),
        np.empty((MAX_PIECES, vertices, 2)), np.empty(MAX_PIECES, np.int64),
        np.empty((2, vertices, 2)), np.empty(vertices), np.empty(vertices),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def affine(row, above, below, x, out):  # type: ignore[no-untyped-def]
    """Write a, b, c of row·d ≈ a + b·s + c·t over pixel x (exact for a pinhole)."""
    f00 = row[0] * above[x, 0] + row[1] * above[x, 1] + row[2] * above[x, 2]
    f10 = row[0] * above[x + 1, 0] + row[1] * above[x + 1, 1] + row[2] * above[x + 1, 2]
    f01 = row[0] * below[x, 0] + row[1] * below[x, 1] + row[2] * below[x, 2]
    f11 = row[0] * below[x + 1, 0] + row[1] * below[x + 1, 1] + row[2] * below[x + 1, 2]
    out[1] = 0.5 * ((f10 - f00) + (f11 - f01))
    out[2] = 0.5 * ((f01 - f00) + (f11 - f10))
    out[0] = 0.25 * (f00 + f10 + f01 + f11) - 0.5 * (out[1] + out[2])


@njit(cache=True, nogil=True, error_model="numpy")
def sides_of(maps, kind, extents, out):  # type: ignore[no-untyped-def]
    """Write the four half-planes of a face from its (3, 3) affine p, q, w."""
    for k in range(3):
        p, q, w = maps[0, k], maps[1, k], maps[2, k]
        out[0, k], out[1, k] = p, q
        out[2, k] = extents[0] * w - p if kind == QUAD else w - p - q
        out[3, k] = extents[1] * w - q if kind == QUAD else w


@njit(cache=True, nogil=True, error_model="numpy")
def subtract(pieces, sizes, n, sides, n_sides, fresh, fresh_sizes, scratch):  # type: ignore[no-untyped-def]
    """Remove the convex region within `sides` from n pieces; write what is left to `fresh`, return its number."""
    m = 0
    for k in range(n):
        first = m
        rest, other = scratch[0], scratch[1]
        size = sizes[k]
        copy_polygon(pieces[k], size, rest)
        for side in range(n_sides):
            a, b, c = sides[side, 0], sides[side, 1], sides[side, 2]
            if m < MAX_PIECES:
                out = cut(rest, size, -a, -b, -c, fresh[m])
                if out > 2 and area_of(fresh[m], out) > EMPTY:
                    fresh_sizes[m] = out
                    m += 1
            size = cut(rest, size, a, b, c, other)
            rest, other = other, rest
            if size < 3:
                break
        if size < 3 or area_of(rest, size) <= EMPTY:
            # nothing was taken away: keep the piece whole
            m = first
            if m < MAX_PIECES:
                copy_polygon(pieces[k], sizes[k], fresh[m])
                fresh_sizes[m] = sizes[k]
                m += 1
    return m


@njit(cache=True, nogil=True, error_model="numpy")
def place_of(pose, ray, w, place):  # type: ignore[no-untyped-def]
    """Write the world point ray / w of a camera."""
    for k in range(3):
        place[k] = pose[k, 3] + (pose[k, 0] * ray[0] + pose[k, 1] * ray[1] + pose[k, 2] * ray[2]) / w


@njit(cache=True, nogil=True, error_model="numpy")
def light_of_piece(scene, pose, face, rays, depth, polygon, n):  # type: ignore[no-untyped-def]
    """Return the mean multiplier over a piece of a pixel: at its middle, finer where a shadow's edge crosses it.

    `rays` (3, 3) and `depth` (3,) are affine over the pixel.
    """
    if scene.lights.kinds.size == 0:
        return 1.0
    ray, place = np.empty(3), np.empty(3)
    mid_s = mid_t = 0.0
    for k in range(n):
        mid_s += polygon[k, 0] / n
        mid_t += polygon[k, 1] / n
    middle = _light_in_pixel(scene, pose, face, rays, depth, mid_s, mid_t, ray, place)
    if scene.solids.ids.size == 0:
        return middle
    least = most = middle
    for k in range(n):
        s, t = mid_s + 0.98 * (polygon[k, 0] - mid_s), mid_t + 0.98 * (polygon[k, 1] - mid_t)
        value = _light_in_pixel(scene, pose, face, rays, depth, s, t, ray, place)
        least, most = min(least, value), max(most, value)
    if most - least <= 0.02 * most:
        return middle
    total = 0.0
    for k in range(1, n - 1):
        total += _light_over_triangle(scene, pose, face, rays, depth, polygon, k, ray, place)
    return total / area_of(polygon, n)


@njit(cache=True, nogil=True, error_model="numpy")
def _light_over_triangle(scene, pose, face, rays, depth, polygon, k, ray, place):  # type: ignore[no-untyped-def]
    """Return ∫ of the multiplier over triangle (0, k, k + 1) of a polygon, by SHADOW_SAMPLES points."""
    s0, t0 = polygon[0, 0], polygon[0, 1]
    s1, t1 = polygon[k, 0] - s0, polygon[k, 1] - t0
    s2, t2 = polygon[k + 1, 0] - s0, polygon[k + 1, 1] - t0
    total = 0.0
    for i in range(SHADOW_SAMPLES):
        a = (i + 0.5) / SHADOW_SAMPLES
        b = (i * 0.6180339887498949 + 0.5) % 1.0
        if a + b > 1.0:
            a, b = 1.0 - a, 1.0 - b
        total += _light_in_pixel(scene, pose, face, rays, depth, s0 + a * s1 + b * s2, t0 + a * t1 + b * t2, ray, place)
    return total / SHADOW_SAMPLES * 0.5 * abs(s1 * t2 - s2 * t1)


@njit(cache=True, nogil=True, error_model="numpy")
def _light_in_pixel(scene, pose, face, rays, depth, s, t, ray, place):  # type: ignore[no-untyped-def]
    for k in range(3):
        ray[k] = rays[k, 0] + rays[k, 1] * s + rays[k, 2] * t
    place_of(pose, ray, depth[0] + depth[1] * s + depth[2] * t, place)
    return light_at(scene.lights, scene.solids, place, scene.faces.normals[face], pose[:3, 3])


@njit(cache=True, nogil=True, error_model="numpy")
def add_piece(scene, place, face, maps, polygon, n, weight, out, us, vs):  # type: ignore[no-untyped-def]
    """Add weight × the mean of a face over a polygon of the pixel to `out` (channels,)."""
    texture = scene.faces.textures[face]
    if texture < 0 or not scene.faces.fronts[place, face]:
        for channel in range(out.size):
            out[channel] += weight * scene.faces.levels[face, channel]
        return
    for k in range(n):
        s, t = polygon[k, 0], polygon[k, 1]
        w = maps[2, 0] + maps[2, 1] * s + maps[2, 2] * t
        us[k] = min(max((maps[0, 0] + maps[0, 1] * s + maps[0, 2] * t) / w, 0.0), scene.faces.extents[face, 0])
        vs[k] = min(max((maps[1, 0] + maps[1, 1] * s + maps[1, 2] * t) / w, 0.0), scene.faces.extents[face, 1])
    start, stride, plane = (
        scene.textures.places[texture, 0],
        scene.textures.places[texture, 1],
        scene.textures.places[texture, 2],
    )
    value = 0.0
    for channel in range(out.size):
        if channel == 0 or plane > 0:
            value = polygon_mean(
                scene.textures.tables, start + channel * plane, stride, scene.textures.contrasts[texture], us, vs, n
            )
        out[channel] += weight * value


@njit(cache=True, nogil=True, error_model="numpy")
def add_in_slabs(scene, place, face, maps, polygon, n, weight, out, work):  # type: ignore[no-untyped-def]
    """Add weight × the mean over a polygon, in slabs of nearly constant depth, so that image area is what counts."""
    nearest = farthest = maps[2, 0] + maps[2, 1] * polygon[0, 0] + maps[2, 2] * polygon[0, 1]
    for k in range(1, n):
        w = maps[2, 0] + maps[2, 1] * polygon[k, 0] + maps[2, 2] * polygon[k, 1]
        nearest, farthest = max(nearest, w), min(farthest, w)
    if farthest <= nearest * 1e-9:
        farthest = nearest * 1e-9
    slabs = min(int(np.log(nearest / farthest) / PERSPECTIVE) + 1, MAX_SLABS)
    if slabs == 1 or scene.faces.textures[face] < 0:
        add_piece(scene, place, face, maps, polygon, n, weight, out, work.us, work.vs)
        return
    whole = area_of(polygon, n)
    ratio = (nearest / farthest) ** (1.0 / slabs)
    for k in range(slabs):
        near = nearest * ratio ** (-k) if k > 0 else nearest * 2.0
        far = nearest * ratio ** (-k - 1) if k < slabs - 1 else -nearest
        size = cut(polygon, n, near - maps[2, 0], -maps[2, 1], -maps[2, 2], work.slab_a)
        size = cut(work.slab_a, size, maps[2, 0] - far, maps[2, 1], maps[2, 2], work.slab_b)
        if size > 2:
            share = area_of(work.slab_b, size) / whole
            add_piece(scene, place, face, maps, work.slab_b, size, weight * share, out, work.us, work.vs)


@njit(cache=True, nogil=True, error_model="numpy")
def mixed_pixel(scene, pose, place, found, n, above, below, x, out, work):  # type: ignore[no-untyped-def]
    """Write the area integral of pixel x, shared by the first n faces in `found`, to `out` (channels,)."""
    faces = scene.faces
    for k in range(n):
        for row in range(3):
            affine(faces.maps[place, found[k], row], above, below, x, work.maps[k, row])
        sides_of(work.maps[k], faces.kinds[found[k]], faces.extents[found[k]], work.sides[k])
    for row in range(3):
        for k in range(3):
            work.axis[k] = 1.0 if k == row else 0.0
        affine(work.axis, above, below, x, work.rays[row])
    for channel in range(out.size):
        out[channel] = 0.0
    covered = 0.0
    for k in range(n):
        m = _visible_pieces(faces, found, n, k, work)
        for piece in range(m):
            polygon, size = work.pieces[piece], work.sizes[piece]
            share = area_of(polygon, size)
            light = light_of_piece(scene, pose, found[k], work.rays, work.maps[k, 2], polygon, size)
            add_in_slabs(scene, place, found[k], work.maps[k], polygon, size, share * light, out, work)
            covered += share
    for channel in range(out.size):
        out[channel] += max(1.0 - covered, 0.0) * scene.background


@njit(cache=True, nogil=True, error_model="numpy")
def _visible_pieces(faces, found, n, k, work):  # type: ignore[no-untyped-def]
    """Write the visible pieces of candidate k to work.pieces and work.sizes; return their number."""
    _unit_square(work.square)
    size = np.int64(4)  # a plain 4 would compile every function below twice, once for the literal
    source, target = work.square, work.slab_a
    for side in range(4):
        size = cut(source, size, work.sides[k, side, 0], work.sides[k, side, 1], work.sides[k, side, 2], target)
        source, target = (work.slab_a, work.slab_b) if side % 2 == 0 else (work.slab_b, work.slab_a)
    if size < 3 or area_of(source, size) <= EMPTY:
        return 0
    copy_polygon(source, size, work.pieces[0])
    work.sizes[0] = size
    m = np.int64(1)
    for other in range(n):
        if other == k or m == 0:
            continue
        n_sides = _nearer_sides(work.maps[other], work.maps[k], work.sides[other], found[other] > found[k], work.cutter)
        if n_sides == 0:
            continue
        m = subtract(work.pieces, work.sizes, m, work.cutter, n_sides, work.fresh, work.fresh_sizes, work.scratch)
        for piece in range(m):
            copy_polygon(work.fresh[piece], work.fresh_sizes[piece], work.pieces[piece])
            work.sizes[piece] = work.fresh_sizes[piece]
    return m


@njit(cache=True, nogil=True, error_model="numpy")
def _nearer_sides(front, back, sides, later, cutter):  # type: ignore[no-untyped-def]
    """Write the half-planes of the region where one face lies before another; return their number, 0 for nowhere."""
    least, most, deepest = np.inf, -np.inf, 0.0
    for corner in range(4):
        s, t = float(corner % 2), float(corner // 2)
        w = back[2, 0] + back[2, 1] * s + back[2, 2] * t
        gap = front[2, 0] + front[2, 1] * s + front[2, 2] * t - w
        least, most, deepest = min(least, gap), max(most, gap), max(deepest, abs(w))
    tie = TIE * deepest
    if most <= tie and (least < -tie or not later):
        return 0
    for k in range(3):
        for side in range(4):
            cutter[side, k] = sides[side, k]
        cutter[4, k] = front[2, k] - back[2, k]
    if least >= -tie:
        return 4
    return 5


@njit(cache=True, nogil=True, error_model="numpy")
def _unit_square(polygon):  # type: ignore[no-untyped-def]
    for corner in range(4):
        polygon[corner, 0] = 1.0 if corner in (1, 2) else 0.0
        polygon[corner, 1] = 1.0 if corner in (2, 3) else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def whole_pixel(scene, pose, place, face, above, below, x, out, done, work):  # type: ignore[no-untyped-def]
    """Light a pixel that one face fills; integrate it in slabs first unless that is `done`."""
    for row in range(3):
        affine(scene.faces.maps[place, face, row], above, below, x, work.maps[0, row])
        for k in range(3):
            work.axis[k] = 1.0 if k == row else 0.0
        affine(work.axis, above, below, x, work.rays[row])
    _unit_square(work.square)
    light = light_of_piece(scene, pose, face, work.rays, work.maps[0, 2], work.square, np.int64(4))
    if done:
        for channel in range(out.size):
            out[channel] *= light
        return
    for channel in range(out.size):
        out[channel] = 0.0
    add_in_slabs(scene, place, face, work.maps[0], work.square, np.int64(4), light, out, work)
