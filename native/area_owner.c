/* Serves peaksim/area/owner.py: which faces may be visible in each tile, and which face fills a pixel alone.

   Tiles first: a face that cannot touch a tile, or lies behind one that covers it, is dropped by interval arithmetic
   over the tile's viewing directions. Then pixels: a face that covers all four corners and is in front of every other
   face there owns the pixel. */

#include <stdlib.h>
#include <string.h>

#include "area.h"

typedef struct {
    double least, most;
} Range;

/* The range of m·d over m between low and high, and d between box[:3] and box[3:]. */
static Range box_range(const double *low, const double *high, const double *box) {
    Range range = {0.0, 0.0};
    for (int k = 0; k < 3; k++) {
        const double a = low[k] * box[k], b = low[k] * box[k + 3];
        const double c = high[k] * box[k], d = high[k] * box[k + 3];
        range.least += lesser(lesser(a, b), lesser(c, d));
        range.most += greater(greater(a, b), greater(c, d));
    }
    return range;
}

/* Whether a face with sides between low and high is outside, touches or covers a box. */
static int64_t box_state(const FaceSides *low, const FaceSides *high, const double *box) {
    int64_t state = COVERS;
    for (int side = 0; side < SIDES; side++) {
        const Range range = box_range((*low)[side], (*high)[side], box);
        if (range.most < 0.0 || (range.most == 0.0 && range.least == 0.0)) return OUTSIDE;
        if (range.least < 0.0) state = TOUCHES;
    }
    return state;
}

/* Whether one face is nearer than another along every direction of a box. */
static bool in_front(const FaceSides *low, const FaceSides *high, int64_t front, int64_t back, const double *box) {
    Vector closest, farthest;
    for (int k = 0; k < 3; k++) {
        closest[k] = low[front][DEPTH][k] - high[back][DEPTH][k];
        farthest[k] = high[front][DEPTH][k] - low[back][DEPTH][k];
    }
    const double deepest = box_range(low[back][DEPTH], high[back][DEPTH], box).most;
    return box_range(closest, farthest, box).least > TIE * fabs(deepest);
}

/* Keep those of n faces that reach into a box; write how. */
static int64_t keep_reaching(const FaceSides *low, const FaceSides *high, const double *box, int64_t n, int64_t *found,
                             int64_t *states) {
    int64_t m = 0;
    for (int64_t k = 0; k < n; k++) {
        const int64_t face = found[k], state = box_state(low + face, high + face, box);
        if (state != OUTSIDE) {
            found[m] = face;
            states[m++] = state;
        }
    }
    return m;
}

/* Keep those of m faces that no other one hides in all of a box. */
static int64_t keep_seen(const FaceSides *low, const FaceSides *high, const double *box, int64_t m, int64_t *found,
                         int64_t *states) {
    int64_t kept = 0;
    for (int64_t k = 0; k < m; k++) {
        bool hidden = false;
        for (int64_t other = 0; other < m && !hidden; other++)
            if ((other < kept || other > k) && states[other] == COVERS)
                hidden = in_front(low, high, found[other], found[k], box);
        if (!hidden) {
            found[kept] = found[k];
            states[kept++] = states[k];
        }
    }
    return kept;
}

/* Keep those of n faces that may be visible in a box; write which one covers it alone, return how many are left. */
static int64_t keep_visible(const FaceSides *low, const FaceSides *high, const double *box, int64_t n, int64_t *found,
                            int64_t *states, int64_t *alone) {
    const int64_t reaching = keep_reaching(low, high, box, n, found, states);
    const int64_t seen = keep_seen(low, high, box, reaching, found, states);
    *alone = seen == 0 ? NOTHING : seen == 1 && states[0] == COVERS ? found[0] : MIXED;
    return seen;
}

/* Keep those faces of each box of directions that may be visible in it. */
EXPORT status keep_faces(const double *low, int64_t faces, const double *high, const double *boxes, int64_t tiles,
                         int64_t *found, int64_t room, int64_t *counts, int64_t *alone) {
    int64_t *states = malloc((size_t)(room + 1) * sizeof *states);
    (void)faces;
    if (!states) return OUT_OF_MEMORY;
    for (int64_t tile = 0; tile < tiles; tile++)
        counts[tile] = keep_visible((const FaceSides *)low, (const FaceSides *)high, boxes + 6 * tile, counts[tile],
                                    found + tile * room, states, alone + tile);
    free(states);
    return DONE;
}

