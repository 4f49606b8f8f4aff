/* Serves peakmark/surf/window.py: windows. In OpenCV's arithmetic, but that positions are rounded to 2^-23 px. */

#include <math.h>
#include <string.h>
#include "elementary.h"
#include "lanes.h"
#include "surf_window.h"

enum { PIXEL_BITS = 23, PIXEL = 1 << PIXEL_BITS }; /* positions in 2^-23 px are digits of single-precision numbers */

/* A window's steps from row to row, px, and in a block those from a row's first sample to the others, in 2^-23 px. Of
   sixteen samples those in odd columns come last: the order in which `interpolate` joins them. */
typedef struct {
    float sine, cosine;
    int32_t along_x[BLOCK], along_y[BLOCK];
} rotation;

/* A part of a window: its rows' first samples relative to a pixel close by, in 2^-23 px, and where the image ends. */
typedef struct {
    int64_t left, top, rows, columns; /* columns of whole vectors */
    int32_t x[BLOCK], y[BLOCK], first_x, first_y, last_x, last_y;
} block;

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

/* ---- positions ---- */

/* First sample of each row, all x and then all y: OpenCV steps from row to row in single precision. */
static void start_rows(const rotation *r, float x, float y, int64_t side, float *starts) {
    float reach = -(float)(side - 1) / 2.0f;
    x = x + reach * r->cosine + reach * r->sine, y = y - reach * r->sine + reach * r->cosine;
    for (int64_t i = 0; i < side; i++) {
        starts[i] = x, starts[side + i] = y;
        x += r->sine, y += r->cosine;
    }
}

static rotation rotate(float angle_deg) {
    double sine, cosine;
    same_sincos((double)(angle_deg * (float)(PI / 180)), &sine, &cosine);
    rotation r = {.sine = (float)-sine, .cosine = (float)cosine};
    for (int32_t j = 0; j < BLOCK; j++) {
        int32_t column = j / VECTOR * VECTOR + 2 * (j % 8) + j % VECTOR / 8;
        r.along_x[j] = (int32_t)rint(column * (double)r.cosine * PIXEL);
        r.along_y[j] = (int32_t)rint(column * (double)-r.sine * PIXEL);
    }
    return r;
}

/* Rows' first samples along one axis, relative to an even pixel, as halves are rounded to even; return the pixel. */
static double locate_rows(const float *restrict starts, double along, int64_t rows, int32_t *restrict positions) {
    double pixel = 2 * floor(0.5 * ((double)starts[0] + along));
    for (int64_t i = 0; i < rows; i++) positions[i] = (int32_t)rint(((double)starts[i] + along - pixel) * PIXEL);
    return pixel;
}

/* Blocks far outside see the same pixels of the image from closer by. */
static int64_t not_far(double pixel, int64_t length) {
    return (int64_t)lesser(greater(pixel, -4.0 * BLOCK), (double)(length - length % 2 + 4 * BLOCK));
}

static block locate(const paired *image, const rotation *r, const float *starts, int64_t side, int64_t row,
                    int64_t column) {
    block k = {.rows = least(BLOCK, side - row), .columns = least(BLOCK, pitch_of(side) - column)};
    double along = (double)column;
    k.left = not_far(locate_rows(starts + row, along * r->cosine, k.rows, k.x), image->width);
    k.top = not_far(locate_rows(starts + side + row, along * -r->sine, k.rows, k.y), image->height);
    k.first_x = (int32_t)-k.left, k.last_x = (int32_t)(image->width - 1 - k.left);
    k.first_y = (int32_t)-k.top, k.last_y = (int32_t)(image->height - 1 - k.top);
    return k;
}

/* Whether all samples between two rows' first ones, and those `along` them, lie more than a pixel inside. */
static bool stays_inside(int32_t a, int32_t b, int32_t along, int32_t first, int32_t last) {
    int32_t low = (a < b ? a : b) + (along < 0 ? along : 0), high = (a < b ? b : a) + (along > 0 ? along : 0);
    return low >> PIXEL_BITS > first && high >> PIXEL_BITS < last - 1;
}

static bool is_inside(const block *k, const rotation *r) {
    int64_t row = k->rows - 1, column = k->columns - 1;
    return stays_inside(k->x[0], k->x[row], r->along_x[column], k->first_x, k->last_x) &&
           stays_inside(k->y[0], k->y[row], r->along_y[column], k->first_y, k->last_y);
}

