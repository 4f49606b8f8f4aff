/* Serves peaksim/area/rays.py: what rays meet in a tree of faces. */

#include "area_rays.h"

#define SAME_PLANE 1e-9 /* share of the distance within which two hits are in one plane */

/* The face that a ray meets first and the ray parameter there, −1 and infinite for none; in one plane the later face. */
static int64_t nearest_face(Solids solids, const int64_t *ids, const double *origin, const double *ray,
                            double *parameter) {
    Stack stack = stack_of(solids.count);
    int64_t best = -1;
    double best_t = INFINITY;
    while (stack.top > 0) {
        const int64_t node = stack.nodes[--stack.top], first = solids.links[node][0], n = solids.links[node][1];
        if (!meets_box(solids.boxes[node], origin, ray, 0.0, best_t * (1.0 + 2 * SAME_PLANE))) continue;
        if (n == 0) push_children(&stack, first);
        for (int64_t face = first; face < first + n; face++) {
            const double t = intersect_face(solids.faces[face], origin, ray);
            const bool tie = fabs(t - best_t) <= SAME_PLANE * best_t;
            if (0.0 < t && t < INFINITY && (tie ? ids[face] > best : t < best_t)) {
                best = ids[face];
                best_t = t;
            }
        }
    }
    *parameter = best_t;
    return best;
}

/* Write the first scene face of each of n rays and the ray parameters. */
EXPORT void nearest_faces(const double *boxes, int64_t nodes, const int64_t *links, const double *faces, int64_t count,
                          const int64_t *ids, const double *origins, int64_t n_origins, const double *rays, int64_t n,
                          int64_t *found, double *parameters) {
    const Solids solids = {(const Box *)boxes, (const Link *)links, (const SolidFace *)faces, count};
    (void)nodes;
    for (int64_t i = 0; i < n; i++) {
        const double *origin = origins + (n_origins > 1 ? 3 * i : 0);
        found[i] = nearest_face(solids, ids, origin, rays + 3 * i, parameters + i);
    }
}
