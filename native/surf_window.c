/* Serves peakmark/surf/window.py. */

#include <math.h>
#include <string.h>
#include "elementary.h"
#include "surf_window.h"

/* Averages this close to half a grey level are computed again in OpenCV's arithmetic, which decides the rounding. */
static const float NEAR_HALF = 0x1p-11f;

bool take_buffers(buffers *b, int64_t largest_side, memory *taken) {
    int64_t pitch = pitch_of(most(largest_side, PATCH_SIDE));
    int64_t patch = (PATCH_SIDE + 1) * PATCH_PITCH;
    b->starts = take(taken, 2 * pitch, sizeof *b->starts);
    b->quads = take(taken, CHUNK + pitch, sizeof *b->quads);
    b->window = take(taken, pitch * pitch, sizeof *b->window);
    b->rows = take(taken, pitch, sizeof *b->rows);
    b->columns = take(taken, pitch * PATCH_PITCH, sizeof *b->columns);
    b->patch = take(taken, patch, sizeof *b->patch);
    if (!b->starts || !b->quads || !b->window || !b->rows || !b->columns || !b->patch) return false;
    memset(b->columns, 0, (size_t)(pitch * PATCH_PITCH) * sizeof *b->columns);
    memset(b->patch, 0, (size_t)patch * sizeof *b->patch);
    return true;
}

static void interleave_row(const uint8_t *restrict upper, const uint8_t *restrict lower, int64_t width,
                           uint16_t *restrict row) {
    for (int64_t x = 0; x < width; x++) row[x] = (uint16_t)(upper[x] | lower[x] << 8);
    row[width] = 0;
}

EXPORT void interleave_rows(const uint8_t *gray, int64_t height, int64_t width, uint16_t *pairs, int64_t stride,
                            int64_t first, int64_t end) {
    for (int64_t y = first; y < end; y++)
        interleave_row(gray + y * width, gray + least(y + 1, height - 1) * width, width, pairs + y * stride);
}

/* ---- windows ---- */

/* A rotated window: its first sample relative to a pixel close to it, its steps, and where the image ends. */
typedef struct {
    float x, y, sine, cosine;
    int64_t left, top, side, pitch;
    float first_x, first_y, last_x, last_y;
    bool is_inside;
} rotation;

/* Whether a window, with the lanes that fill its rows up to the pitch, stays two pixels inside. */
static bool is_window_inside(float x, float y, float sine, float cosine, int64_t side, int64_t height, int64_t width) {
    float reach = (float)pitch_of(side) - (float)side * 0.5f, span = reach * (fabsf(sine) + fabsf(cosine)) + 2.0f;
    return x - span >= 0 && y - span >= 0 && x + span < (float)width && y + span < (float)height;
}

/* Distances from a pixel close to the window keep single precision fine: 1e-5 px and better. Even coordinates, as halves
   are rounded to even. */
static int64_t near_pixel(float position, float span, int64_t length) {
    int64_t pixel = least(most((int64_t)floorf(position - span), -(int64_t)(2 * span)), length);
    return pixel - (pixel & 1);
}

static rotation rotate(const paired *image, float x, float y, float angle_deg, int64_t side) {
    double sine, cosine;
    same_sincos((double)(angle_deg * (float)(PI / 180)), &sine, &cosine);
    rotation r = {.sine = (float)-sine, .cosine = (float)cosine, .side = side, .pitch = pitch_of(side)};
    float span = (float)side * (fabsf(r.sine) + fabsf(r.cosine)) * 0.5f + 2.0f;
    r.left = near_pixel(x, span, image->width), r.top = near_pixel(y, span, image->height);
    r.is_inside = is_window_inside(x, y, r.sine, r.cosine, side, image->height, image->width);
    float reach = -(float)(side - 1) / 2.0f;
    r.x = x + reach * r.cosine + reach * r.sine, r.y = y - reach * r.sine + reach * r.cosine;
    r.first_x = (float)-r.left, r.first_y = (float)-r.top;
    r.last_x = (float)(image->width - 1 - r.left), r.last_y = (float)(image->height - 1 - r.top);
    return r;
}

/* First sample of each row; OpenCV steps from row to row in single precision. */
static void start_rows(const rotation *r, float *starts) {
    float x = r->x, y = r->y;
    for (int64_t i = 0; i < r->side; i++) {
        starts[i] = x - (float)r->left, starts[r->side + i] = y - (float)r->top;
        x += r->sine, y += r->cosine;
    }
}

/* Index in the image of the upper left pixel of each sample of a row, relative to (left, top). */
static void index_row(float x, float y, const rotation *r, int32_t stride, int32_t *restrict indices) {
    const float sine = r->sine, cosine = r->cosine;
    for (int32_t j = 0; j < (int32_t)r->pitch; j++) {
        int32_t column = (int32_t)(x + (float)j * cosine), line = (int32_t)(y - (float)j * sine);
        indices[j] = line * stride + column;
    }
}

