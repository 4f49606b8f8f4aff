/* Serves peakmark/surf/exact.py, and the search in surf_hessian.c: OpenCV's own arithmetic, the same roundings in the
   same order. */

#include <math.h>
#include "surf_exact.h"

/* Sum over the box from sums[corner] to sums[corner + down + right]. */
static uint32_t box_sum(const uint32_t *sums, int64_t corner, int64_t down, int64_t right) {
    const uint32_t *at = sums + corner;
    return at[0] + at[down + right] - at[right] - at[down];
}

static float box_mean(const uint32_t *sums, int64_t corner, int64_t down, int64_t right, float one_by_area) {
    return (float)(int32_t)box_sum(sums, corner, down, right) * one_by_area;
}

/* First − 2 middle + last third of a box, as means; `across` and `along` are steps in `sums`. */
static float thirds(const uint32_t *sums, int64_t corner, int64_t across, int64_t along, float mean) {
    float first = box_mean(sums, corner, across, along, mean);
    float middle = box_mean(sums, corner + along, across, along, -2.0f * mean);
    float last = box_mean(sums, corner + 2 * along, across, along, mean);
    return (float)((double)first + (double)middle + (double)last);
}

/* Dxx, Dyy and Dxy of the filter with its corner at sums[corner], in OpenCV's arithmetic and order. */
derivatives exact_derivatives(const uint32_t *sums, int64_t stride, int64_t corner, int64_t side) {
    int64_t third = side / 3, low = (4 * side + 9) / 18, near = (2 * side + 9) / 18, far = side - near - third;
    float mean = 1.0f / (float)(third * (side - 2 * low)), mixed_mean = 1.0f / (float)(third * third);
    float xx = thirds(sums, corner + low * stride, (side - 2 * low) * stride, third, mean);
    float yy = thirds(sums, corner + low, side - 2 * low, third * stride, mean);
    double xy = 0.0;
    xy += box_mean(sums, corner + near * stride + near, third * stride, third, mixed_mean);
    xy -= box_mean(sums, corner + near * stride + far, third * stride, third, mixed_mean);
    xy -= box_mean(sums, corner + far * stride + near, third * stride, third, mixed_mean);
    xy += box_mean(sums, corner + far * stride + far, third * stride, third, mixed_mean);
    return (derivatives){xx, yy, (float)xy};
}

float determinant_of(derivatives d) { return d.xx * d.yy - DXY_WEIGHT * d.xy * d.xy; }

/* First − 2 middle + last third of a box: whole − 3 middle. */
static uint32_t sum_thirds(const uint32_t *sums, int64_t corner, int64_t across, int64_t along) {
    return box_sum(sums, corner, across, 3 * along) - 3 * box_sum(sums, corner + along, across, along);
}

/* The determinant but for the last bits: each derivative is one integer before it is rounded. */
float quick_response(const uint32_t *sums, int64_t stride, int64_t corner, int64_t side) {
    int64_t third = side / 3, low = (4 * side + 9) / 18, near = (2 * side + 9) / 18, far = side - near - third;
    uint32_t xx = sum_thirds(sums, corner + low * stride, (side - 2 * low) * stride, third);
    uint32_t yy = sum_thirds(sums, corner + low, side - 2 * low, third * stride);
    int64_t rows = third * stride, upper = corner + near * stride, lower = corner + far * stride;
    uint32_t xy = box_sum(sums, upper + near, rows, third) - box_sum(sums, upper + far, rows, third) +
                  box_sum(sums, lower + far, rows, third) - box_sum(sums, lower + near, rows, third);
    float mean = (float)(1.0 / (double)(third * (side - 2 * low)));
    float mixed = (float)(int32_t)xy * (float)(1.0 / (double)(third * third));
    return (float)(int32_t)xx * mean * ((float)(int32_t)yy * mean) - DXY_WEIGHT * mixed * mixed;
}

/* Responses of a layer at the 3×3 grid positions around (i, j). */
void fill_layer(const uint32_t *sums, int64_t stride, int64_t octave, int64_t index, int64_t i, int64_t j, bool exactly,
                float values[3][3]) {
    int64_t side = side_of(octave, index);
    for (int64_t di = 0; di < 3; di++)
        for (int64_t dj = 0; dj < 3; dj++) {
            int64_t corner = corner_of(stride, octave, index, i + di - 1, j + dj - 1);
            values[di][dj] = exactly ? determinant_of(exact_derivatives(sums, stride, corner, side))
                                     : quick_response(sums, stride, corner, side);
        }
}

