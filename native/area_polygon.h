/* Convex polygons inside one pixel, cut by straight lines.

   A pixel is the unit square (s, t), s right and t down. A cut keeps a + b·s + c·t ≥ 0, a line of its three
   coefficients. */

#ifndef PEAKSIM_AREA_POLYGON_H
#define PEAKSIM_AREA_POLYGON_H

#include "area.h"

#define EMPTY 1e-9 /* pieces smaller than this share of a pixel are dropped */

/* Polygons and their numbers of vertices. */
typedef struct {
    Polygon *polygons;
    int64_t *sizes;
    int64_t count;
} Pool;

static inline void copy_polygon(Pool pool, int64_t source, int64_t target) {
    pool.sizes[target] = pool.sizes[source];
    for (int64_t k = 0; k < pool.sizes[source]; k++)
        for (int axis = 0; axis < 2; axis++) pool.polygons[target][k][axis] = pool.polygons[source][k][axis];
}

/* Write the part of a polygon on one side of a line to another one (Sutherland and Hodgman 1974). */
static inline void cut_polygon(Pool pool, int64_t source, const double *line, double sign, int64_t target) {
    const double (*from)[2] = (const double (*)[2])pool.polygons[source];
    double (*to)[2] = pool.polygons[target];
    const int64_t n = pool.sizes[source];
    int64_t m = 0;
    double before = 0.0;
    for (int64_t k = 0; k < n + 1; k++) {
        const double *point = from[k < n ? k : 0];
        const double here = sign * (line[0] + line[1] * point[0] + line[2] * point[1]);
        if (k > 0 && (before < 0.0) != (here < 0.0) && m < MAX_VERTICES) {
            const double r = before / (before - here);
            for (int axis = 0; axis < 2; axis++)
                to[m][axis] = from[k - 1][axis] + r * (point[axis] - from[k - 1][axis]);
            ++m;
        }
        if (k < n && here >= 0.0 && m < MAX_VERTICES) {
            for (int axis = 0; axis < 2; axis++) to[m][axis] = point[axis];
            ++m;
        }
        before = here;
    }
    pool.sizes[target] = m;
}

/* The signed area of a polygon of n vertices. */
static inline double area_of(const Polygon polygon, int64_t n) {
    double total = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t j = i + 1 < n ? i + 1 : 0;
        total += (polygon[i][0] - polygon[0][0]) * (polygon[j][1] - polygon[0][1]);
        total -= (polygon[j][0] - polygon[0][0]) * (polygon[i][1] - polygon[0][1]);
    }
    return 0.5 * total;
}

#endif