/* ---- pixels ---- */

/* Index of the upper left pixel of each sample of a row, relative to (left, top). */
static void index_row(const block *k, const rotation *r, int64_t row, int32_t stride, int32_t *restrict indices) {
    const int32_t x = k->x[row], y = k->y[row];
    for (int64_t j = 0; j < k->columns; j++)
        indices[j] = ((y + r->along_y[j]) >> PIXEL_BITS) * stride + ((x + r->along_x[j]) >> PIXEL_BITS);
}

/* Replace indices by pixels: upper left, lower left, upper right, lower right, from the lowest byte on. */
static inline void load_quads(const uint16_t *near, int32_t *quads) {
    for (int64_t j = 0; j < VECTOR; j++) memcpy(quads + j, near + quads[j], sizeof *quads);
}

/* The coordinate nearest to a position, in the image; halves to even. */
static inline int32_t nearest(int32_t position, int32_t first, int32_t last) {
    int32_t pixel = (position + PIXEL / 2 - 1 + (position >> PIXEL_BITS & 1)) >> PIXEL_BITS;
    pixel = pixel > first ? pixel : first;
    return pixel < last ? pixel : last;
}

/* Whether the image has four pixels around a position. */
static inline bool has_four(const block *k, int32_t x, int32_t y) {
    int32_t column = x >> PIXEL_BITS, line = y >> PIXEL_BITS;
    return (column >= k->first_x) & (column < k->last_x) & (line >= k->first_y) & (line < k->last_y);
}

/* As `index_row` where the window may leave the image: of samples without four pixels the nearest one. */
static void index_border_row(const block *at, const rotation *r, int64_t row, int32_t stride, int32_t *restrict indices) {
    const block k = *at;
    for (int64_t j = 0; j < k.columns; j++) {
        int32_t x = k.x[row] + r->along_x[j], y = k.y[row] + r->along_y[j];
        bool is_whole = has_four(&k, x, y);
        int32_t column = nearest(x, k.first_x, k.last_x), line = nearest(y, k.first_y, k.last_y);
        indices[j] = (is_whole ? y >> PIXEL_BITS : line) * stride + (is_whole ? x >> PIXEL_BITS : column);
    }
}

/* Give samples without four pixels the nearest one four times. */
static void repeat_nearest(const block *at, const rotation *r, int64_t row, int32_t *restrict quads) {
    const block k = *at;
    for (int64_t j = 0; j < k.columns; j++) {
        bool is_whole = has_four(&k, k.x[row] + r->along_x[j], k.y[row] + r->along_y[j]);
        uint32_t quad = (uint32_t)quads[j], four = (quad & 255) * 0x01010101u;
        quads[j] = (int32_t)(is_whole ? quad : four);
    }
}

/* ---- samples ---- */

static inline float8 floats(bits8 numbers) { return __builtin_convertvector((lanes8)numbers, float8); }

/* The fractions of a pixel of positions: the digits of numbers from 1 to 2. */
static inline float8 fractions(bits8 positions) { return (float8)((positions & (PIXEL - 1)) | 0x3f800000) - 1.0f; }

/* Bilinear in OpenCV's order, rounded, halves to even: the lower 16 bits, once 1.5 × 2^23 is added. */
static inline bits8 bilinear(bits8 quads, float8 right, float8 down) {
    float8 left = 1.0f - right, up = 1.0f - down;
    float8 upper_left = floats(quads & 255), lower_left = floats(quads >> 8 & 255);
    float8 upper_right = floats(quads >> 16 & 255), lower_right = floats(quads >> 24);
    float8 upper = upper_left * left * up + upper_right * right * up;
    return (bits8)(upper + lower_left * left * down + lower_right * right * down + 0x1.8p23f);
}

static inline bits8 sample8(int32_t x, int32_t y, const int32_t *along_x, const int32_t *along_y, const int32_t *quads) {
    bits8 right = load_bits8(along_x) + (uint32_t)x, down = load_bits8(along_y) + (uint32_t)y;
    return bilinear(load_bits8(quads), fractions(right), fractions(down));
}

/* A vector of samples of a row that starts at (x, y) into the window. */
static inline void interpolate(const rotation *r, int32_t x, int32_t y, int64_t j, const int32_t *quads, uint16_t *window) {
    bits8 even = sample8(x, y, r->along_x + j, r->along_y + j, quads);
    bits8 odd = sample8(x, y, r->along_x + j + 8, r->along_y + j + 8, quads + 8);
    bits8 both = (even & 0xffff) | odd << 16;
    memcpy(window, &both, sizeof both);
}

