/* Serves peakmark/surf/integral.py. Sums are kept modulo 2^32. */

#include "peak.h"

static void add_row(const uint8_t *restrict row, int64_t width, uint32_t *restrict sums) {
    for (int64_t x = 0; x < width; x++) sums[x] += row[x];
}

EXPORT void sum_columns(const uint8_t *pixels, int64_t rows, int64_t width, int32_t *sums) {
    for (int64_t y = 0; y < rows; y++) add_row(pixels + y * width, width, (uint32_t *)sums);
}

static void integrate_row(const uint8_t *restrict row, const uint32_t *restrict before, int64_t width,
                          uint32_t *restrict sums) {
    uint32_t running = 0;
    for (int64_t x = 0; x < width; x++) {
        running += row[x];
        sums[x] = before[x] + running;
    }
}

/* Fill the rows of one band; `above` (width,) is the integral row over the band, without its leading zero. */
EXPORT void integrate(const uint8_t *pixels, int64_t rows, int64_t width, const int32_t *above, int32_t *sums,
                      int64_t room, int64_t stride) {
    uint32_t *out = (uint32_t *)sums;
    for (int64_t y = 0; y < least(rows, room); y++) {
        out[y * stride] = 0;
        const uint32_t *before = y == 0 ? (const uint32_t *)above : out + (y - 1) * stride + 1;
        integrate_row(pixels + y * width, before, width, out + y * stride + 1);
    }
}
