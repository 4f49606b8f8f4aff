/* Footprints of runs of pixels that one face fills; see peaksim.area.run. */

#ifndef PEAKSIM_AREA_RUN_H
#define PEAKSIM_AREA_RUN_H

#include "area.h"

/* Most pixels that share one choice of steps: their edges are integrated together. */
enum { CHUNK = LANES };

/* Texture coordinates u and v of the corners above (0) and below (1) of a run of pixels; the last one is repeated. */
typedef double Corners[2][2][CHUNK + 1];

/* How far a footprint may reach beyond the outermost texel, so that what is read lies in the table. */
#define BORDER_TEXELS 0.49

/* Coordinates of a viewing direction d on a face or its texture, u·d / w·d and v·d / w·d, and where they end. */
typedef struct {
    Vector u, v;
    const double *w;
    double end_u, end_v;
} Coordinates;

/* A face's own coordinates. */
static inline Coordinates on_face(const FaceSides *sides, const double *face) {
    Coordinates on = {{0.0}, {0.0}, (*sides)[DEPTH], face[EXTENT_P], face[EXTENT_Q]};
    for (int axis = 0; axis < 3; axis++) {
        on.u[axis] = (*sides)[0][axis];
        on.v[axis] = (*sides)[1][axis];
    }
    return on;
}

/* Those of its texture. */
static inline Coordinates on_texture(const FaceSides *sides, const double *face) {
    const double *p = (*sides)[0], *q = (*sides)[1], *w = (*sides)[DEPTH], *u = face + MAP, *v = u + 3;
    Coordinates on = {{0.0}, {0.0}, w, face[EXTENT_U], face[EXTENT_V]};
    for (int axis = 0; axis < 3; axis++) {
        on.u[axis] = u[0] * w[axis] + u[1] * p[axis] + u[2] * q[axis];
        on.v[axis] = v[0] * w[axis] + v[1] * p[axis] + v[2] * q[axis];
    }
    return on;
}

/* Write the corners of n pixels from x on. */
static inline void footprints(Coordinates on, Rays rays, int64_t y, int64_t x, int64_t n, Corners corners) {
    const double end_u = on.end_u + BORDER_TEXELS, end_v = on.end_v + BORDER_TEXELS;
    for (int row = 0; row < 2; row++) {
        for (int64_t k = 0; k < n + 1; k++) {
            const double *ray = corner_of(rays, y + row, x + k), w = dot(on.w, ray);
            corners[row][0][k] = clamp(dot(on.u, ray) / w, -BORDER_TEXELS, end_u);
            corners[row][1][k] = clamp(dot(on.v, ray) / w, -BORDER_TEXELS, end_v);
        }
        for (int64_t k = n + 1; k <= CHUNK; k++)
            for (int axis = 0; axis < 2; axis++) corners[row][axis][k] = corners[row][axis][n];
    }
}

/* Where a run of pixels from x on ends that have one owner, CHUNK pixels later at most. */
static inline int64_t run_end(const int64_t *owners, int64_t x, int64_t width) {
    const int64_t farthest = least(width, x + CHUNK);
    int64_t end = x + 1;
    while (end < farthest && owners[end] == owners[x]) ++end;
    return end;
}

#endif
