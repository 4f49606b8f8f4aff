"""Kernels: convex polygons inside one pixel, cut by straight lines.

A pixel is the unit square (s, t), s right and t down; a cut keeps a + b·s + c·t ≥ 0.
"""

from numba import njit

MAX_VERTICES = 24
MAX_PIECES = 64
EMPTY = 1e-9
"""Pieces smaller than this share of a pixel are dropped."""


@njit(cache=True, nogil=True, error_model="numpy")
def cut(source, n, a, b, c, target):  # type: ignore[no-untyped-def]
    """Write the part of the (n, 2) polygon with a + b·s + c·t ≥ 0 to `target`; return its number of vertices."""
    if n == 0:
        return 0
    m = 0
    s0, t0 = source[n - 1, 0], source[n - 1, 1]
    f0 = a + b * s0 + c * t0
    for k in range(n):
        s1, t1 = source[k, 0], source[k, 1]
        f1 = a + b * s1 + c * t1
        if (f0 < 0.0) != (f1 < 0.0) and m < MAX_VERTICES:
            r = f0 / (f0 - f1)
            target[m, 0] = s0 + r * (s1 - s0)
            target[m, 1] = t0 + r * (t1 - t0)
            m += 1
        if f1 >= 0.0 and m < MAX_VERTICES:
            target[m, 0] = s1
            target[m, 1] = t1
            m += 1
        s0, t0, f0 = s1, t1, f1
    return m


@njit(cache=True, nogil=True, error_model="numpy")
def area_of(polygon, n):  # type: ignore[no-untyped-def]
    """Return the area of the first n vertices, positive whichever way round."""
    total = 0.0
    for k in range(1, n - 1):
        total += (polygon[k, 0] - polygon[0, 0]) * (polygon[k + 1, 1] - polygon[0, 1])
        total -= (polygon[k + 1, 0] - polygon[0, 0]) * (polygon[k, 1] - polygon[0, 1])
    return 0.5 * abs(total)


@njit(cache=True, nogil=True, error_model="numpy")
def copy_polygon(source, n, target):  # type: ignore[no-untyped-def]
    """Copy the first n vertices; slices would do the same and take seconds to compile."""
    for k in range(n):
        target[k, 0], target[k, 1] = source[k, 0], source[k, 1]
