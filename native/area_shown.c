/* Serves peaksim/area/shown.py: candidate faces from an image of the number of the nearest face at samples of pixels.

   A tile's candidates are the faces shown in it and right beside it; where they are too many, each of its pixels has
   candidates of its own. */

#include <string.h>

#include "area.h"

enum { SAMPLES = 4, MOST_FACES = 24, LIST = MOST_FACES + 1, NUMBER_BITS = 0xFFFFFF };

/* The image of numbers, and which faces may lie on each other. */
typedef struct {
    const uint32_t *numbers;
    int64_t rows, columns;
    const int64_t *groups;
} Shown;

typedef struct {
    double left, top, right, bottom;
} Bounds;

/* Add a face to the first n in a list, unless it is among them or the list is full; return their number. */
static int64_t add_face(int64_t *faces, int64_t n, int64_t face) {
    for (int64_t k = 0; k < n; k++)
        if (faces[k] == face) return n;
    if (n < LIST) faces[n++] = face;
    return n;
}

/* The first of `end` samples that a rectangle from `low` on touches, and the first one behind it. */
static int64_t first_sample(double low) { return most((int64_t)floor(low - 0.5), 0); }
static int64_t last_sample(double high, int64_t end) { return least((int64_t)floor(high + 0.5) + 1, end); }

/* A pixel, for what may be visible in it. */
typedef struct {
    const FaceSides *sides;
    Rays rays;
    int64_t y, x;
} Pixel;

/* Whether a face is certainly outside a pixel: one of its sides has all corners of the pixel on its outer side. */
static bool is_outside(const Pixel *pixel, int64_t face) {
    for (int side = 0; side < SIDES; side++) {
        int outside = 0;
        for (int corner = 0; corner < 4; corner++)
            outside += dot(pixel->sides[face][side],
                           corner_of(pixel->rays, pixel->y + corner / 2, pixel->x + corner % 2)) < 0.0;
        if (outside == 4) return true;
    }
    return false;
}

/* List the faces of the samples that touch a rectangle, and those of n that touch them, of a pixel only if they may
   reach into it; return their number. */
static int64_t list_between(Shown shown, Bounds bounds, const int64_t *touching, int64_t n_touching, const Pixel *pixel,
                            int64_t *faces) {
    const int64_t first = first_sample(bounds.left), end = last_sample(bounds.right, shown.columns);
    const int64_t bottom = last_sample(bounds.bottom, shown.rows);
    uint32_t last = 0;
    int64_t n = 0;
    for (int64_t row = first_sample(bounds.top); row < bottom; row++) {
        for (int64_t column = first; column < end; column++) {
            const uint32_t number = shown.numbers[row * shown.columns + column];
            if (number != last && (number & NUMBER_BITS)) n = add_face(faces, n, (int64_t)(number & NUMBER_BITS) - 1);
            last = number;
        }
    }
    const int64_t n_shown = n;
    for (int64_t other = 0; other < n_touching; other++)
        for (int64_t k = 0; k < n_shown; k++)
            if (shown.groups[touching[other]] == shown.groups[faces[k]]) {
                if (!pixel || !is_outside(pixel, touching[other])) n = add_face(faces, n, touching[other]);
                break;
            }
    return n;
}

/* Write the candidates of each tile of a band. */
EXPORT void list_in_tiles(const uint32_t *numbers, int64_t rows, int64_t columns, const int64_t *groups, int64_t faces,
                          const int64_t *touching, int64_t tiles, int64_t room, const int64_t *n_touching,
                          const double *boxes, int64_t *found, int64_t *counts) {
    const Shown shown = {numbers, rows, columns, groups};
    (void)faces;
    for (int64_t tile = 0; tile < tiles; tile++) {
        const double *box = boxes + 6 * tile;
        const Bounds bounds = {box[0], box[1], box[3], box[4]};
        counts[tile] = list_between(shown, bounds, touching + tile * room, n_touching[tile], 0, found + LIST * tile);
    }
}

/* The bounds of a pixel in the image of numbers. */
static Bounds pixel_bounds(Rays positions, int64_t y, int64_t x) {
    Bounds bounds = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (int corner = 0; corner < 4; corner++) {
        const double *position = corner_of(positions, y + corner / 2, x + corner % 2);
        bounds.left = lesser(bounds.left, position[0]);
        bounds.right = greater(bounds.right, position[0]);
        bounds.top = lesser(bounds.top, position[1]);
        bounds.bottom = greater(bounds.bottom, position[1]);
    }
    return bounds;
}

