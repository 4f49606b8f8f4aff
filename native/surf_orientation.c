/* Serves peakmark/surf/orientation.py. */

#include <math.h>
#include <string.h>
#include "peak.h"

enum { RADIUS = 6, LINES = 2 * RADIUS + 1, SAMPLES = 113, GROUPS = 72, CIRCLE = GROUPS + 12 };
static const float CLOSE = 1 - 0x1p-12f; /* windows within this factor of the strongest are summed again */
static const float NO_SAMPLE = -1;

/* Haar responses around one key point: `count` of them, and their directions in whole degrees 0…359. */
typedef struct {
    int64_t count;
    float x[SAMPLES], y[SAMPLES];
    int32_t degrees[SAMPLES];
} responses;

/* Angle of (x, y) in degrees, 0…360: OpenCV's polynomial of order 7, good to 0.01°. */
static float atan2_degrees(float y, float x) {
    float ax = fabsf(x), ay = fabsf(y);
    float c = (ax < ay ? ax : ay) / ((ax > ay ? ax : ay) + 2.220446049250313e-16f), c2 = c * c;
    float angle = (((-2.5397246f * c2 + 8.9140005f) * c2 - 18.667446f) * c2 + 57.283627f) * c;
    angle = ay > ax ? 90.0f - angle : angle;
    angle = x < 0 ? 180.0f - angle : angle;
    return y < 0 ? 360.0f - angle : angle;
}

EXPORT void fast_atan2(const float *y, int64_t n, const float *x, float *degrees) {
    for (int64_t i = 0; i < n; i++) degrees[i] = atan2_degrees(y[i], x[i]);
}

/* First row or column, times the stride, of the Haar filters on each line of samples; −1 outside the image. */
static void index_lines(float center, float s, int64_t half, int64_t length, int64_t stride, int64_t *indices) {
    float reach = (float)(2 * half - 1) / 2.0f;
    for (int64_t k = 0; k < LINES; k++) {
        int64_t first = (int64_t)rintf(center + (float)(k - RADIUS) * s - reach);
        indices[k] = 0 <= first && first <= length - 2 * half ? first * stride : -1;
    }
}

/* Indices of the top-left corners of the Haar filters inside the image, and their weights; return their number. */
static int64_t index_samples(int64_t indices[2][LINES], const int64_t *offsets, const float *weights, int64_t *corners,
                             float *kept) {
    int64_t count = 0;
    for (int64_t k = 0; k < SAMPLES; k++) {
        int64_t column = indices[0][offsets[2 * k] + RADIUS], row = indices[1][offsets[2 * k + 1] + RADIUS];
        corners[count] = row + column, kept[count] = weights[k];
        count += (row | column) >= 0;
    }
    return count;
}

/* Sums of the west, east, north and south halves of the Haar filters. */
static void sum_boxes(const uint32_t *sums, const int64_t *corners, int64_t count, int64_t half, int64_t half_rows,
                      int32_t boxes[4][SAMPLES]) {
    for (int64_t k = 0; k < count; k++) {
        const uint32_t *a = sums + corners[k], *m = a + half_rows, *b = m + half_rows;
        uint32_t a0 = a[0], a1 = a[half], a2 = a[2 * half], m0 = m[0], m2 = m[2 * half];
        uint32_t b0 = b[0], b1 = b[half], b2 = b[2 * half];
        boxes[0][k] = (int32_t)((b1 - b0) - (a1 - a0)), boxes[1][k] = (int32_t)((b2 - b1) - (a2 - a1));
        boxes[2][k] = (int32_t)((m2 - m0) - (a2 - a0)), boxes[3][k] = (int32_t)((b2 - b0) - (m2 - m0));
    }
}

/* Weighted Haar responses and their direction, each box mean rounded as OpenCV's. */
static void haar_responses(int32_t boxes[4][SAMPLES], const float *weights, float mean, responses *found) {
    for (int64_t k = 0; k < found->count; k++) {
        found->x[k] = ((float)boxes[1][k] * mean - (float)boxes[0][k] * mean) * weights[k];
        found->y[k] = ((float)boxes[2][k] * mean - (float)boxes[3][k] * mean) * weights[k];
    }
    for (int64_t k = 0; k < found->count; k++) {
        float degree = rintf(atan2_degrees(found->y[k], found->x[k]));
        found->degrees[k] = degree >= 0 && degree < 360 ? (int32_t)degree : 0; /* nan of filters without a pixel, too */
    }
}

/* The vectors summed by direction: the exact multiples of 5°, and the other vectors of the groups of 5° between them.
   The circle begins six groups early and ends six late, so that windows need not wrap. */
