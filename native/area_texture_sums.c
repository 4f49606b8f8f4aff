/* Serves peaksim/area/texture_sums.py: the summed-area tables of textures, in one pass over the texels. */

#include "peak.h"

/* Write the sums of the texels, of which one kind is given, of one channel: those above and left of each node. */
static inline void sum_channel(const uint8_t *bytes, const float *levels, int64_t height, int64_t width,
                               int64_t channels, double *above) {
    for (int64_t x = 0; x < width + 3; x++) above[x] = 0.0;
    for (int64_t y = 0; y < height + 2; y++) {
        const int64_t row = least(most(y - 1, 0), height - 1) * width;
        double total = 0.0, *sums = above + width + 3;
        sums[0] = 0.0;
        for (int64_t x = 0; x < width + 2; x++) {
            const int64_t texel = (row + least(most(x - 1, 0), width - 1)) * channels;
            total += bytes ? bytes[texel] : (double)levels[texel];
            sums[x + 1] = above[x + 1] + total;
        }
        above = sums;
    }
}

/* Write the sums of bytes. */
EXPORT void add_bytes(const uint8_t *pixels, int64_t height, int64_t width, int64_t channels, double *out, int64_t rows,
                      int64_t columns) {
    for (int64_t k = 0; k < channels; k++)
        sum_channel(pixels + k, 0, height, width, channels, out + k * rows * columns);
}

/* Write the sums of levels that a material made. */
EXPORT void add_levels(const float *pixels, int64_t height, int64_t width, int64_t channels, double *out, int64_t rows,
                       int64_t columns) {
    for (int64_t k = 0; k < channels; k++)
        sum_channel(0, pixels + k, height, width, channels, out + k * rows * columns);
}
