"""Kernel parts: the mean of a texture over a polygon, from line integrals along its edges.

By Green's theorem ∬ T du dv over a polygon is the sum over its edges of ∫ P dv with P(u, v) = ∫₀ᵘ T. Each edge is
divided into a few steps; a step is integrated exactly in v at its middle u, two evaluations of the biquadratic double
antiderivative of the texture (`texture_sums`). What is left is the staircase of triangles along slanted edges, and
the number of steps keeps that below the error budget.
"""

from peaksim.kernel import part

STEPS_PER_CONTRAST = 0.236
"""Steps^1.5 of an edge for each grey level of texture contrast and unit of slant, for 0.3 grey levels rms.

`benchmarks/fidelity_render.py` measures what comes of it."""
STEPS_PER_TEXEL = 3.0
"""More steps than this gain nothing: between texel centres the texture is smooth."""
POINT = 0.01
"""Half the side of the box, texels, that stands for smaller footprints: the texture is linear there."""


@part
def edge_integral(texels, start, stride, u0, v0, u1, v1, steps):
    """Return ∫ P dv along the straight edge from (u0, v0) to (u1, v1), texels, up to terms that cancel in a loop."""
    total = 0.0
    for k in range(steps):
        u = u0 + (k + 0.5) / steps * (u1 - u0)
        i = int(u + 0.5)
        f = u - i
        a0, a1, a2 = 0.5 * (0.5 - f) ** 2, 0.75 - f * f, 0.5 * (0.5 + f) ** 2
        for end in range(2):
            v = v0 + (k + end) / steps * (v1 - v0)
            j = int(v + 0.5)
            f = v - j
            n0 = start + j * stride + i
            n1, n2 = n0 + stride, n0 + 2 * stride
            value = 0.5 * (0.5 - f) ** 2 * (a0 * texels[n0] + a1 * texels[n0 + 1] + a2 * texels[n0 + 2])
            value += (0.75 - f * f) * (a0 * texels[n1] + a1 * texels[n1 + 1] + a2 * texels[n1 + 2])
            value += 0.5 * (0.5 + f) ** 2 * (a0 * texels[n2] + a1 * texels[n2 + 1] + a2 * texels[n2 + 2])
            total += value if end else -value
    return total


@part
def edge_steps(du, dv, area, contrast):
    """Return how many steps an edge of (du, dv) texels around a footprint of `area` texels² needs."""
    most = STEPS_PER_TEXEL * max(abs(du), abs(dv)) + 1.0
    slant = STEPS_PER_CONTRAST * contrast * abs(du * dv)
    return int(most if slant >= area * most**1.5 else (slant / area) ** (2.0 / 3.0)) + 1


@part
def point_mean(texels, start, stride, u, v):
    """Return the mean over a box so small that the texture is linear in it."""
    total = 0.0
    for end in range(2):
        side = (2 * end - 1) * POINT
        total += edge_integral(texels, start, stride, u + side, v - side, u + side, v + side, end // 2 + 1)
    return total / (4.0 * POINT * POINT)