/* Largest of the 26 values around the middle of a cube. */
float strongest_neighbour(float cube[3][3][3]) {
    float strongest = -INFINITY;
    for (int s = 0; s < 3; s++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                if ((s != 1 || i != 1 || j != 1) && cube[s][i][j] > strongest) strongest = cube[s][i][j];
    return strongest;
}

/* OpenCV's rule: at least half of the filter square is inside the mask. */
bool mask_accepts(const uint32_t *mask_sums, int64_t stride, int64_t corner, int64_t side) {
    return box_mean(mask_sums, corner, side * stride, side, 1.0f / (float)(side * side)) >= 0.5f;
}

/* Not ok where the step is exactly zero or longer than 1 along an axis. Cramer's rule, rounded as OpenCV's. */
newton_step newton_offset(float cube[3][3][3]) {
    float(*below)[3] = cube[0], (*here)[3] = cube[1], (*above)[3] = cube[2];
    float v = here[1][1];
    float bx = (here[1][0] - here[1][2]) * 0.5f, by = (here[0][1] - here[2][1]) * 0.5f;
    float bs = (below[1][1] - above[1][1]) * 0.5f;
    float xx = here[1][0] - 2.0f * v + here[1][2], yy = here[0][1] - 2.0f * v + here[2][1];
    float ss = below[1][1] - 2.0f * v + above[1][1];
    float xy = (here[2][2] - here[2][0] - here[0][2] + here[0][0]) * 0.25f;
    float xs = (above[1][2] - above[1][0] - below[1][2] + below[1][0]) * 0.25f;
    float ys = (above[2][1] - above[0][1] - below[2][1] + below[0][1]) * 0.25f;
    float determinant = xx * (yy * ss - ys * ys) - xy * (xy * ss - ys * xs) + xs * (xy * ys - yy * xs);
    if (determinant == 0.0f) return (newton_step){0};
    float d = (float)(1.0 / (double)determinant);
    float dx = d * (bx * (yy * ss - ys * ys) - xy * (by * ss - ys * bs) + xs * (by * ys - yy * bs));
    float dy = d * (xx * (by * ss - ys * bs) - bx * (xy * ss - ys * xs) + xs * (xy * bs - by * xs));
    float ds = d * (xx * (yy * bs - by * ys) - xy * (xy * bs - by * xs) + bx * (xy * ys - yy * xs));
    bool moves = dx != 0 || dy != 0 || ds != 0;
    return (newton_step){moves && fabsf(dx) <= 1 && fabsf(dy) <= 1 && fabsf(ds) <= 1, dx, dy, ds};
}

/* Write the key point at grid position (i, j) of a layer, a Newton step farther on. */
void write_record(float *record, int64_t octave, int64_t index, int64_t i, int64_t j, float response, float trace,
                  newton_step step) {
    int64_t offset = 4 + 3 * index, side = side_of(octave, index), grid = (int64_t)1 << octave;
    float half = (float)(side - 1) * 0.5f;
    record[0] = (float)((j - offset) * grid) + half + step.x * (float)grid;
    record[1] = (float)((i - offset) * grid) + half + step.y * (float)grid;
    record[2] = (float)side + step.layer * (float)(6 << octave);
    record[3] = rintf(record[2]);
    record[4] = response;
    record[5] = (float)octave;
    record[6] = (float)((trace > 0) - (trace < 0));
}

EXPORT void filter_at(const int32_t *integral, int64_t height, int64_t stride, int64_t row, int64_t column, int64_t side,
                      float *derivatives_at, float *responses) {
    (void)height;
    const uint32_t *sums = (const uint32_t *)integral;
    derivatives d = exact_derivatives(sums, stride, row * stride + column, side);
    derivatives_at[0] = d.xx, derivatives_at[1] = d.yy, derivatives_at[2] = d.xy;
    responses[0] = determinant_of(d), responses[1] = quick_response(sums, stride, row * stride + column, side);
}

EXPORT bool newton_step_of(const float *cube, float *step) {
    float copy[3][3][3];
    for (int k = 0; k < 27; k++) copy[k / 9][k / 3 % 3][k % 3] = cube[k];
    newton_step found = newton_offset(copy);
    step[0] = found.x, step[1] = found.y, step[2] = found.layer;
    return found.is_ok;
}

EXPORT bool mask_accepts_at(const int32_t *mask, int64_t height, int64_t stride, int64_t row, int64_t column,
                            int64_t side) {
    (void)height;
    return mask_accepts((const uint32_t *)mask, stride, row * stride + column, side);
}
