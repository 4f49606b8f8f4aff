/* Serves peakmark/identification/evidence.py. */

#include "peak.h"

/* Sum of a row's pixels, and of their squares; rows are shorter than 66 000 px. */
static void add_row(const uint8_t *row, int64_t n, int64_t *sum, int64_t *squares) {
    uint32_t values = 0, products = 0;
    for (int64_t x = 0; x < n; x++) {
        uint32_t value = row[x];
        values += value, products += value * value;
    }
    *sum += values, *squares += products;
}

/* Variances of the pixels in boxes (left, top, right, bottom), half-open and inside the image; 0 of empty ones. */
EXPORT void box_variances(const uint8_t *gray, int64_t height, int64_t width, const int64_t *boxes, int64_t n,
                          double *variances) {
    enum { PIECE = 65536 };
    (void)height;
    for (int64_t k = 0; k < n; k++) {
        const int64_t *box = boxes + 4 * k, across = box[2] - box[0];
        int64_t sum = 0, squares = 0, count = most(across * (box[3] - box[1]), 1);
        for (int64_t y = box[1]; y < box[3]; y++)
            for (int64_t x = box[0]; x < box[2]; x += PIECE)
                add_row(gray + y * width + x, least(PIECE, box[2] - x), &sum, &squares);
        double mean = (double)sum / (double)count;
        variances[k] = greater((double)squares / (double)count - mean * mean, 0);
    }
}
