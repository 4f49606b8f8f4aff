/* Serves peaksim/area/cells.py: the directions of tiles, and how steep the faces in them are. */

#include "area.h"

/* Width of a tile, px. */
enum { TILE = 16 };

/* Write the least and largest directions of the corners of each tile of a band. */
EXPORT void bound_tiles(const double *rays, int64_t rows, int64_t columns, double *boxes, int64_t tiles) {
    double low[3 * (TILE + 1)], high[3 * (TILE + 1)];
    for (int64_t tile = 0; tile < tiles; tile++) {
        const int64_t first = tile * TILE, n = 3 * (least(TILE, columns - 1 - first) + 1);
        double *box = boxes + 6 * tile;
        for (int64_t k = 0; k < n; k++) low[k] = high[k] = rays[3 * first + k];
        for (int64_t y = 1; y < rows; y++) {
            const double *row = rays + 3 * (y * columns + first);
            for (int64_t k = 0; k < n; k++) {
                low[k] = lesser(row[k], low[k]);
                high[k] = greater(row[k], high[k]);
            }
        }
        for (int axis = 0; axis < 3; axis++) {
            box[axis] = INFINITY;
            box[axis + 3] = -INFINITY;
        }
        for (int64_t k = 0; k < n; k++) {
            box[k % 3] = lesser(low[k], box[k % 3]);
            box[k % 3 + 3] = greater(high[k], box[k % 3 + 3]);
        }
    }
}

/* Raise `steepest` to the shares of its depth by which a face's depth changes from one pixel to the next across and
   down, between the corners of a tile. */
static void measure_steepness(const double *w, Rays rays, int64_t height, int64_t first, int64_t end, double least_w,
                              double *steepest) {
    const double upper_left = dot(w, corner_of(rays, 0, first)), upper_right = dot(w, corner_of(rays, 0, end));
    const double lower_left = dot(w, corner_of(rays, height, first)),
                 lower_right = dot(w, corner_of(rays, height, end));
    const double nearest = lesser(lesser(upper_left, upper_right), lesser(lower_left, lower_right));
    const double across =
        greater(fabs(upper_right - upper_left), fabs(lower_right - lower_left)) / (double)(end - first);
    const double down = greater(fabs(lower_left - upper_left), fabs(lower_right - upper_right)) / (double)height;
    steepest[0] = greater(across / greater(nearest, least_w), steepest[0]);
    steepest[1] = greater(down / greater(nearest, least_w), steepest[1]);
}

/* Write how steep the textured faces of a band are, from every so manyth row and column of its tiles. */
EXPORT void find_steepest(const double *rays, int64_t rows, int64_t columns, const double *sides, int64_t poses,
                          int64_t faces, const bool *printed, const double *least_w, const int64_t *owners,
                          int64_t height, int64_t width, int64_t sampled_every, double *steepest) {
    const Rays corners = rays_of(rays, rows, columns);
    (void)poses, (void)faces;
    steepest[0] = steepest[1] = 0.0;
    for (int64_t first = 0; first < width; first += TILE) {
        const int64_t end = least(first + TILE, width);
        int64_t last = NOTHING;
        for (int64_t y = 0; y < height; y += sampled_every) {
            for (int64_t x = first; x < end; x += sampled_every) {
                const int64_t face = owners[y * width + x];
                if (face < 0 || face == last || !printed[face]) continue;
                const double *w = ((const FaceSides *)sides)[face][DEPTH];
                measure_steepness(w, corners, height, first, end, least_w[face], steepest);
                last = face;
            }
        }
    }
}
