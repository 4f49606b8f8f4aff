/* Serves peaksim/area/cut.py: pixels that several faces share, cut into the visible pieces of each.

   The visible part of a face is the pixel within its sides, less, for every other face, the region within that one's
   sides where it is nearer. Depth w is linear over a pixel, so that region is convex, however faces overlap or
   intersect; a subtraction leaves convex pieces again. */

#include <stdlib.h>
#include <string.h>

#include "area_polygon.h"

typedef Line FaceLines[SIDES];

/* The line over a pixel of m·d, exact for a pinhole; whether it is negative all over. */
static bool pixel_line(const double *m, Rays rays, int64_t y, int64_t x, double *line) {
    double a = 0.0, b = 0.0, c = 0.0;
    const double *c00 = corner_of(rays, y, x), *c10 = corner_of(rays, y, x + 1);
    const double *c01 = corner_of(rays, y + 1, x), *c11 = corner_of(rays, y + 1, x + 1);
    for (int axis = 0; axis < 3; axis++) {
        a += 0.25 * m[axis] * (c00[axis] + c10[axis] + c01[axis] + c11[axis]);
        b += 0.5 * m[axis] * (c10[axis] - c00[axis] + c11[axis] - c01[axis]);
        c += 0.5 * m[axis] * (c01[axis] - c00[axis] + c11[axis] - c10[axis]);
    }
    line[0] = a - 0.5 * (b + c);
    line[1] = b;
    line[2] = c;
    return a + 0.5 * (fabs(b) + fabs(c)) <= 0.0;
}

/* List those of n faces that reach into a pixel, and the lines of their sides and depth; return their number. */
static int64_t measure_faces(Views views, const int64_t *found, int64_t n, Rays rays, int64_t y, int64_t x,
                             int64_t *faces, FaceLines *lines) {
    int64_t kept = 0;
    for (int64_t k = 0; k < n; k++) {
        bool outside = false;
        for (int side = 0; side < SIDES; side++)
            outside |= pixel_line((*sides_of(views, y, found[k]))[side], rays, y, x, lines[kept][side]);
        if (!outside) faces[kept++] = found[k];
    }
    return kept;
}

static double line_at(const double *line, double s, double t) { return line[0] + line[1] * s + line[2] * t; }

/* Write the lines around the region where one face lies before another; return their number, 0 for nowhere. */
static int nearer_sides(const FaceLines *front, const FaceLines *back, bool later, FaceLines *cutter) {
    double closest = INFINITY, farthest = -INFINITY, deepest = 0.0;
    for (int side = 0; side < SIDES; side++)
        for (int k = 0; k < 3; k++) (*cutter)[side][k] = (*front)[side][k] - (side == DEPTH ? (*back)[side][k] : 0.0);
    for (int corner = 0; corner < 4; corner++) {
        const double s = corner % 2, t = corner / 2, gap = line_at((*cutter)[DEPTH], s, t);
        closest = lesser(closest, gap);
        farthest = greater(farthest, gap);
        deepest = greater(deepest, fabs(line_at((*back)[DEPTH], s, t)));
    }
    const double tie = TIE * deepest;
    if (farthest <= tie && (closest < -tie || !later)) return 0;
    return closest >= -tie ? DEPTH : SIDES;
}

static bool is_empty(Pool pool, int64_t k) { return fabs(area_of(pool.polygons[k], pool.sizes[k])) <= EMPTY; }

/* Remove a convex region from n pieces at `source`; write what is left from `target` on, return its number. */
static int64_t subtract_region(Pool pool, int64_t source, int64_t target, int64_t n, const FaceLines *cutter,
                               int n_sides) {
    int64_t m = 0, rest = pool.count - 2, other = pool.count - 1;
    for (int64_t k = 0; k < n; k++) {
        const int64_t first = m;
        copy_polygon(pool, source + k, rest);
        for (int side = 0; side < n_sides; side++) {
            if (pool.sizes[rest] > 2 && m < MAX_PIECES) {
                cut_polygon(pool, rest, (*cutter)[side], -1.0, target + m);
                m += !is_empty(pool, target + m);
                cut_polygon(pool, rest, (*cutter)[side], 1.0, other);
                const int64_t swapped = rest;
                rest = other;
                other = swapped;
            }
        }
        if (is_empty(pool, rest)) { /* nothing was removed: the piece stays whole */
            m = first + 1;
            copy_polygon(pool, source + k, target + first);
        }
    }
    return m;
}

/* Where pieces begin in the pool, and their number. */
typedef struct {
    int64_t first, count;
} Pieces;

/* Cut the whole pixel down to what is within four sides; `scratch` is a polygon that may be overwritten. */
static void cut_pixel(Pool pool, const FaceLines *lines, int64_t scratch) {
    pool.sizes[0] = 4;
    for (int corner = 0; corner < 4; corner++) {
        pool.polygons[0][corner][0] = (corner + 1) / 2 % 2;
        pool.polygons[0][corner][1] = corner / 2;
    }
    for (int side = 0; side < DEPTH; side++) {
        if (pool.sizes[0] > 2) {
            cut_polygon(pool, 0, (*lines)[side], 1.0, scratch);
            copy_polygon(pool, scratch, 0);
        }
    }
}