/* The same where the window may leave the image: samples without four pixels take the nearest. */
static void index_border_row(float x0, float y0, const rotation *r, int32_t stride, int32_t *restrict indices) {
    const rotation w = *r;
    for (int32_t j = 0; j < (int32_t)w.pitch; j++) {
        float x = x0 + (float)j * w.cosine, y = y0 - (float)j * w.sine;
        float column = (float)(int32_t)x, line = (float)(int32_t)y, near_x = rintf(x), near_y = rintf(y);
        bool is_inside = (column >= w.first_x) & (column < w.last_x) & (line >= w.first_y) & (line < w.last_y);
        near_x = near_x > w.first_x ? near_x : w.first_x, near_y = near_y > w.first_y ? near_y : w.first_y;
        near_x = near_x < w.last_x ? near_x : w.last_x, near_y = near_y < w.last_y ? near_y : w.last_y;
        indices[j] = (int32_t)(is_inside ? line : near_y) * stride + (int32_t)(is_inside ? column : near_x);
    }
}

/* Replace indices by pixels: upper left, lower left, upper right, lower right, from the lowest byte on. */
static void load_quads(const uint16_t *pairs, int64_t base, int32_t *quads, int64_t n) {
    for (int64_t j = 0; j < n; j++) {
        const uint16_t *at = pairs + (base + quads[j]);
        quads[j] = (int32_t)((uint32_t)at[0] | (uint32_t)at[1] << 16);
    }
}

static inline uint8_t bilinear(uint32_t quad, float x_share, float y_share) {
    float upper_left = (float)(int32_t)(quad & 255), lower_left = (float)(int32_t)(quad >> 8 & 255);
    float upper_right = (float)(int32_t)(quad >> 16 & 255), lower_right = (float)(int32_t)(quad >> 24);
    float upper = upper_left + x_share * (upper_right - upper_left);
    float lower = lower_left + x_share * (lower_right - lower_left);
    return (uint8_t)(int32_t)rintf(upper + y_share * (lower - upper));
}

static void interpolate_row(float x0, float y0, const rotation *r, const int32_t *restrict quads,
                            uint8_t *restrict window) {
    const float sine = r->sine, cosine = r->cosine;
    for (int32_t j = 0; j < (int32_t)r->pitch; j++) {
        float x = x0 + (float)j * cosine, y = y0 - (float)j * sine;
        window[j] = bilinear((uint32_t)quads[j], x - (float)(int32_t)x, y - (float)(int32_t)y);
    }
}

static void interpolate_border_row(float x0, float y0, const rotation *r, const int32_t *restrict quads,
                                   uint8_t *restrict window) {
    const rotation w = *r;
    for (int32_t j = 0; j < (int32_t)w.pitch; j++) {
        float x = x0 + (float)j * w.cosine, y = y0 - (float)j * w.sine;
        float column = (float)(int32_t)x, line = (float)(int32_t)y;
        bool is_inside = (column >= w.first_x) & (column < w.last_x) & (line >= w.first_y) & (line < w.last_y);
        window[j] = bilinear((uint32_t)quads[j], is_inside ? x - column : 0, is_inside ? y - line : 0);
    }
}

/* Sample a window rotated by an angle: bilinear and rounded to 8 bits; outside the image the nearest pixel. What lies
   between the rows is undefined. */
void sample_rotated(const paired *image, float x, float y, float angle_deg, int64_t side, buffers *b) {
    rotation r = rotate(image, x, y, angle_deg, side);
    int64_t chunk = most(CHUNK / r.pitch, 1), base = r.top * image->stride + r.left;
    int32_t stride = (int32_t)image->stride;
    start_rows(&r, b->starts);
    for (int64_t first = 0; first < side; first += chunk) {
        int64_t end = least(first + chunk, side);
        for (int64_t i = first; i < end; i++)
            (r.is_inside ? index_row : index_border_row)(b->starts[i], b->starts[side + i], &r, stride,
                                                         b->quads + (i - first) * r.pitch);
        load_quads(image->pairs, base, b->quads, (end - first) * r.pitch);
        for (int64_t i = first; i < end; i++)
            (r.is_inside ? interpolate_row : interpolate_border_row)(b->starts[i], b->starts[side + i], &r,
                                                                     b->quads + (i - first) * r.pitch,
                                                                     b->window + i * r.pitch);
    }
}

/* Copy a window rotated by 270°, whole pixels, rows running up the image; outside the image the nearest pixel. */
void sample_upright(const paired *image, float x, float y, int64_t side, buffers *b) {
    float reach = -(float)(side - 1) / 2.0f;
    int64_t first_column = (int64_t)rintf(x + reach), last_row = (int64_t)rintf(y - reach), pitch = pitch_of(side);
    for (int64_t j = 0; j < side; j++) {
        const uint16_t *row = image->pairs + least(most(last_row - j, 0), image->height - 1) * image->stride;
        for (int64_t i = 0; i < side; i++)
            b->window[i * pitch + j] = (uint8_t)(row[least(most(first_column + i, 0), image->width - 1)] & 255);
    }
}

