/* Serves peaksim/truth/markers.py: whether anything may lie between the camera and a rectangle. */

#include "area_rays.h"

/* Faces closer than this are in one plane. */
#define IN_PLANE_M 1e-12

typedef Vector Rectangle[4]; /* corners in order; a triangle's last one is repeated */

/* What lies between an eye and a rectangle. */
typedef struct {
    const double *eye;
    const Vector *corners;
    Vector inwards[4];    /* of the planes through the eye and a side */
    Vector normal;        /* of the rectangle, towards the eye */
    double borders[5][4]; /* all five planes, a little outwards: n·p + d ≥ 0 inside */
} Pyramid;

static void subtract(const double *a, const double *b, double *out) {
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

static void cross(const double *a, const double *b, double *out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double length(const double *a) { return sqrt(dot(a, a)); }

/* The normal of a face, as long as twice its triangle is large. */
static void face_normal(const Vector *corners, int last, double *out) {
    Vector u, v;
    subtract(corners[1], corners[0], u);
    subtract(corners[last], corners[0], v);
    cross(u, v, out);
}

/* Turn a vector so that it points the way of another. */
static void turn_towards(const double *way, double *vector) {
    const double along = dot(vector, way);
    for (int k = 0; k < 3; k++) vector[k] *= along > 0.0 ? 1.0 : along < 0.0 ? -1.0 : 0.0;
}

/* The pyramid from an eye to a rectangle. */
static Pyramid pyramid_of(const double *eye, const Vector *corners) {
    Pyramid pyramid = {.eye = eye, .corners = corners};
    Vector rays[4], middle = {0.0, 0.0, 0.0}, back;
    double reach = 1.0;
    for (int corner = 0; corner < 4; corner++) {
        subtract(corners[corner], eye, rays[corner]);
        for (int k = 0; k < 3; k++) {
            middle[k] += rays[corner][k];
            reach = greater(reach, 1.0 + greater(fabs(corners[corner][k]), fabs(eye[k])));
        }
    }
    for (int side = 0; side < 4; side++) {
        cross(rays[side], rays[(side + 1) % 4], pyramid.inwards[side]);
        turn_towards(middle, pyramid.inwards[side]);
    }
    face_normal(corners, 3, pyramid.normal);
    subtract(eye, corners[0], back);
    turn_towards(back, pyramid.normal);
    for (int plane = 0; plane < 5; plane++) {
        const double *normal = plane < 4 ? pyramid.inwards[plane] : pyramid.normal;
        for (int k = 0; k < 3; k++) pyramid.borders[plane][k] = normal[k];
        pyramid.borders[plane][3] = 1e-9 * length(normal) * reach - dot(normal, plane < 4 ? eye : corners[0]);
    }
    return pyramid;
}

/* Whether n·(p − from) < least for all corners of a face. */
static bool all_below(const Vector *face, const double *normal, const double *from, double least_height) {
    for (int corner = 0; corner < 4; corner++) {
        Vector away;
        subtract(face[corner], from, away);
        if (!(dot(away, normal) < least_height)) return false;
    }
    return true;
}

/* Whether a face's own plane has the eye and the rectangle on one side. */
static bool is_apart(const Pyramid *pyramid, const Vector *face) {
    Vector normal, away;
    face_normal(face, 2, normal);
    const double least_height = 1e-9 * length(normal);
    int above = 0, below = 0;
    for (int k = 0; k < 5; k++) {
        subtract(k < 4 ? pyramid->corners[k] : pyramid->eye, face[0], away);
        above += dot(away, normal) > least_height;
        below += dot(away, normal) < -least_height;
    }
    return above == 5 || below == 5;
}

/* Whether a face may lie between the eye and the rectangle: no is certain. It cannot if it is wholly on the outer side
   of a plane through the eye and a side of the rectangle, or wholly behind that, or if its plane has both on one side. */
static bool may_hide(const Pyramid *pyramid, const Vector *face) {
    for (int side = 0; side < 4; side++)
        if (all_below(face, pyramid->inwards[side], pyramid->eye, 0.0)) return false;
    if (all_below(face, pyramid->normal, pyramid->corners[0], -1e-9 * length(pyramid->normal))) return false;
    return !is_apart(pyramid, face);
}

/* Whether a face is shown before another one where both cover a ray at the same depth, or may be at another depth. */
static bool is_before(const Vector *face, int64_t number, const Vector *own, int64_t own_number) {
    Vector normal, away;
    face_normal(own, 3, normal);
    for (int corner = 0; corner < 4; corner++) {
        subtract(face[corner], own[0], away);
        if (!(fabs(dot(away, normal)) <= IN_PLANE_M * length(normal))) return number != own_number;
    }
    return number > own_number;
}

/* Whether any face in the tree may lie between the eye and the rectangle, which is on the face of a number. */
static bool is_hidden(Solids solids, const int64_t *ids, const Rectangle *faces, const Pyramid *pyramid,
                      int64_t number) {
    Stack stack = stack_of(solids.count);
    while (stack.top > 0) {
        const int64_t node = stack.nodes[--stack.top], first = solids.links[node][0], n = solids.links[node][1];
        if (is_outside(solids.boxes[node], pyramid->borders[0], 5)) continue;
        if (n == 0) push_children(&stack, first);
        for (int64_t k = first; k < first + n; k++) {
            const Vector *face = faces[ids[k]];
            if (is_before(face, ids[k], faces[number], number) && may_hide(pyramid, face)) return true;
        }
    }
    return false;
}

/* Write whether anything may lie between rectangles and any of their eyes. */
EXPORT void find_hidden(const double *boxes, int64_t nodes, const int64_t *links, const int64_t *ids, int64_t count,
                        const double *faces, const double *eyes, int64_t n, int64_t eyes_each, const double *rectangles,
                        const int64_t *numbers, bool *hidden) {
    const Solids solids = {(const Box *)boxes, (const Link *)links, 0, count};
    (void)nodes;
    for (int64_t k = 0; k < n; k++) {
        hidden[k] = false;
        for (int64_t eye = k * eyes_each; eye < (k + 1) * eyes_each && !hidden[k]; eye++) {
            const Pyramid pyramid = pyramid_of(eyes + 3 * eye, ((const Rectangle *)rectangles)[k]);
            hidden[k] = is_hidden(solids, ids, (const Rectangle *)faces, &pyramid, numbers[k]);
        }
    }
}
