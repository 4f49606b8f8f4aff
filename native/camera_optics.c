/* Serves peaksim/camera/optics.py: a symmetric filter along the axes of an image, in double precision. */

#include "peak.h"

enum { LANES = 16 }; /* samples whose sums stay in registers */

/* The sample that one beyond the ends stands for: the image is mirrored about its outermost samples. */
static int64_t mirrored(int64_t at, int64_t length) {
    if (length == 1) return 0;
    const int64_t period = 2 * (length - 1);
    at = ((at % period) + period) % period;
    return at < length ? at : period - at;
}

/* Write the filtered values of `count` samples, up to LANES; `before` and `behind` say how far away the samples are
   that each weight but the last, that of the middle, belongs to. */
static inline void filter_lanes(const float *middle, const int64_t *before, const int64_t *behind,
                                const double *weights, int64_t n, int64_t count, float *out) {
    double sums[LANES];
    for (int64_t k = 0; k < count; k++) sums[k] = (double)middle[k] * weights[n - 1];
    for (int64_t tap = 0; tap < n - 1; tap++) {
        const float *a = middle + before[tap], *b = middle + behind[tap];
        for (int64_t k = 0; k < count; k++) sums[k] += ((double)a[k] + (double)b[k]) * weights[tap];
    }
    for (int64_t k = 0; k < count; k++) out[k] = (float)sums[k];
}

static void filter_line(const float *middle, const int64_t *before, const int64_t *behind, const double *weights,
                        int64_t n, int64_t length, float *out) {
    int64_t x = 0;
    for (; x + LANES <= length; x += LANES) filter_lanes(middle + x, before, behind, weights, n, LANES, out + x);
    if (x < length) filter_lanes(middle + x, before, behind, weights, n, length - x, out + x);
}

/* Filter an image along its columns; weights from the farthest pair of neighbours to the middle. Memory: `reach`. */
EXPORT void filter_columns(const float *levels, int64_t height, int64_t width, const double *weights, int64_t n,
                           int64_t *reach, float *out) {
    for (int64_t y = 0; y < height; y++) {
        for (int64_t tap = 0; tap < n; tap++) {
            reach[tap] = (mirrored(y - (n - 1 - tap), height) - y) * width;
            reach[n + tap] = (mirrored(y + (n - 1 - tap), height) - y) * width;
        }
        filter_line(levels + y * width, reach, reach + n, weights, n, width, out + y * width);
    }
}

/* Filter an image along its rows. Memory: `reach`, and `line` for a row with mirrored ends. */
EXPORT void filter_rows(const float *levels, int64_t height, int64_t width, int64_t channels, const double *weights,
                        int64_t n, int64_t *reach, float *line, int64_t longest, float *out) {
    const int64_t end = (n - 1) * channels, row = width * channels;
    (void)longest;
    for (int64_t tap = 0; tap < n; tap++) {
        reach[tap] = -(n - 1 - tap) * channels;
        reach[n + tap] = (n - 1 - tap) * channels;
    }
    for (int64_t y = 0; y < height; y++) {
        const float *from = levels + y * row;
        for (int64_t k = 0; k < row; k++) line[end + k] = from[k];
        for (int64_t x = 1; x < n; x++) {
            const float *left = from + mirrored(-x, width) * channels;
            const float *right = from + mirrored(width - 1 + x, width) * channels;
            for (int64_t channel = 0; channel < channels; channel++) {
                line[end - x * channels + channel] = left[channel];
                line[end + row + (x - 1) * channels + channel] = right[channel];
            }
        }
        filter_line(line + end, reach, reach + n, weights, n, row, out + y * row);
    }
}
