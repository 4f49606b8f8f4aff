/* Serves peakmark/surf/window.py: the patches that windows are averaged to. Lengths are counted in 1 / 21 px, so that pixels
   are 21 and patch pixels `side` units wide. */

#include <math.h>
#include <string.h>
#include "lanes.h"
#include "surf_window.h"

/* Averages this close to half a grey level are computed again in OpenCV's arithmetic, which decides the rounding. */
static const float NEAR_HALF = 0x1p-11f;

enum {
    MOST_SHORT = 257,  /* largest side whose sums of rows fit 16 bits: 255 times as many units */
    MOST_WHOLE = 2901, /* largest side whose sums over a patch pixel fit 31 bits: 255 times as many square units */
    PART = 32,         /* beyond, they are divided by this */
};

/* How many pixels a patch cell reaches into at most, along one axis; what lies beyond the last one counts nothing. */
static int64_t reach_of(int64_t side) { return side / PATCH_SIDE + 2; }

bool take_buffers(buffers *b, int64_t largest_side, memory *taken) {
    int64_t pitch = pitch_of(most(largest_side, PATCH_SIDE));
    int64_t patch = (PATCH_SIDE + 1) * PATCH_PITCH;
    b->starts = take(taken, 2 * pitch, sizeof *b->starts);
    b->quads = take(taken, BLOCK * BLOCK, sizeof *b->quads);
    b->window = take(taken, (pitch + 2) * pitch, sizeof *b->window);
    b->weights = take(taken, PATCH_SIDE * reach_of(pitch), sizeof *b->weights);
    b->rows = take(taken, pitch, sizeof *b->rows);
    b->columns = take(taken, (pitch + 2) * PATCH_PITCH, sizeof *b->columns);
    b->patch = take(taken, patch, sizeof *b->patch);
    if (!b->starts || !b->quads || !b->window || !b->weights || !b->rows || !b->columns || !b->patch) return false;
    memset(b->columns, 0, (size_t)((pitch + 2) * PATCH_PITCH) * sizeof *b->columns);
    memset(b->patch, 0, (size_t)patch * sizeof *b->patch);
    return true;
}

/* The part of pixel x that patch cell i covers, in units. */
static int64_t covered(int64_t x, int64_t i, int64_t side) {
    return least((i + 1) * side, (x + 1) * PATCH_SIDE) - most(i * side, x * PATCH_SIDE);
}

static int64_t first_pixel(int64_t i, int64_t side) { return i * side / PATCH_SIDE; }
static int64_t end_pixel(int64_t i, int64_t side) { return ((i + 1) * side + PATCH_SIDE - 1) / PATCH_SIDE; }

/* Units that each patch cell covers of the pixels from its first one on. */
static void weigh_pixels(int64_t side, uint16_t *weights) {
    int32_t reach = (int32_t)reach_of(side), length = (int32_t)side;
    for (int32_t i = 0; i < PATCH_SIDE; i++, weights += reach)
        for (int32_t k = 0, from = i * length, at = from / PATCH_SIDE * PATCH_SIDE; k < reach; k++, at += PATCH_SIDE) {
            int32_t low = at > from ? at : from, high = at + PATCH_SIDE < from + length ? at + PATCH_SIDE : from + length;
            weights[k] = (uint16_t)(high > low ? high - low : 0);
        }
}

/* Weighted sums of rows that 16 bits hold: of windows up to MOST_SHORT px. */
static void add_short_rows(const uint16_t *rows, int64_t pitch, const uint16_t *weights, int64_t count, int32_t *sums) {
    for (int64_t x = 0; x < pitch; x += 16) {
        shorts16 sum = {0};
        for (int64_t k = 0; k < count; k++) sum += load_shorts16(rows + k * pitch + x) * weights[k];
        for (int64_t k = 0; k < 16; k++) sums[x + k] = sum[k];
    }
}

static void add_rows(const uint16_t *restrict rows, int64_t pitch, const uint16_t *weights, int64_t count,
                     int32_t *restrict sums) {
    memset(sums, 0, (size_t)pitch * sizeof *sums);
    for (int64_t k = 0; k < count; k++)
        for (int64_t x = 0; x < pitch; x++) sums[x] += weights[k] * rows[k * pitch + x];
}

/* Weighted sums of the window's rows, one for each row of the patch; written column by column. */
static void average_rows(int64_t side, buffers *b) {
    int64_t pitch = pitch_of(side), reach = reach_of(side);
    for (int64_t i = 0; i < PATCH_SIDE; i++) {
        const uint16_t *rows = b->window + first_pixel(i, side) * pitch;
        (side <= MOST_SHORT ? add_short_rows : add_rows)(rows, pitch, b->weights + i * reach, reach, b->rows);
        for (int64_t x = 0; x < side; x++) b->columns[x * PATCH_PITCH + i] = b->rows[x];
    }
}

static void add_columns(const int32_t *columns, const uint16_t *weights, int64_t count, int32_t *patch) {
    lanes8 sums[PATCH_PITCH / 8] = {{0}};
    for (int64_t k = 0; k < count; k++)
        for (int64_t m = 0; m < PATCH_PITCH / 8; m++) sums[m] += load_lanes8(columns + k * PATCH_PITCH + 8 * m) * weights[k];
    memcpy(patch, sums, sizeof sums);
}

static void add_parts(const int32_t *columns, const uint16_t *weights, int64_t count, int32_t *patch) {
    for (int64_t i = 0; i < PATCH_PITCH; i++) {
        int64_t sum = 0;
        for (int64_t k = 0; k < count; k++) sum += (int64_t)columns[k * PATCH_PITCH + i] * weights[k];
        patch[i] = (int32_t)(sum / PART);
    }
}