/* Write the box around all boxes. */
static void join_boxes(const double *boxes, int64_t n, double *whole) {
    for (int k = 0; k < 6; k++) {
        whole[k] = boxes[k];
        for (int64_t box = 1; box < n; box++)
            whole[k] = k < 3 ? lesser(boxes[6 * box + k], whole[k]) : greater(boxes[6 * box + k], whole[k]);
    }
}

/* Write which of the same candidates, which become those of all boxes together, may be visible in each box; return how
   many candidates are left: there must be room for as many, or nothing is written. */
EXPORT status find_faces(const double *low, int64_t faces, const double *high, const double *boxes, int64_t tiles,
                         int64_t *candidates, int64_t n, int64_t *left, int64_t *found, int64_t room, int64_t *counts,
                         int64_t *alone) {
    double whole[6];
    *left = n;
    join_boxes(boxes, tiles, whole);
    const status failed = keep_faces(low, faces, high, whole, 1, candidates, n, left, alone);
    if (failed || *left > room) return failed;
    for (int64_t tile = 0; tile < tiles; tile++) {
        memcpy(found + tile * room, candidates, (size_t)*left * sizeof *found);
        counts[tile] = *left;
    }
    return keep_faces(low, faces, high, boxes, tiles, found, room, counts, alone);
}

/* How a face lies to a pixel, and its depths w at the corners. */
typedef struct {
    double depths[4];
    int64_t state;
} FaceInPixel;

/* Whether a face is outside, touches or covers a pixel; writes its depths w at the corners. */
static int64_t pixel_state(const FaceSides *sides, Rays rays, int64_t y, int64_t x, double *depths) {
    int64_t state = COVERS;
    for (int side = 0; side < SIDES; side++) {
        int outside = 0;
        for (int corner = 0; corner < 4; corner++) {
            depths[corner] = dot((*sides)[side], corner_of(rays, y + corner / 2, x + corner % 2));
            outside += depths[corner] < 0.0;
        }
        if (outside == 4) return OUTSIDE;
        if (outside > 0) state = TOUCHES;
    }
    const double *w = (*sides)[DEPTH];
    return w[0] == 0.0 && w[1] == 0.0 && w[2] == 0.0 ? OUTSIDE : state;
}

/* Whether a covering face is in front of another one at all four corners of a pixel. */
static bool hides(const double *front, const double *back, bool later) {
    for (int corner = 0; corner < 4; corner++) {
        const double gap = front[corner] - back[corner], tie = TIE * fabs(back[corner]);
        if (gap < -tie || (gap <= tie && !later)) return false;
    }
    return true;
}

/* Which of n faces alone fills a pixel, NOTHING, or MIXED. */
static int64_t pixel_owner(Views views, const int64_t *found, int64_t n, Rays rays, int64_t y, int64_t x,
                           FaceInPixel *seen) {
    int64_t owner = NOTHING;
    for (int64_t k = 0; k < n; k++) {
        seen[k].state = pixel_state(sides_of(views, y, found[k]), rays, y, x, seen[k].depths);
        if (seen[k].state != OUTSIDE) owner = MIXED;
    }
    for (int64_t k = 0; k < n; k++) {
        bool alone = seen[k].state == COVERS;
        for (int64_t other = 0; other < n && alone; other++)
            if (other != k && seen[other].state != OUTSIDE)
                alone = hides(seen[k].depths, seen[other].depths, found[k] > found[other]);
        if (alone) return found[k];
    }
    return owner;
}

/* Write the owner of each pixel of a band. */
EXPORT status find_owners(const double *rays, int64_t rows, int64_t columns, const double *sides, int64_t poses,
                          int64_t faces, const int64_t *cells, int64_t height, int64_t width, const int64_t *found,
                          int64_t lists, int64_t room, const int64_t *counts, const int64_t *alone, int64_t *owners) {
    const Rays corners = rays_of(rays, rows, columns);
    const Views views = {(const FaceSides *)sides, poses, faces};
    FaceInPixel *seen = malloc((size_t)(room + 1) * sizeof *seen);
    (void)lists;
    if (!seen) return OUT_OF_MEMORY;
    for (int64_t y = 0; y < height; y++) {
        for (int64_t x = 0; x < width; x++) {
            const int64_t pixel = y * width + x, cell = cells[pixel];
            owners[pixel] = alone[cell];
            if (alone[cell] == MIXED)
                owners[pixel] = pixel_owner(views, found + cell * room, counts[cell], corners, y, x, seen);
        }
    }
    free(seen);
    return DONE;
}
