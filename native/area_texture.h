/* The mean of a texture over a polygon, from line integrals along its edges.

   By Green's theorem ∬ T du dv over a polygon is the sum over its edges of ∫ P dv with P(u, v) = ∫₀ᵘ T. Each edge is
   divided into a few steps; a step is integrated exactly in v at its middle u, by two evaluations of the biquadratic
   double antiderivative of the texture (peaksim.area.texture_sums). What is left is the staircase of triangles along slanted
   edges, and the number of steps keeps that below the error budget. */

#ifndef PEAKSIM_AREA_TEXTURE_H
#define PEAKSIM_AREA_TEXTURE_H

#include "area.h"
#include "lanes.h"

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

/* Ends of LANES edges, texels. */
typedef struct {
    const double *u0, *v0, *u1, *v1;
} Edges;

/* Where coordinates lie among texels: the first of three, and the weights of their quadratic B-splines. */
typedef struct {
    int32_t first[LANES];
    double before[LANES], middle[LANES], behind[LANES];
} Splines;

/* Write the splines at a share of the way along edges. */
static inline void spline_at(const double *from, const double *to, double share, Splines *out) {
    for (int e = 0; e < LANES; e++) {
        const double at = from[e] + share * (to[e] - from[e]);
        const int32_t first = (int32_t)(at + 0.5);
        const double f = at - first;
        out->first[e] = first;
        out->before[e] = 0.5 * (0.5 - f) * (0.5 - f);
        out->middle[e] = 0.75 - f * f;
        out->behind[e] = 0.5 * (0.5 + f) * (0.5 + f);
    }
}

/* The table at an edge's rows, summed with their weights, in four columns. */
static inline double4 sum_rows(const double *columns, int64_t stride, const Splines *v, int64_t e) {
    const double *row = columns + v->first[e] * stride;
    return v->before[e] * load4(row) + v->middle[e] * load4(row + stride) + v->behind[e] * load4(row + 2 * stride);
}

/* Ask for three rows that will be needed soon. */
static inline void prefetch_rows(const double *row, int64_t stride) {
    for (int k = 0; k < 3; k++) __builtin_prefetch(row + k * stride);
}

/* Add ∫ P dv from one set of rows to another at the columns of the first `count` edges; ask for what lies `ahead`. */
static inline void add_step(Sums sums, const Splines *u, const Splines *from, const Splines *to, int64_t count,
                            int64_t ahead, double4 *totals) {
    for (int64_t e = 0; e < count; e++) {
        const double *columns = sums.texels + u->first[e];
        const double4 weights = {u->before[e], u->middle[e], u->behind[e], 0.0}; /* texels are read by fours */
        if (ahead) prefetch_rows(columns + to->first[e] * sums.stride + ahead, sums.stride);
        totals[e] += weights * (sum_rows(columns, sums.stride, to, e) - sum_rows(columns, sums.stride, from, e));
    }
}

/* Write ∫ P dv along the first `count` edges, each in as many steps, up to terms that cancel in a loop; `ahead` is from
   these edges to those that are integrated later, in the table, or 0. */
static inline void integrate_edges(Sums sums, Edges edges, int64_t count, int64_t steps, int64_t ahead, double *out) {
    Splines u, rows[2];
    double4 totals[LANES] = {{0.0}};
    spline_at(edges.v0, edges.v1, 0.0, &rows[0]);
    for (int64_t k = 0; k < steps; k++) {
        spline_at(edges.u0, edges.u1, ((double)k + 0.5) / (double)steps, &u);
        spline_at(edges.v0, edges.v1, (double)(k + 1) / (double)steps, &rows[(k + 1) % 2]);
        add_step(sums, &u, &rows[k % 2], &rows[(k + 1) % 2], count, ahead, totals);
    }
    for (int64_t e = 0; e < count; e++) out[e] = sum4(totals[e]);
}

/* Where one coordinate lies among texels. */
typedef struct {
    int64_t first;
    double before, middle, behind;
} Spline;

static inline Spline spline_of(double at) {
    const int64_t first = (int64_t)(at + 0.5);
    const double f = at - (double)first;
    return (Spline){first, 0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)};
}

/* The biquadratic antiderivative at the columns of one spline and the rows of another. */
static inline double sum_at(Sums sums, Spline u, Spline v) {
    const double *row = sums.texels + v.first * sums.stride + u.first;
    const double4 rows =
        v.before * load4(row) + v.middle * load4(row + sums.stride) + v.behind * load4(row + 2 * sums.stride);
    return sum4((double4){u.before, u.middle, u.behind, 0.0} * rows);
}

/* ∫ P dv along the straight edge from (u0, v0) to (u1, v1). */
static inline double edge_integral(Sums sums, double u0, double v0, double u1, double v1, int64_t steps) {
    double total = 0.0;
    for (int64_t k = 0; k < steps; k++) {
        const Spline u = spline_of(u0 + ((double)k + 0.5) / (double)steps * (u1 - u0));
        total -= sum_at(sums, u, spline_of(v0 + (double)k / (double)steps * (v1 - v0)));
        total += sum_at(sums, u, spline_of(v0 + (double)(k + 1) / (double)steps * (v1 - v0)));
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
