/* Serves peakmark/surf/stages.py. */

#include <string.h>
#include "surf_exact.h"

/* Fill both with the responses of filters a step apart, the first in the image's corner. */
EXPORT void layer_responses(const int32_t *integral, int64_t height, int64_t stride, int64_t step, int64_t side, float *det,
                            int64_t rows, int64_t columns, float *trace) {
    (void)height;
    for (int64_t i = 0; i < rows; i++)
        for (int64_t j = 0; j < columns; j++) {
            derivatives d = exact_derivatives((const uint32_t *)integral, stride, (i * stride + j) * step, side);
            det[i * columns + j] = determinant_of(d);
            trace[i * columns + j] = d.xx + d.yy;
        }
}

/* Write the records of those of grid positions (n, 2) of the middle of three layers that are maxima; return how many. */
EXPORT int64_t refine_maxima(const float *layers, int64_t rows, int64_t columns, const float *trace, int64_t octave,
                             int64_t index, int64_t margin, const int64_t *positions, int64_t n, float *records) {
    int64_t count = 0;
    for (int64_t k = 0; k < n; k++) {
        int64_t i = positions[2 * k], j = positions[2 * k + 1];
        if (i < margin || i >= rows - margin || j < margin || j >= columns - margin) continue;
        float cube[3][3][3];
        for (int64_t level = 0; level < 3; level++)
            for (int64_t di = 0; di < 3; di++)
                memcpy(cube[level][di], layers + (level * rows + i + di - 1) * columns + j - 1, sizeof cube[0][0]);
        newton_step step = newton_offset(cube);
        if (!step.is_ok || !(cube[1][1][1] > strongest_neighbour(cube))) continue;
        write_record(records + RECORD * count++, octave, index, i, j, cube[1][1][1], trace[i * columns + j], step);
    }
    return count;
}
