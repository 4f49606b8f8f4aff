/* Rays against faces in a tree of boxes; see peaksim.area.rays. */

#ifndef PEAKSIM_AREA_RAYS_H
#define PEAKSIM_AREA_RAYS_H

#include "area.h"

/* Boxes that wait while a tree is traversed: more than any tree of 2⁶⁴ faces needs. */
enum { STACK = 128 };
/* Columns of `Solids.faces`. */
enum { U = 3, V = 6, QUAD = 9 };

typedef double Box[6];
typedef int64_t Link[2];
typedef double SolidFace[10];

/* Faces in a binary tree of boxes. */
typedef struct {
    const Box *boxes;
    const Link *links;
    const SolidFace *faces;
    int64_t count;
} Solids;

/* Boxes that wait. */
typedef struct {
    int64_t nodes[STACK];
    int64_t top;
} Stack;

/* A stack with the root, if there is one. */
static inline Stack stack_of(int64_t count) {
    Stack stack;
    stack.nodes[0] = 0;
    stack.top = count > 0;
    return stack;
}

static inline void push_children(Stack *stack, int64_t first) {
    stack->nodes[stack->top] = first;
    stack->nodes[stack->top + 1] = first + 1;
    stack->top += 2;
}

/* Whether a ray comes within `radius` (along each axis) of a box before `farthest`. */
static inline bool meets_box(const double *box, const double *origin, const double *ray, double radius,
                             double farthest) {
    double near = 0.0, far = farthest;
    for (int k = 0; k < 3; k++) {
        const double low = box[k] - radius - origin[k], high = box[k + 3] + radius - origin[k];
        if (ray[k] != 0.0) {
            const double a = low / ray[k], b = high / ray[k];
            near = greater(near, lesser(a, b));
            far = lesser(far, greater(a, b));
        } else if (low > 0.0 || high < 0.0) {
            return false;
        }
    }
    return near <= far * (1.0 + 1e-12);
}

/* The ray parameter at which a ray meets a face, infinite if it does not (Möller and Trumbore 1997). */
static inline double intersect_face(const double *face, const double *origin, const double *ray) {
    const double *u = face + U, *v = face + V;
    const double px = ray[1] * v[2] - ray[2] * v[1], py = ray[2] * v[0] - ray[0] * v[2],
                 pz = ray[0] * v[1] - ray[1] * v[0];
    const double det = u[0] * px + u[1] * py + u[2] * pz;
    if (det == 0.0) return INFINITY;
    const double ox = origin[0] - face[0], oy = origin[1] - face[1], oz = origin[2] - face[2];
    const double qx = oy * u[2] - oz * u[1], qy = oz * u[0] - ox * u[2], qz = ox * u[1] - oy * u[0];
    const double a = (ox * px + oy * py + oz * pz) / det;
    const double b = (ray[0] * qx + ray[1] * qy + ray[2] * qz) / det;
    if (a < 0.0 || a > 1.0 || b < 0.0 || b > 1.0 || (face[QUAD] == 0.0 && a + b > 1.0)) return INFINITY;
    return (v[0] * qx + v[1] * qy + v[2] * qz) / det;
}

/* Whether a ray meets a face before `farthest`. */
static inline bool meets_any(Solids solids, const double *origin, const double *ray, double farthest) {
    Stack stack = stack_of(solids.count);
    while (stack.top > 0) {
        const int64_t node = stack.nodes[--stack.top], first = solids.links[node][0], n = solids.links[node][1];
        if (!meets_box(solids.boxes[node], origin, ray, 0.0, farthest)) continue;
        if (n == 0) push_children(&stack, first);
        for (int64_t face = first; face < first + n; face++) {
            const double t = intersect_face(solids.faces[face], origin, ray);
            if (0.0 < t && t < farthest) return true;
        }
    }
    return false;
}

/* Whether a box lies wholly outside one of the borders n·p + d ≥ 0. */
static inline bool is_outside(const double *box, const double *planes, int64_t n) {
    for (const double *plane = planes; plane < planes + 4 * n; plane += 4) {
        double reach = plane[3];
        for (int k = 0; k < 3; k++) reach += plane[k] * box[plane[k] > 0.0 ? k + 3 : k];
        if (reach < 0.0) return true;
    }
    return false;
}

#endif