/* ---- patches; lengths are counted in 1 / 21 px, so that pixels are 21 and patch pixels `side` units wide ---- */

static void add_bytes(const uint8_t *restrict values, int32_t weight, int32_t *restrict sums, int64_t n) {
    for (int64_t x = 0; x < n; x++) sums[x] += weight * values[x];
}

static void add_numbers(const int32_t *restrict values, int32_t weight, int32_t *restrict sums, int64_t n) {
    for (int64_t x = 0; x < n; x++) sums[x] += weight * values[x];
}

/* The part of pixel x that patch cell i covers, in units. */
static int64_t covered(int64_t x, int64_t i, int64_t side) {
    return least((i + 1) * side, (x + 1) * PATCH_SIDE) - most(i * side, x * PATCH_SIDE);
}

static int64_t first_pixel(int64_t i, int64_t side) { return i * side / PATCH_SIDE; }
static int64_t end_pixel(int64_t i, int64_t side) { return ((i + 1) * side + PATCH_SIDE - 1) / PATCH_SIDE; }

/* Weighted sums of the window's rows, one for each row of the patch; written column by column. */
static void average_rows(int64_t side, buffers *b) {
    int64_t pitch = pitch_of(side);
    for (int64_t i = 0; i < PATCH_SIDE; i++) {
        memset(b->rows, 0, (size_t)pitch * sizeof *b->rows);
        for (int64_t y = first_pixel(i, side); y < end_pixel(i, side); y++)
            add_bytes(b->window + y * pitch, (int32_t)covered(y, i, side), b->rows, pitch);
        for (int64_t x = 0; x < side; x++) b->columns[x * PATCH_PITCH + i] = b->rows[x];
    }
}

/* Weighted sums of those columns, one for each column of the patch. */
static void average_columns(int64_t side, buffers *b) {
    memset(b->patch, 0, (PATCH_SIDE + 1) * PATCH_PITCH * sizeof *b->patch);
    for (int64_t j = 0; j < PATCH_SIDE; j++)
        for (int64_t x = first_pixel(j, side); x < end_pixel(j, side); x++)
            add_numbers(b->columns + x * PATCH_PITCH, (int32_t)covered(x, j, side), b->patch + j * PATCH_PITCH,
                        PATCH_PITCH);
}

/* Share of patch cell `cell` that pixel x covers. */
static float share(int64_t x, int64_t cell, int64_t side) {
    return (float)((double)covered(x, cell, side) / (double)side);
}

/* One patch pixel in single precision, the sums in OpenCV's order. */
static float average_like_opencv(const uint8_t *window, int64_t side, int64_t i, int64_t j) {
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
static void round_column(const uint8_t *window, int64_t side, int64_t j, int32_t *restrict column) {
    float one_by_area = 1.0f / (float)(side * side), averages[PATCH_PITCH];
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
    average_rows(side, b);
    average_columns(side, b);
    for (int64_t k = 0; side == 2 * PATCH_SIDE && k < (PATCH_SIDE + 1) * PATCH_PITCH; k++)
        b->patch[k] = (b->patch[k] / (PATCH_SIDE * PATCH_SIDE) + 2) >> 2; /* halves up, as OpenCV does in this case */
    for (int64_t j = 0; side != 2 * PATCH_SIDE && j < PATCH_SIDE; j++)
        round_column(b->window, side, j, b->patch + j * PATCH_PITCH);
}

/* ---- the steps by themselves ---- */

EXPORT status cut_window(const uint16_t *pairs, int64_t height, int64_t stride, int64_t width, float x, float y,
                         float angle_deg, bool upright, uint8_t *window, int64_t side) {
    memory taken = {.count = 0};
    buffers b;
    const paired image = {pairs, stride, height, width};
    bool is_ready = take_buffers(&b, side, &taken);
    if (is_ready && upright) sample_upright(&image, x, y, side, &b);
    if (is_ready && !upright) sample_rotated(&image, x, y, angle_deg, side, &b);
    for (int64_t i = 0; is_ready && i < side; i++) memcpy(window + i * side, b.window + i * pitch_of(side), (size_t)side);
    give_back(&taken);
    return is_ready ? DONE : OUT_OF_MEMORY;
}

EXPORT status average_window(const uint8_t *window, int64_t side, uint8_t *patch) {
    memory taken = {.count = 0};
    buffers b;
    bool is_ready = take_buffers(&b, side, &taken);
    for (int64_t i = 0; is_ready && i < side; i++) {
        memset(b.window + i * pitch_of(side), 0, (size_t)pitch_of(side));
        memcpy(b.window + i * pitch_of(side), window + i * side, (size_t)side);
    }
    if (is_ready) average_areas(side, &b);
    for (int64_t k = 0; is_ready && k < PATCH_SIDE * PATCH_SIDE; k++)
        patch[k] = (uint8_t)b.patch[k % PATCH_SIDE * PATCH_PITCH + k / PATCH_SIDE];
    give_back(&taken);
    return is_ready ? DONE : OUT_OF_MEMORY;
}
