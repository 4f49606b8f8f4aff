"""Kernels: which faces may be visible in each tile, and which face fills a pixel alone.

Tiles first: a face that cannot touch a tile, or lies behind one that covers it, is dropped by interval arithmetic over
the tile's viewing directions. Then pixels: a face that covers all four corners and is in front of every other face
there owns the pixel.
"""

import numpy as np

from peaksim.area.faces import DEPTH
from peaksim.kernel import kernel, part

TILE = 16
"""Width of a tile, px."""
OUTSIDE, TOUCHES, COVERS = 0, 1, 2
"""How a face lies relative to a pixel or tile."""
NOTHING, MIXED = -1, -2
"""Owners of a pixel that shows only background, and of one that shows several faces or a face's edge."""
TIE = 1e-9
"""Faces closer than this share of their depth are in one plane: the later one is visible."""


@part
def box_range(low, high, box):
    """Return the range of m·d over m between low and high (3,) and d between box[:3] and box[3:]."""
    least = most = 0.0
    for k in range(3):
        a, b = low[k] * box[k], low[k] * box[k + 3]
        c, d = high[k] * box[k], high[k] * box[k + 3]
        least += min(min(a, b), min(c, d))
        most += max(max(a, b), max(c, d))
    return least, most


@part
def box_state(ranges, face, box):
    """Return whether a face with sides within `ranges` (2, f, 5, 3) is outside, touches or covers a box."""
    state = COVERS
    for side in range(DEPTH + 1):
        least, most = box_range(ranges[0, face, side], ranges[1, face, side], box)
        if most < 0.0 or most == least == 0.0:
            return OUTSIDE
        if least < 0.0:
            state = TOUCHES
    return state


@part
def in_front(ranges, front, back, box, gaps):
    """Return whether one face is nearer than another along every direction of a box."""
    for k in range(3):
        gaps[0, k] = ranges[0, front, DEPTH, k] - ranges[1, back, DEPTH, k]
        gaps[1, k] = ranges[1, front, DEPTH, k] - ranges[0, back, DEPTH, k]
    least, _ = box_range(gaps[0], gaps[1], box)
    _, deepest = box_range(ranges[0, back, DEPTH], ranges[1, back, DEPTH], box)
    return least > TIE * abs(deepest)


@kernel
def find_faces(ranges, boxes, found, states, counts):
    """Keep those faces of each box of directions that may be visible in it.

    Parameters
    ----------
    ranges
        (2, f, 5, 3) least and largest `Faces.sides` of all faces over the poses.
    boxes
        (t, 6) least and largest directions.
    found, counts
        (t, n) faces of each box and (t,) their number; those that are hidden or outside are removed.
    states
        (t, n) written: how the faces lie relative to the box.
    """
    gaps = np.empty((2, 3))
    for tile in range(boxes.shape[0]):
        m = 0
        for k in range(counts[tile]):
            face = found[tile, k]
            state = box_state(ranges, face, boxes[tile])
            if state != OUTSIDE:
                found[tile, m] = face
                states[tile, m] = state
                m += 1
        kept = 0
        for k in range(m):
            hidden = False
            for other in range(m):
                if not hidden and (other < kept or other > k) and states[tile, other] == COVERS:
                    hidden = in_front(ranges, found[tile, other], found[tile, k], boxes[tile], gaps)
            if not hidden:
                found[tile, kept] = found[tile, k]
                states[tile, kept] = states[tile, k]
                kept += 1
        counts[tile] = kept


@part
def pixel_state(sides, pose, face, rays, y, x, depths, k):
    """Return whether a face is outside, touches or covers a pixel; write its depths w at the corners to depths[k]."""
    state = COVERS
    for side in range(DEPTH + 1):
        a, b, c = sides[pose, face, side, 0], sides[pose, face, side, 1], sides[pose, face, side, 2]
        outside = 0
        for corner in range(4):
            i, j = y + corner // 2, x + corner % 2
            value = a * rays[i, j, 0] + b * rays[i, j, 1] + c * rays[i, j, 2]
            outside += value < 0.0
            depths[k, corner] = value
        if outside == 4:
            return OUTSIDE
        if outside > 0:
            state = TOUCHES
    return OUTSIDE if a == b == c == 0.0 else state


@part
def hides(depths, front, back, later):
    """Return whether a covering face is in front of another one at all four corners of a pixel."""
    for corner in range(4):
        gap = depths[front, corner] - depths[back, corner]
        tie = TIE * abs(depths[back, corner])
        if gap < -tie or (gap <= tie and not later):
            return False
    return True


@part
def pixel_owner(sides, pose, found, n, rays, y, x, depths, states):
    """Return which of the first n faces of `found` alone fills a pixel, NOTHING, or MIXED."""
    owner = NOTHING
    for k in range(n):
        states[k] = pixel_state(sides, pose, found[k], rays, y, x, depths, k)
        if states[k] != OUTSIDE:
            owner = MIXED
    for k in range(n):
        alone = states[k] == COVERS
        for other in range(n):
            if alone and other != k and states[other] != OUTSIDE:
                alone = hides(depths, k, other, found[k] > found[other])
        if alone:
            return found[k]
    return owner


@kernel
def find_owners(rays, sides, cells, found, counts, alone, owners):
    """Write the owner of each pixel of a band.

    Parameters
    ----------
    rays
        (h + 1, w + 1, 3) directions of the pixel corners.
    sides
        (1 or h, f, 5, 3) as in `FaceViews`.
    cells
        (h, w) row of `found` that lists the faces a pixel may show.
    found, counts
        (t, n) and (t,) faces of each cell, and their number.
    alone
        (t,) owner of all pixels of a cell, MIXED where each pixel must be examined.
    owners
        (h, w) written.
    """
    depths, states = np.empty((found.shape[1], 4)), np.empty(found.shape[1], np.int64)
    for y in range(owners.shape[0]):
        pose = y if sides.shape[0] > 1 else 0
        for x in range(owners.shape[1]):
            cell = cells[y, x]
            owner = alone[cell]
            if owner == MIXED:
                owner = pixel_owner(sides, pose, found[cell], counts[cell], rays, y, x, depths, states)
            owners[y, x] = owner
