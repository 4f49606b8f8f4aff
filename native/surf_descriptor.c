/* Serves peakmark/surf/descriptor.py. */

#include <math.h>
#include <string.h>
#include "surf_window.h"

enum { CELLS = 4, ROWS_EACH = 5, MOST_ENTRIES = 8 };
typedef float sums_of_rows[MOST_ENTRIES][PATCH_PITCH];

/* Weighted 2×2 gradients between a patch column's pixels and those right of and below them; weights beyond are zero. */
static void gradients(const int32_t *restrict patch, const float *restrict weights, float *restrict dx,
                      float *restrict dy) {
    for (int64_t i = 0; i < PATCH_PITCH; i++) {
        int32_t a = patch[i], b = patch[i + PATCH_PITCH], c = patch[i + 1], d = patch[i + PATCH_PITCH + 1];
        dx[i] = (float)(b - a + d - c) * weights[i];
        dy[i] = (float)(c - a + d - b) * weights[i];
    }
}

/* Add dx, dy, |dx| and |dy| of a patch column to the sums of its rows. */
static void add_gradients(const float *restrict dx, const float *restrict dy, sums_of_rows sums) {
    for (int64_t i = 0; i < PATCH_PITCH; i++) {
        sums[0][i] += dx[i], sums[1][i] += dy[i];
        sums[2][i] += fabsf(dx[i]), sums[3][i] += fabsf(dy[i]);
    }
}

/* Add dx and |dx| where dy ≥ 0, then where dy < 0; dy and |dy| where dx ≥ 0, then where dx < 0. */
static void add_by_sign(const float *restrict dx, const float *restrict dy, sums_of_rows sums) {
    for (int64_t i = 0; i < PATCH_PITCH; i++) {
        bool is_down = dy[i] >= 0, is_right = dx[i] >= 0;
        float x = dx[i], y = dy[i], size_x = fabsf(x), size_y = fabsf(y);
        sums[0][i] += is_down ? x : 0, sums[1][i] += is_down ? size_x : 0;
        sums[2][i] += is_down ? 0 : x, sums[3][i] += is_down ? 0 : size_x;
        sums[4][i] += is_right ? y : 0, sums[5][i] += is_right ? size_y : 0;
        sums[6][i] += is_right ? 0 : y, sums[7][i] += is_right ? 0 : size_y;
    }
}

/* Add the five rows of each of a column's four cells; a descriptor has the cells row by row. */
static void fold(sums_of_rows sums, int64_t entries, int64_t column, float *descriptor) {
    for (int64_t row = 0; row < CELLS; row++)
        for (int64_t entry = 0; entry < entries; entry++) {
            const float *s = sums[entry] + ROWS_EACH * row;
            descriptor[(CELLS * row + column) * entries + entry] = s[0] + s[1] + s[2] + s[3] + s[4];
        }
}

/* Scale to unit length; zeros stay. */
static void normalise(float *descriptor, int64_t length) {
    double energy = 0;
    for (int64_t k = 0; k < length; k++) energy += descriptor[k] * descriptor[k];
    float scale = (float)(1.0 / (sqrt(energy) + (double)1.1920929e-07f));
    for (int64_t k = 0; k < length; k++) descriptor[k] *= scale;
}

static void describe(const int32_t *patch, const float *weights, bool extended, float *descriptor) {
    int64_t entries = extended ? 8 : 4;
    float dx[PATCH_PITCH], dy[PATCH_PITCH];
    for (int64_t column = 0; column < CELLS; column++) {
        sums_of_rows sums = {{0}};
        for (int64_t j = ROWS_EACH * column; j < ROWS_EACH * (column + 1); j++) {
            gradients(patch + j * PATCH_PITCH, weights + j * PATCH_PITCH, dx, dy);
            (extended ? add_by_sign : add_gradients)(dx, dy, sums);
        }
        fold(sums, entries, column, descriptor);
    }
    normalise(descriptor, CELLS * CELLS * entries);
}

EXPORT status describe_rows(const uint16_t *pairs, int64_t height, int64_t stride, int64_t width, const int64_t *rows,
                            int64_t count, const float *xy, int64_t n, const int32_t *sides, const float *angle,
                            bool extended, bool upright, const float *weights, float *descriptors, int64_t length) {
    (void)n;
    memory taken = {.count = 0};
    buffers b;
    int64_t largest = 1;
    const paired image = {pairs, stride, height, width};
    for (int64_t k = 0; k < count; k++) largest = most(largest, sides[rows[k]]);
    bool is_ready = take_buffers(&b, largest, &taken);
    for (int64_t k = 0; is_ready && k < count; k++) {
        int64_t row = rows[k];
        if (upright) sample_upright(&image, xy[2 * row], xy[2 * row + 1], sides[row], &b);
        else sample_rotated(&image, xy[2 * row], xy[2 * row + 1], angle[row], sides[row], &b);
        average_areas(sides[row], &b);
        describe(b.patch, weights, extended, descriptors + row * length);
    }
    give_back(&taken);
    return is_ready ? DONE : OUT_OF_MEMORY;
}