static inline void interpolate_row(const rotation *r, const block *k, int64_t row, const int32_t *quads, uint16_t *window) {
    for (int64_t j = 0; j < k->columns; j += VECTOR)
        interpolate(r, k->x[row], k->y[row], j, quads + j, window + j);
}

/* Loads take as long as arithmetic, but elsewhere in the processor: a row is loaded while the one before is computed. */
static void sample_inside(const paired *image, const rotation *r, const block *k, int32_t *quads, uint16_t *window,
                          int64_t pitch) {
    const uint16_t *near = image->pairs + (k->top * image->stride + k->left);
    const int64_t columns = k->columns, last = k->rows - 1;
    for (int64_t i = 0; i <= last; i++) index_row(k, r, i, (int32_t)image->stride, quads + i * columns);
    for (int64_t j = 0; j < columns; j += VECTOR) load_quads(near, quads + j);
    for (int64_t i = 0; i < last; i++, quads += columns, window += pitch) {
        const int32_t x = k->x[i], y = k->y[i];
        for (int64_t j = 0; j < columns; j += VECTOR) {
            load_quads(near, quads + columns + j);
            interpolate(r, x, y, j, quads + j, window + j);
        }
    }
    interpolate_row(r, k, last, quads, window);
}

static void sample_border(const paired *image, const rotation *r, const block *k, int32_t *quads, uint16_t *window,
                          int64_t pitch) {
    const uint16_t *near = image->pairs + (k->top * image->stride + k->left);
    for (int64_t i = 0; i < k->rows; i++) {
        index_border_row(k, r, i, (int32_t)image->stride, quads);
        for (int64_t j = 0; j < k->columns; j += VECTOR) load_quads(near, quads + j);
        repeat_nearest(k, r, i, quads);
        interpolate_row(r, k, i, quads, window + i * pitch);
    }
}

/* Sample a window rotated by an angle: bilinear and rounded to 8 bits; outside the image the nearest pixel. What lies
   between the rows is undefined. */
void sample_rotated(const paired *image, float x, float y, float angle_deg, int64_t side, buffers *b) {
    rotation r = rotate(angle_deg);
    int64_t pitch = pitch_of(side);
    start_rows(&r, x, y, side, b->starts);
    for (int64_t column = 0; column < side; column += BLOCK)
        for (int64_t row = 0; row < side; row += BLOCK) {
            block k = locate(image, &r, b->starts, side, row, column);
            uint16_t *window = b->window + row * pitch + column;
            if (is_inside(&k, &r)) sample_inside(image, &r, &k, b->quads, window, pitch);
            else sample_border(image, &r, &k, b->quads, window, pitch);
        }
}

/* Copy a window rotated by 270°, whole pixels, rows running up the image; outside the image the nearest pixel. */
void sample_upright(const paired *image, float x, float y, int64_t side, buffers *b) {
    float reach = -(float)(side - 1) / 2.0f;
    int64_t first_column = (int64_t)rintf(x + reach), last_row = (int64_t)rintf(y - reach), pitch = pitch_of(side);
    for (int64_t j = 0; j < side; j++) {
        const uint16_t *row = image->pairs + least(most(last_row - j, 0), image->height - 1) * image->stride;
        for (int64_t i = 0; i < side; i++)
            b->window[i * pitch + j] = (uint16_t)(row[least(most(first_column + i, 0), image->width - 1)] & 255);
    }
}

EXPORT status cut_window(const uint16_t *pairs, int64_t height, int64_t stride, int64_t width, float x, float y,
                         float angle_deg, bool upright, uint8_t *window, int64_t side) {
    memory taken = {.count = 0};
    buffers b;
    const paired image = {pairs, stride, height, width};
    bool is_ready = take_buffers(&b, side, &taken);
    if (is_ready && upright) sample_upright(&image, x, y, side, &b);
    if (is_ready && !upright) sample_rotated(&image, x, y, angle_deg, side, &b);
    for (int64_t i = 0; is_ready && i < side; i++)
        for (int64_t j = 0; j < side; j++) window[i * side + j] = (uint8_t)b.window[i * pitch_of(side) + j];
    give_back(&taken);
    return is_ready ? DONE : OUT_OF_MEMORY;
}
