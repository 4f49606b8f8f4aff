/* The mean of a texture over a polygon, from line integrals along its edges.

   By Green's theorem ∬ T du dv over a polygon is the sum over its edges of ∫ P dv with P(u, v) = ∫₀ᵘ T. Each edge is
   divided into a few steps; a step is integrated exactly in v at its middle u, by two evaluations of the biquadratic
   double antiderivative of the texture (peaksim.area.texture_sums). What is left is the staircase of triangles along slanted
   edges, and the number of steps keeps that below the error budget. */

#ifndef PEAKSIM_AREA_TEXTURE_H
#define PEAKSIM_AREA_TEXTURE_H

#include "area.h"

/* Steps^1.5 of an edge for each grey level of texture contrast and unit of slant, for 0.3 grey levels rms;
   `benchmarks/fidelity_render.py` measures what comes of it. */
#define STEPS_PER_CONTRAST 0.236
/* More steps than this gain nothing: between texel centres the texture is smooth. */
#define STEPS_PER_TEXEL 3.0
/* Half the side of the box, texels, that stands for smaller footprints: the texture is linear there. */
#define POINT_TEXELS 0.01

/* One channel's summed-area table. */
typedef struct {
    const double *texels;
    int64_t stride;
} Sums;

static inline double square(double a) { return a * a; }

/* ∫ P dv along the straight edge from (u0, v0) to (u1, v1), texels, up to terms that cancel in a loop. */
static inline double edge_integral(Sums sums, double u0, double v0, double u1, double v1, int64_t steps) {
    double total = 0.0;
    for (int64_t k = 0; k < steps; k++) {
        const double u = u0 + ((double)k + 0.5) / (double)steps * (u1 - u0);
        const int64_t i = (int64_t)(u + 0.5);
        const double f = u - (double)i;
        const double a0 = 0.5 * square(0.5 - f), a1 = 0.75 - f * f, a2 = 0.5 * square(0.5 + f);
        for (int end = 0; end < 2; end++) {
            const double v = v0 + (double)(k + end) / (double)steps * (v1 - v0);
            const int64_t j = (int64_t)(v + 0.5);
            const double g = v - (double)j;
            const double *n0 = sums.texels + j * sums.stride + i, *n1 = n0 + sums.stride, *n2 = n1 + sums.stride;
            double value = 0.5 * square(0.5 - g) * (a0 * n0[0] + a1 * n0[1] + a2 * n0[2]);
            value += (0.75 - g * g) * (a0 * n1[0] + a1 * n1[1] + a2 * n1[2]);
            value += 0.5 * square(0.5 + g) * (a0 * n2[0] + a1 * n2[1] + a2 * n2[2]);
            total += end ? value : -value;
        }
    }
    return total;
}

/* How many steps an edge of (du, dv) texels around a footprint of `area` texels² needs: more than
   (slant/area)^(2/3), but no more than STEPS_PER_TEXEL allows. */
static inline int64_t edge_steps(double du, double dv, double area, double contrast) {
    const double limit = STEPS_PER_TEXEL * greater(fabs(du), fabs(dv)) + 1.0;
    const double slant = STEPS_PER_CONTRAST * contrast * fabs(du * dv);
    double steps = 1.0;
    while (steps <= limit && steps * steps * steps * (area * area) <= slant * slant) steps += 1.0;
    return (int64_t)steps;
}

/* The mean over a box so small that the texture is linear in it. */
static inline double point_mean(Sums sums, double u, double v) {
    double total = 0.0;
    for (int end = 0; end < 2; end++) {
        const double side = (2 * end - 1) * POINT_TEXELS;
        total += edge_integral(sums, u + side, v - side, u + side, v + side, end / 2 + 1);
    }
    return total / (4.0 * POINT_TEXELS * POINT_TEXELS);
}

/* The table of a face's channel. */
static inline Sums sums_of(const double *texels, const double *face, int64_t channel) {
    return (Sums){texels + (int64_t)(face[START] + (double)channel * face[PLANE]), (int64_t)face[STRIDE]};
}

#endif
