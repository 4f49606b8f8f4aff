"""Kernel: pixels that several faces share, cut into the visible pieces of each.

The visible part of a face is the pixel within its sides, less, for every other face, the region within that one's
sides where it is nearer. Depth w is linear over a pixel, so that region is convex, however faces overlap or
intersect; a subtraction leaves convex pieces again.
"""

import numpy as np

from peaksim.area.faces import DEPTH
from peaksim.area.owner import MIXED, TIE
from peaksim.area.polygon import EMPTY, MAX_VERTICES, area_of, copy_polygon, cut_polygon
from peaksim.kernel import kernel, part

MAX_PIECES = 64
"""Most pieces of one face in a pixel; further ones are dropped."""
ROW, COLUMN, FACE, SIZE = 0, 1, 2, 3
"""Columns of a list of pieces: pixel, face, number of vertices."""


@part
def measure_faces(sides, pose, found, n, rays, y, x, faces, lines):
    """List those of n faces that reach into a pixel; return their number.

    Writes `faces`, and the lines (n, 5, 3) of their sides and depth over the pixel (exact for a pinhole).
    """
    kept = 0
    for k in range(n):
        outside = False
        for side in range(DEPTH + 1):
            a = b = c = 0.0
            for axis in range(3):
                m = sides[pose, found[k], side, axis]
                r00, r10 = rays[y, x, axis], rays[y, x + 1, axis]
                r01, r11 = rays[y + 1, x, axis], rays[y + 1, x + 1, axis]
                a += 0.25 * m * (r00 + r10 + r01 + r11)
                b += 0.5 * m * (r10 - r00 + r11 - r01)
                c += 0.5 * m * (r01 - r00 + r11 - r10)
            outside = outside or a + 0.5 * (abs(b) + abs(c)) <= 0.0
            lines[kept, side, 0] = a - 0.5 * (b + c)
            lines[kept, side, 1] = b
            lines[kept, side, 2] = c
        if not outside:
            faces[kept] = found[k]
            kept += 1
    return kept


@part
def nearer_sides(lines, front, back, later, cutter):
    """Write the lines around the region where one face lies before another; return their number, 0 for nowhere."""
    least, most, deepest = np.inf, -np.inf, 0.0
    for side in range(DEPTH + 1):
        for k in range(3):
            cutter[side, k] = lines[front, side, k] - (lines[back, side, k] if side == DEPTH else 0.0)
    for corner in range(4):
        s, t = corner % 2, corner // 2
        gap = cutter[DEPTH, 0] + cutter[DEPTH, 1] * s + cutter[DEPTH, 2] * t
        least, most = min(least, gap), max(most, gap)
        deepest = max(deepest, abs(lines[back, DEPTH, 0] + lines[back, DEPTH, 1] * s + lines[back, DEPTH, 2] * t))
    tie = TIE * deepest
    if most <= tie and (least < -tie or not later):
        return 0
    return DEPTH if least >= -tie else DEPTH + 1


@part
def subtract_region(pool, sizes, source, target, n, cutter, n_sides):
    """Remove a convex region from n pieces at `source`; write what is left from `target` on, return its number."""
    m = 0
    rest, other = pool.shape[0] - 2, pool.shape[0] - 1
    for k in range(n):
        first = m
        copy_polygon(pool, sizes, source + k, rest)
        for side in range(n_sides):
            if sizes[rest] > 2 and m < MAX_PIECES:
                cut_polygon(pool, sizes, rest, cutter[side], -1.0, target + m)
                m += abs(area_of(pool, target + m, sizes[target + m])) > EMPTY
                cut_polygon(pool, sizes, rest, cutter[side], 1.0, other)
                rest, other = other, rest
        if abs(area_of(pool, rest, sizes[rest])) <= EMPTY:
            m = first + 1  # nothing was removed: the piece stays whole
            copy_polygon(pool, sizes, source + k, target + first)
    return m