/* Weighted sums of those columns, one for each column of the patch. */
static void average_columns(int64_t side, buffers *b) {
    int64_t reach = reach_of(side);
    for (int64_t j = 0; j < PATCH_SIDE; j++) {
        const int32_t *columns = b->columns + first_pixel(j, side) * PATCH_PITCH;
        (side <= MOST_WHOLE ? add_columns : add_parts)(columns, b->weights + j * reach, reach, b->patch + j * PATCH_PITCH);
    }
}

/* Share of patch cell `cell` that pixel x covers. */
static float share(int64_t x, int64_t cell, int64_t side) {
    return (float)((double)covered(x, cell, side) / (double)side);
}

/* One patch pixel in single precision, the sums in OpenCV's order. */
static float average_like_opencv(const uint16_t *window, int64_t side, int64_t i, int64_t j) {
    int64_t pitch = pitch_of(side), ratio = side / PATCH_SIDE;
    bool is_whole = side % PATCH_SIDE == 0;
    float total = 0;
    for (int64_t y = first_pixel(i, side); y < end_pixel(i, side); y++) {
        float row = 0;
        for (int64_t x = first_pixel(j, side); x < end_pixel(j, side); x++)
            row += (float)window[y * pitch + x] * (is_whole ? 1.0f : share(x, j, side));
        total += row * (is_whole ? 1.0f : share(y, i, side));
    }
    return is_whole ? total * (1.0f / (float)(ratio * ratio)) : total;
}

static bool is_near_half(float average) { return fabsf(average - floorf(average) - 0.5f) < NEAR_HALF; }

/* Round a patch column to whole levels, averages near half a level as OpenCV's own sums would be. */
static void round_column(const uint16_t *window, int64_t side, int64_t j, int32_t *restrict column) {
    float one_by_area = (side <= MOST_WHOLE ? 1.0f : PART) / (float)(side * side), averages[PATCH_PITCH];
    int32_t doubts = 0;
    for (int64_t i = 0; i < PATCH_PITCH; i++) {
        averages[i] = (float)column[i] * one_by_area;
        doubts += is_near_half(averages[i]);
    }
    for (int64_t i = 0; doubts && i < PATCH_SIDE; i++)
        if (is_near_half(averages[i])) averages[i] = average_like_opencv(window, side, i, j);
    for (int64_t i = 0; i < PATCH_PITCH; i++) column[i] = (int32_t)rintf(averages[i]);
}

/* First pixel under patch cell i, and the share of the next. */
static int64_t source_of(int64_t i, int64_t side, double *next) {
    int64_t y = i * side / PATCH_SIDE;
    *next = greater((double)(i + 1) - (double)((y + 1) * PATCH_SIDE) / (double)side, 0.0);
    return y;
}

/* OpenCV's INTER_AREA where the window is smaller than the patch: linear between neighbouring pixels. */
static void enlarge(int64_t side, buffers *b) {
    int64_t pitch = pitch_of(side);
    for (int64_t i = 0; i < PATCH_SIDE; i++)
        for (int64_t j = 0; j < PATCH_SIDE; j++) {
            double down, right;
            int64_t y = source_of(i, side, &down), x = source_of(j, side, &right);
            int64_t y1 = least(y + 1, side - 1), x1 = least(x + 1, side - 1);
            double upper = (1 - right) * b->window[y * pitch + x] + right * b->window[y * pitch + x1];
            double lower = (1 - right) * b->window[y1 * pitch + x] + right * b->window[y1 * pitch + x1];
            b->patch[j * PATCH_PITCH + i] = (int32_t)rint((1 - down) * upper + down * lower);
        }
}

/* Average the window by area onto the patch, rounded to 8 bits: OpenCV's INTER_AREA. All sums are exact. */
void average_areas(int64_t side, buffers *b) {
    if (side < PATCH_SIDE) {
        enlarge(side, b);
        return;
    }
    weigh_pixels(side, b->weights);
    average_rows(side, b);
    average_columns(side, b);
    for (int64_t k = 0; side == 2 * PATCH_SIDE && k < (PATCH_SIDE + 1) * PATCH_PITCH; k++)
        b->patch[k] = (b->patch[k] / (PATCH_SIDE * PATCH_SIDE) + 2) >> 2; /* halves up, as OpenCV does in this case */
    for (int64_t j = 0; side != 2 * PATCH_SIDE && j < PATCH_SIDE; j++)
        round_column(b->window, side, j, b->patch + j * PATCH_PITCH);
}

/* ---- the steps by themselves ---- */

EXPORT status average_window(const uint8_t *window, int64_t side, uint8_t *patch) {
    memory taken = {.count = 0};
    buffers b;
    bool is_ready = take_buffers(&b, side, &taken);
    for (int64_t i = 0; is_ready && i < side; i++) {
        for (int64_t j = 0; j < pitch_of(side); j++) b.window[i * pitch_of(side) + j] = j < side ? window[i * side + j] : 0;
    }
    if (is_ready) average_areas(side, &b);
    for (int64_t k = 0; is_ready && k < PATCH_SIDE * PATCH_SIDE; k++)
        patch[k] = (uint8_t)b.patch[k % PATCH_SIDE * PATCH_PITCH + k / PATCH_SIDE];
    give_back(&taken);
    return is_ready ? DONE : OUT_OF_MEMORY;
}
