/* Serves peakmark/surf/orientation.py. */

#include <math.h>
#include <string.h>
#include "lanes.h"
#include "peak.h"

enum { RADIUS = 6, LINES = 2 * RADIUS + 1, SAMPLES = 113, GROUPS = 72, CIRCLE = GROUPS + 12 };
static const float CLOSE = 1 - 0x1p-12f; /* windows within this factor of the strongest are summed again */
static const float NO_SAMPLE = -1;

typedef float pair __attribute__((vector_size(8)));

/* Haar responses around one key point: `count` of them, and their directions in whole degrees 0…359. */
typedef struct {
    int64_t count;
    pair xy[SAMPLES];
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
        uint32_t left = b[0] - a[0], middle = b[half] - a[half], right = b[2 * half] - a[2 * half];
        uint32_t north = m[2 * half] - m[0] - (a[2 * half] - a[0]);
        boxes[0][k] = (int32_t)(middle - left), boxes[1][k] = (int32_t)(right - middle);
        boxes[2][k] = (int32_t)north, boxes[3][k] = (int32_t)(right - left - north);
    }
}

/* Weighted Haar responses and their direction, each box mean rounded as OpenCV's. */
static void haar_responses(int32_t boxes[4][SAMPLES], const float *weights, float mean, responses *found) {
    for (int64_t k = 0; k < found->count; k++) {
        float x = ((float)boxes[1][k] * mean - (float)boxes[0][k] * mean) * weights[k];
        float y = ((float)boxes[2][k] * mean - (float)boxes[3][k] * mean) * weights[k];
        float degree = rintf(atan2_degrees(y, x));
        found->xy[k][0] = x, found->xy[k][1] = y;
        found->degrees[k] = degree >= 0 && degree < 360 ? (int32_t)degree : 0; /* nan of filters without a pixel, too */
    }
}

/* The vectors summed by direction: the exact multiples of 5°, and the other vectors of the groups of 5° between them.
   The circle begins six groups early and ends six late, so that windows need not wrap. */
typedef struct {
    pair exact[CIRCLE], rest[CIRCLE];
} circle;

static void close_circle(pair *sums) {
    memcpy(sums, sums + GROUPS, 6 * sizeof *sums);
    memcpy(sums + GROUPS + 6, sums + 6, 6 * sizeof *sums);
}

static void bin_directions(const responses *found, circle *bins) {
    int32_t slots[SAMPLES];
    for (int64_t k = 0; k < found->count; k++) {
        int32_t group = found->degrees[k] / 5;
        slots[k] = group + (found->degrees[k] == 5 * group ? 6 : 6 + CIRCLE);
    }
    memset(bins, 0, sizeof *bins);
    pair *sums = bins->exact; /* and behind them the rest */
    for (int64_t k = 0; k < found->count; k++) sums[slots[k]] += found->xy[k];
    close_circle(bins->exact), close_circle(bins->rest);
}

/* Squared sum over each window: twelve groups from six early on, without the first exact multiple of 5°; x and y
   alternate. */
static void window_lengths(const float *exact, const float *rest, float *lengths) {
    float all[2 * CIRCLE], twos[2 * CIRCLE], fours[2 * CIRCLE], totals[2 * GROUPS];
    for (int64_t k = 0; k < 2 * CIRCLE; k++) all[k] = rest[k] + exact[k];
    for (int64_t k = 0; k < 2 * (CIRCLE - 1); k++) twos[k] = all[k] + all[k + 2];
    for (int64_t k = 0; k < 2 * (CIRCLE - 3); k++) fours[k] = twos[k] + twos[k + 4];
    for (int64_t k = 0; k < 2 * GROUPS; k++) totals[k] = fours[k] + fours[k + 8] + fours[k + 16] - exact[k];
    for (int64_t k = 0; k < GROUPS; k++)
        lengths[k] = totals[2 * k] * totals[2 * k] + totals[2 * k + 1] * totals[2 * k + 1];
}

/* Sum of the vectors less than 30° from the centre, in order. */
static pair sum_window(const responses *found, int32_t center) {
    int32_t is_inside[SAMPLES], inside[SAMPLES + 1];
    int64_t count = 0;
    for (int64_t k = 0; k < found->count; k++) {
        int32_t apart = found->degrees[k] < center ? center - found->degrees[k] : found->degrees[k] - center;
        is_inside[k] = (apart < 30) | (apart > 330);
    }
    for (int64_t k = 0; k < found->count; k++) inside[count] = (int32_t)k, count += is_inside[k];
    pair sum = {0, 0};
    for (int64_t k = 0; k < count; k++) sum += found->xy[inside[k]];
    return sum;
}

/* Mark the windows that may be the longest; none that is nan. */
static void flag_longest(const float *lengths, uint8_t *flags) {
    float8 longest = {0};
    for (int64_t k = 0; k < GROUPS; k += 8) longest = choose8(load8(lengths + k) > longest, load8(lengths + k), longest);
    float limit = most8(longest) * CLOSE;
    for (int64_t k = 0; k < GROUPS; k++) flags[k] = lengths[k] >= limit;
}

/* The angle of the 60° window, tried every 5°, where the sum of vectors is longest. Sums over groups tell which windows
   can win; only those are summed vector by vector, in OpenCV's order. */
static float strongest_window(const responses *found) {
    circle bins;
    uint8_t flags[GROUPS];
    float lengths[GROUPS], best = 0;
    pair direction = {0, 0};
    bin_directions(found, &bins);
    window_lengths((const float *)bins.exact, (const float *)bins.rest, lengths);
    flag_longest(lengths, flags);
    for (int32_t window = 0; window < GROUPS; window++) {
        if (!flags[window]) continue;
        pair sum = sum_window(found, 5 * window);
        float length = sum[0] * sum[0] + sum[1] * sum[1];
        if (length > best) best = length, direction = sum;
    }
    return atan2_degrees(-direction[1], direction[0]);
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
