"""Kernel parts: convex polygons inside one pixel, cut by straight lines.

A pixel is the unit square (s, t), s right and t down. Polygons lie in a pool (p, MAX_VERTICES, 2), their numbers of
vertices in `sizes` (p,). A cut keeps a + b·s + c·t ≥ 0, a line of its three coefficients.
"""

from peaksim.kernel import part

MAX_VERTICES = 24
"""Each cut adds one vertex at most; further ones are dropped."""
EMPTY = 1e-9
"""Pieces smaller than this share of a pixel are dropped."""


@part
def copy_polygon(pool, sizes, source, target):
    """Copy a polygon."""
    sizes[target] = sizes[source]
    for k in range(sizes[source]):
        for axis in range(2):
            pool[target, k, axis] = pool[source, k, axis]


@part
def cut_polygon(pool, sizes, source, line, sign, target):
    """Write the part of a polygon on one side of a line to another one (Sutherland and Hodgman 1974)."""
    n, m = sizes[source], 0
    before = 0.0
    for k in range(n + 1):
        s, t = pool[source, k % n, 0], pool[source, k % n, 1]
        here = sign * (line[0] + line[1] * s + line[2] * t)
        if k > 0 and (before < 0.0) != (here < 0.0) and m < MAX_VERTICES:
            r = before / (before - here)
            pool[target, m, 0] = pool[source, k - 1, 0] + r * (s - pool[source, k - 1, 0])
            pool[target, m, 1] = pool[source, k - 1, 1] + r * (t - pool[source, k - 1, 1])
            m += 1
        if k < n and here >= 0.0 and m < MAX_VERTICES:
            pool[target, m, 0] = s
            pool[target, m, 1] = t
            m += 1
        before = here
    sizes[target] = m


@part
def area_of(polygons, k, n):
    """Return the signed area of the n vertices of polygon k."""
    total = 0.0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        total += (polygons[k, i, 0] - polygons[k, 0, 0]) * (polygons[k, j, 1] - polygons[k, 0, 1])
        total -= (polygons[k, j, 0] - polygons[k, 0, 0]) * (polygons[k, i, 1] - polygons[k, 0, 1])
    return 0.5 * total