/* Write the candidates of each pixel of those tiles that have too many, behind those of tiles. */
EXPORT void list_in_pixels(const uint32_t *numbers, int64_t rows, int64_t columns, const int64_t *groups, int64_t faces,
                           const int64_t *touching, int64_t tiles, int64_t room, const int64_t *n_touching,
                           const double *positions, int64_t corner_rows, int64_t corner_columns, const double *rays,
                           const double *sides, int64_t poses, int64_t tile_width,
                           const bool *full, int64_t *found, int64_t lists, int64_t *counts, int64_t *alone,
                           int64_t *cells, int64_t height, int64_t width) {
    const Shown shown = {numbers, rows, columns, groups};
    const Rays corners = rays_of(positions, corner_rows, corner_columns);
    int64_t cell = tiles;
    (void)faces, (void)lists, (void)poses;
    for (int64_t pixel = 0; pixel < height * width; pixel++) {
        const int64_t tile = pixel % width / tile_width;
        if (!full[tile]) continue;
        const Bounds bounds = pixel_bounds(corners, pixel / width, pixel % width);
        const Pixel here = {(const FaceSides *)sides, rays_of(rays, corner_rows, corner_columns), pixel / width,
                            pixel % width};
        counts[cell] = list_between(shown, bounds, touching + tile * room, n_touching[tile], &here, found + LIST * cell);
        if (counts[cell] > MOST_FACES) alone[cell] = CROWDED;
        cells[pixel] = cell++;
    }
}

/* A direction or position within a pixel, between those of its corners. */
static void between_corners(Rays corners, int64_t y, int64_t x, double s, double t, double *out) {
    const double *c00 = corner_of(corners, y, x), *c10 = corner_of(corners, y, x + 1);
    const double *c01 = corner_of(corners, y + 1, x), *c11 = corner_of(corners, y + 1, x + 1);
    for (int axis = 0; axis < 3; axis++) {
        const double above = (1.0 - s) * c00[axis] + s * c10[axis], below = (1.0 - s) * c01[axis] + s * c11[axis];
        out[axis] = (1.0 - t) * above + t * below;
    }
}

/* Write the part of a pixel that begins at (left, top), both 0…1, in a face's coordinates. */
static void keep_part(const FaceSides *sides, Rays rays, int64_t y, int64_t x, double left, double top,
                      Polygon polygon) {
    for (int corner = 0; corner < 4; corner++) {
        Vector ray;
        between_corners(rays, y, x, left + (corner + 1) / 2 % 2 / (double)SAMPLES, top + corner / 2 / (double)SAMPLES,
                        ray);
        const double w = greater(dot((*sides)[DEPTH], ray), 1e-12);
        for (int axis = 0; axis < 2; axis++) polygon[corner][axis] = dot((*sides)[axis], ray) / w;
    }
}

/* The face that a sample shows, −1 for none; beyond the border, the nearest sample. */
static int64_t number_at(Shown shown, double row, double column) {
    const int64_t i = (int64_t)clamp(floor(row), 0.0, (double)(shown.rows - 1));
    const int64_t j = (int64_t)clamp(floor(column), 0.0, (double)(shown.columns - 1));
    return (int64_t)(shown.numbers[i * shown.columns + j] & NUMBER_BITS) - 1;
}

/* List the parts of `count` CROWDED pixels, and add background where none is shown; return their number. */
EXPORT int64_t cut_crowded(const double *rays, int64_t corner_rows, int64_t corner_columns, const double *sides,
                           int64_t poses, int64_t faces, const uint32_t *numbers, int64_t rows, int64_t columns,
                           const double *positions, const int64_t *pixels, int64_t count, const double *background,
                           int64_t height, int64_t width, int64_t channels, double *polygons, int64_t n,
                           int64_t *pieces, double *shares, float *out) {
    const Rays corners = rays_of(rays, corner_rows, corner_columns),
               samples = rays_of(positions, corner_rows, corner_columns);
    const Shown shown = {numbers, rows, columns, 0};
    int64_t total = 0;
    (void)poses, (void)faces, (void)n, (void)height;
    for (int64_t k = 0; k < count * SAMPLES * SAMPLES; k++) {
        const int64_t *pixel = pixels + 2 * (k / (SAMPLES * SAMPLES)), y = pixel[0], x = pixel[1];
        const double left = k % SAMPLES / (double)SAMPLES, top = k / SAMPLES % SAMPLES / (double)SAMPLES;
        Vector middle;
        between_corners(samples, y, x, left + 0.5 / SAMPLES, top + 0.5 / SAMPLES, middle);
        const int64_t face = number_at(shown, middle[1], middle[0]);
        if (face < 0) {
            for (int64_t i = (y * width + x) * channels; i < (y * width + x + 1) * channels; i++)
                add_level(out + i, background[i] / (SAMPLES * SAMPLES));
            continue;
        }
        const Piece made = {y, x, face, 4};
        memcpy(pieces + PIECE_COLUMNS * total, made, sizeof made);
        keep_part((const FaceSides *)sides + face, corners, y, x, left, top, ((Polygon *)polygons)[total]);
        shares[total++] = 1.0 / (SAMPLES * SAMPLES);
    }
    return total;
}
