"""Kernels: the mean of a texture over a polygon, from line integrals along its edges.

By Green's theorem ∬ T du dv over a polygon is the sum over its edges of ∫ P dv with P(u, v) = ∫₀ᵘ T. Each edge is
walked in a few steps; a step is integrated exactly in v at its middle u, two evaluations of the biquadratic double
antiderivative of the texture (`Texture.tables`). What is left is the staircase of triangles along slanted edges, and
the number of steps keeps that below the error budget.
"""

from numba import njit

STEPS_PER_CONTRAST = 0.236
"""Steps^1.5 of an edge for each grey level of texture contrast and unit of slant: budget of 0.3 grey levels rms."""
STEPS_PER_TEXEL = 1.5
"""More steps than this gain nothing: between texel centres the texture is smooth."""
POINT_FOOTPRINT = 0.01
"""Footprints smaller than this many texels are sampled at their middle: the texture is linear there."""


@njit(cache=True, nogil=True, inline="always")
def _row(tables, node, u0, u1, u2):  # type: ignore[no-untyped-def]
    return u0 * tables[node] + u1 * tables[node + 1] + u2 * tables[node + 2]


@njit(cache=True, nogil=True, error_model="numpy")
def edge_integral(tables, start, stride, u0, v0, u1, v1, steps):  # type: ignore[no-untyped-def]
    """Return ∫ P dv along the straight edge from (u0, v0) to (u1, v1), texels, up to terms that cancel in a loop."""
    du, dv = (u1 - u0) / steps, (v1 - v0) / steps
    total = 0.0
    for k in range(steps):
        u = u0 + (k + 0.5) * du
        i = int(u + 0.5)
        f = u - i
        a0, a1, a2 = 0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)
        v = v0 + k * dv
        j = int(v + 0.5)
        f = v - j
        node = start + j * stride + i
        low = (
            0.5 * (0.5 - f) * (0.5 - f) * _row(tables, node, a0, a1, a2)
            + (0.75 - f * f) * _row(tables, node + stride, a0, a1, a2)
            + 0.5 * (0.5 + f) * (0.5 + f) * _row(tables, node + 2 * stride, a0, a1, a2)
        )
        v += dv
        j = int(v + 0.5)
        f = v - j
        node = start + j * stride + i
        high = (
            0.5 * (0.5 - f) * (0.5 - f) * _row(tables, node, a0, a1, a2)
            + (0.75 - f * f) * _row(tables, node + stride, a0, a1, a2)
            + 0.5 * (0.5 + f) * (0.5 + f) * _row(tables, node + 2 * stride, a0, a1, a2)
        )
        total += high - low
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def edge_steps(du, dv, area, contrast):  # type: ignore[no-untyped-def]
    """Return how many steps an edge of (du, dv) texels around a footprint of `area` texels² needs."""
    most = STEPS_PER_TEXEL * max(abs(du), abs(dv)) + 1.0
    slant = STEPS_PER_CONTRAST * contrast * abs(du * dv)
    if slant >= area * most**1.5:
        return int(most) + 1
    return int((slant / area) ** (2.0 / 3.0)) + 1


@njit(cache=True, nogil=True, error_model="numpy")
def texel(tables, start, stride, i, j):  # type: ignore[no-untyped-def]
    """Return the texel (i, j), −1 … n, from the table."""
    node = start + (j + 1) * stride + i + 1
    return tables[node] - tables[node + 1] - tables[node + stride] + tables[node + stride + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def sample(tables, start, stride, u, v):  # type: ignore[no-untyped-def]
    """Return the bilinear texture at (u, v) texels."""
    i, j = int(u + 0.5) - 1, int(v + 0.5) - 1
    f, g = u - 0.5 - i, v - 0.5 - j
    above = (1 - f) * texel(tables, start, stride, i, j) + f * texel(tables, start, stride, i + 1, j)
    below = (1 - f) * texel(tables, start, stride, i, j + 1) + f * texel(tables, start, stride, i + 1, j + 1)
    return (1 - g) * above + g * below


@njit(cache=True, nogil=True, error_model="numpy")
def polygon_mean(tables, start, stride, contrast, us, vs, n):  # type: ignore[no-untyped-def]
    """Return the mean of a texture over the polygon of the first `n` vertices (us, vs), texels."""
    area = 0.0
    mid_u = mid_v = 0.0
    reach = 0.0
    for k in range(n):
        m = k + 1 if k + 1 < n else 0
        area += 0.5 * ((us[k] - us[0]) * (vs[m] - vs[0]) - (us[m] - us[0]) * (vs[k] - vs[0]))
        mid_u += us[k] / n
        mid_v += vs[k] / n
        reach = max(reach, max(abs(us[m] - us[k]), abs(vs[m] - vs[k])))
    if reach < POINT_FOOTPRINT or abs(area) < 1e-6 * reach * reach:
        return sample(tables, start, stride, mid_u, mid_v)
    total = 0.0
    for k in range(n):
        m = k + 1 if k + 1 < n else 0
        steps = edge_steps(us[m] - us[k], vs[m] - vs[k], abs(area), contrast)
        total += edge_integral(tables, start, stride, us[k], vs[k], us[m], vs[m], steps)
    return total / area