/* Cut candidate k of n out of the pixel. */
static Pieces visible_pieces(const FaceLines *lines, const int64_t *faces, int64_t n, int64_t k, Pool pool) {
    int64_t here = 0, there = MAX_PIECES;
    cut_pixel(pool, lines + k, 2 * MAX_PIECES);
    int64_t m = !is_empty(pool, here);
    FaceLines cutter;
    for (int64_t other = 0; other < n; other++) {
        if (other == k || m == 0) continue;
        const int n_sides = nearer_sides(lines + other, lines + k, faces[other] > faces[k], &cutter);
        if (n_sides > 0) {
            m = subtract_region(pool, here, there, m, (const FaceLines *)&cutter, n_sides);
            const int64_t swapped = here;
            here = there;
            there = swapped;
        }
    }
    return (Pieces){here, m};
}

/* Write a piece of a candidate in the face's coordinates; return its share of the pixel. */
static double keep_piece(const FaceLines *lines, const Polygon piece, int64_t n, Polygon target) {
    for (int64_t v = 0; v < n; v++) {
        const double s = piece[v][0], t = piece[v][1], w = line_at((*lines)[DEPTH], s, t);
        for (int axis = 0; axis < 2; axis++) target[v][axis] = line_at((*lines)[axis], s, t) / w;
    }
    return fabs(area_of(piece, n));
}

/* Memory for one pixel. */
typedef struct {
    Polygon polygons[2 * MAX_PIECES + 2];
    int64_t sizes[2 * MAX_PIECES + 2];
    FaceLines *lines;
    int64_t *faces;
} Workspace;

/* Lists of pieces. */
typedef struct {
    Polygon *polygons;
    Piece *pieces;
    double *shares;
} Lists;

/* List the visible pieces of n faces in a pixel from number `first` on; return the number behind the last one, and
   subtract their shares from `bare`. */
static int64_t cut_faces(Workspace *work, int64_t n, int64_t y, int64_t x, Lists lists, int64_t first, double *bare) {
    const Pool pool = {work->polygons, work->sizes, 2 * MAX_PIECES + 2};
    const FaceLines *lines = (const FaceLines *)work->lines;
    int64_t total = first;
    for (int64_t k = 0; k < n; k++) {
        const Pieces seen = visible_pieces(lines, work->faces, n, k, pool);
        for (int64_t piece = seen.first; piece < seen.first + seen.count; ++piece, total++) {
            const double share = keep_piece(lines + k, pool.polygons[piece], pool.sizes[piece], lists.polygons[total]);
            const Piece made = {y, x, work->faces[k], pool.sizes[piece]};
            memcpy(lists.pieces[total], made, sizeof made);
            lists.shares[total] = share;
            *bare -= share;
        }
    }
    return total;
}

/* Memory for cells of so many faces; null if there is none. */
static Workspace *new_workspace(int64_t room) {
    Workspace *work = malloc(sizeof *work + (size_t)(room + 1) * (sizeof(FaceLines) + sizeof(int64_t)));
    if (!work) return 0;
    work->lines = (FaceLines *)(work + 1);
    work->faces = (int64_t *)(work->lines + room + 1);
    return work;
}

/* List the visible pieces of all MIXED pixels of a band from pixel progress[0] on, and add background where none is;
   write the pixel to continue with if the lists were full, else h·w, and the number of pieces to progress[1]. */
EXPORT status cut_mixed(const double *rays, int64_t rows, int64_t columns, const double *sides, int64_t poses,
                        int64_t faces, const int64_t *owners, int64_t height, int64_t width, const int64_t *cells,
                        const int64_t *found, int64_t lists, int64_t room, const int64_t *counts,
                        const double *background, int64_t channels, int64_t *progress, double *polygons, int64_t n,
                        int64_t *pieces, double *shares, float *out) {
    const Rays corners = rays_of(rays, rows, columns);
    const Views views = {(const FaceSides *)sides, poses, faces};
    const Lists made = {(Polygon *)polygons, (Piece *)pieces, shares};
    Workspace *work = new_workspace(room);
    int64_t total = 0, pixel = progress[0];
    (void)lists;
    if (!work) return OUT_OF_MEMORY;
    for (; pixel < height * width; pixel++) {
        const int64_t y = pixel / width, x = pixel % width, *list = found + cells[pixel] * room;
        if (owners[pixel] != MIXED) continue;
        if (total + counts[cells[pixel]] * MAX_PIECES > n) break;
        const int64_t reaching =
            measure_faces(views, list, counts[cells[pixel]], corners, y, x, work->faces, work->lines);
        double bare = 1.0;
        total = cut_faces(work, reaching, y, x, made, total, &bare);
        for (int64_t k = pixel * channels; k < (pixel + 1) * channels; k++)
            add_level(out + k, greater(bare, 0.0) * background[k]);
    }
    progress[0] = pixel;
    progress[1] = total;
    free(work);
    return DONE;
}