@part
def visible_pieces(lines, faces, n, k, cutter, pool, sizes):
    """Cut candidate k of n out of the pixel; return where in the pool its pieces begin, and their number."""
    here = sizes.size - sizes.size
    there, scratch = here + MAX_PIECES, here + 2 * MAX_PIECES
    sizes[here] = 4
    for corner in range(4):
        pool[here, corner, 0] = (corner + 1) // 2 % 2
        pool[here, corner, 1] = corner // 2
    for side in range(DEPTH):
        if sizes[here] > 2:
            cut_polygon(pool, sizes, here, lines[k, side], 1.0, scratch)
            copy_polygon(pool, sizes, scratch, here)
    m = int(abs(area_of(pool, here, sizes[here])) > EMPTY)
    for other in range(n):
        if other != k and m > 0:
            n_sides = nearer_sides(lines, other, k, faces[other] > faces[k], cutter)
            if n_sides > 0:
                m = subtract_region(pool, sizes, here, there, m, cutter, n_sides)
                here, there = there, here
    return here, m


@part
def keep_piece(lines, k, pool, source, n, polygons, target):
    """Write a piece of candidate k in the face's coordinates; return its share of the pixel."""
    for v in range(n):
        s, t = pool[source, v, 0], pool[source, v, 1]
        w = lines[k, DEPTH, 0] + lines[k, DEPTH, 1] * s + lines[k, DEPTH, 2] * t
        for axis in range(2):
            polygons[target, v, axis] = (lines[k, axis, 0] + lines[k, axis, 1] * s + lines[k, axis, 2] * t) / w
    return abs(area_of(pool, source, n))


@kernel
def cut_mixed(rays, sides, owners, cells, found, counts, background, first, polygons, pieces, shares, out):
    """List the visible pieces of all MIXED pixels of a band from pixel `first` on, and add background where none is.

    Parameters
    ----------
    rays, sides, owners, cells, found, counts
        As in `find_owners`.
    background
        Level where nothing is.
    first
        Row-major number of the pixel to begin with.
    polygons, pieces, shares
        (p, MAX_VERTICES, 2), (p, 4) and (p,) written: each piece in the coordinates of its face (texels), its pixel,
        face and size, and its share of the pixel.
    out
        (h, w, channels) background added.

    Returns
    -------
    n, next
        Number of pieces; the pixel to continue with if the lists were full, else h·w.
    """
    n_pieces = 0
    faces, lines = np.empty(found.shape[1], np.int64), np.empty((found.shape[1], DEPTH + 1, 3))
    cutter = np.empty((DEPTH + 1, 3))
    pool, sizes = np.empty((2 * MAX_PIECES + 2, MAX_VERTICES, 2)), np.empty(2 * MAX_PIECES + 2, np.int64)
    for pixel in range(first, owners.size):
        y, x = pixel // owners.shape[1], pixel % owners.shape[1]
        if owners[y, x] == MIXED:
            cell, pose = cells[y, x], y if sides.shape[0] > 1 else 0
            n = counts[cell]
            if n_pieces + n * MAX_PIECES > shares.size:
                return n_pieces, pixel
            n = measure_faces(sides, pose, found[cell], n, rays, y, x, faces, lines)
            bare = 1.0
            for k in range(n):
                start, m = visible_pieces(lines, faces, n, k, cutter, pool, sizes)
                for piece in range(start, start + m):
                    shares[n_pieces] = keep_piece(lines, k, pool, piece, sizes[piece], polygons, n_pieces)
                    bare -= shares[n_pieces]
                    pieces[n_pieces, ROW], pieces[n_pieces, COLUMN] = y, x
                    pieces[n_pieces, FACE], pieces[n_pieces, SIZE] = faces[k], sizes[piece]
                    n_pieces += 1
            for channel in range(out.shape[2]):
                out[y, x, channel] += max(bare, 0.0) * background
    return n_pieces, owners.size