typedef struct {
    float exact_x[CIRCLE], exact_y[CIRCLE], rest_x[CIRCLE], rest_y[CIRCLE];
} circle;

static void close_circle(float *sums) {
    memcpy(sums, sums + GROUPS, 6 * sizeof *sums);
    memcpy(sums + GROUPS + 6, sums + 6, 6 * sizeof *sums);
}

static void bin_directions(const responses *found, circle *bins) {
    memset(bins, 0, sizeof *bins);
    for (int64_t k = 0; k < found->count; k++) {
        int32_t group = found->degrees[k] / 5;
        bool is_exact = found->degrees[k] == 5 * group;
        *((is_exact ? bins->exact_x : bins->rest_x) + group + 6) += found->x[k];
        *((is_exact ? bins->exact_y : bins->rest_y) + group + 6) += found->y[k];
    }
    close_circle(bins->exact_x), close_circle(bins->exact_y), close_circle(bins->rest_x), close_circle(bins->rest_y);
}

/* Add the squared sum over each window: twelve groups from six early on, without the first exact multiple of 5°. */
static void add_window_lengths(const float *exact, const float *rest, float *lengths) {
    float all[CIRCLE], pairs[CIRCLE], fours[CIRCLE];
    for (int64_t k = 0; k < CIRCLE; k++) all[k] = rest[k] + exact[k];
    for (int64_t k = 0; k < CIRCLE - 1; k++) pairs[k] = all[k] + all[k + 1];
    for (int64_t k = 0; k < CIRCLE - 3; k++) fours[k] = pairs[k] + pairs[k + 2];
    for (int64_t k = 0; k < GROUPS; k++) {
        float total = fours[k] + fours[k + 4] + fours[k + 8] - exact[k];
        lengths[k] += total * total;
    }
}

/* Sum of the vectors less than 30° from the centre, in order. */
static void sum_window(const responses *found, int32_t center, float *sum_x, float *sum_y) {
    *sum_x = *sum_y = 0;
    for (int64_t k = 0; k < found->count; k++) {
        int32_t apart = found->degrees[k] < center ? center - found->degrees[k] : found->degrees[k] - center;
        bool is_inside = apart < 30 || apart > 330;
        *sum_x += is_inside ? found->x[k] : 0;
        *sum_y += is_inside ? found->y[k] : 0;
    }
}

/* The angle of the 60° window, tried every 5°, where the sum of vectors is longest. Sums over groups tell which windows
   can win; only those are summed vector by vector, in OpenCV's order. */
static float strongest_window(const responses *found) {
    circle bins;
    float lengths[GROUPS] = {0}, highest = 0, best = 0, best_x = 0, best_y = 0;
    bin_directions(found, &bins);
    add_window_lengths(bins.exact_x, bins.rest_x, lengths);
    add_window_lengths(bins.exact_y, bins.rest_y, lengths);
    for (int64_t window = 0; window < GROUPS; window++)
        highest = lengths[window] > highest ? lengths[window] : highest;
    for (int32_t window = 0; window < GROUPS; window++) {
        if (!(lengths[window] >= highest * CLOSE)) continue;
        float sum_x, sum_y;
        sum_window(found, 5 * window, &sum_x, &sum_y);
        float length = sum_x * sum_x + sum_y * sum_y;
        if (length > best) best = length, best_x = sum_x, best_y = sum_y;
    }
    return atan2_degrees(-best_y, best_x);
}

EXPORT void measure_angles(const int32_t *integral, int64_t rows, int64_t stride, int64_t height, int64_t width,
                           const float *xy, int64_t n, const float *size, const int64_t *offsets, const float *weights,
                           float *angles) {
    (void)rows;
    for (int64_t k = 0; k < n; k++) {
        float s = size[k] * 1.2f / 9.0f, kept[SAMPLES + 1];
        int64_t half = (int64_t)rintf(2.0f * s), indices[2][LINES], corners[SAMPLES + 1];
        int32_t boxes[4][SAMPLES];
        responses found;
        index_lines(xy[2 * k], s, half, width, 1, indices[0]);
        index_lines(xy[2 * k + 1], s, half, height, stride, indices[1]);
        found.count = index_samples(indices, offsets, weights, corners, kept);
        if (found.count == 0) {
            angles[k] = NO_SAMPLE;
            continue;
        }
        sum_boxes((const uint32_t *)integral, corners, found.count, half, half * stride, boxes);
        haar_responses(boxes, kept, 1.0f / (float)(2 * half * half), &found);
        angles[k] = strongest_window(&found);
    }
}
