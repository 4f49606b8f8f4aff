/* Serves peakmark/identification/blobs.py, which says what is sought. */

#include <math.h>
#include <string.h>
#include "memory.h"
#include "peak.h"

/* ---- sums over boxes, upright and tilted by 45° ---- */

/* Sums of levels, and of their squares, over all pixels above and left of a corner, modulo 2^32. */
EXPORT void upright_sums(const uint8_t *gray, int64_t height, int64_t width, uint32_t *sums, int64_t rows, int64_t stride,
                         uint32_t *squares) {
    (void)rows;
    memset(sums, 0, (size_t)stride * sizeof *sums), memset(squares, 0, (size_t)stride * sizeof *squares);
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *from = gray + y * width;
        const uint32_t *above = sums + y * stride, *above_squares = squares + y * stride;
        uint32_t *here = sums + (y + 1) * stride, *here_squares = squares + (y + 1) * stride, sum = 0, square = 0;
        here[0] = here_squares[0] = 0;
        for (int64_t x = 0; x < width; x++) {
            uint32_t level = from[x];
            sum += level, square += level * level;
            here[x + 1] = above[x + 1] + sum, here_squares[x + 1] = above_squares[x + 1] + square;
        }
    }
}

/* A row of the sums over cones: those of the row above shifted either way, less those two rows above, and two pixels more. */
static void add_cones(const uint32_t *restrict above, const uint32_t *restrict twice_above, const uint32_t *restrict here,
                      const uint32_t *restrict before, uint32_t *restrict to, int64_t width) {
    for (int64_t x = 1; x < width - 1; x++) to[x] = above[x - 1] + above[x + 1] - twice_above[x] + here[x] + before[x];
    to[0] = above[least(1, width - 1)] + here[0] + before[0];
    if (width > 1) to[width - 1] = above[width - 2] + here[width - 1] + before[width - 1];
    if (width == 1) to[0] = above[0] + here[0];
}

/* Of each column x and row y, one more than there are pixels, the sums over the pixels above y that lie at most as far
   beside x as above y − 1 (Lienhart and Maydt 2002, doi:10.1109/ICIP.2002.1038171), modulo 2^32. */
EXPORT status tilted_sums(const uint8_t *gray, int64_t height, int64_t width, uint32_t *sums, int64_t rows, int64_t stride,
                          uint32_t *squares) {
    (void)rows;
    memory taken = {.count = 0};
    uint32_t *levels = take(&taken, 5 * width, sizeof *levels), *nothing = levels ? levels + 4 * width : NULL;
    if (!levels) return OUT_OF_MEMORY;
    memset(levels, 0, (size_t)(5 * width) * sizeof *levels);
    memset(sums, 0, (size_t)stride * sizeof *sums), memset(squares, 0, (size_t)stride * sizeof *squares);
    for (int64_t y = 0; y < height; y++) {
        uint32_t *here = levels + y % 2 * 2 * width, *before = levels + (y + 1) % 2 * 2 * width;
        for (int64_t x = 0; x < width; x++) {
            uint32_t level = gray[y * width + x];
            here[x] = level, here[width + x] = level * level;
        }
        uint32_t *above[2] = {sums + y * stride, squares + y * stride};
        for (int k = 0; k < 2; k++) {
            const uint32_t *twice_above = y > 0 ? above[k] - stride : nothing;
            add_cones(above[k], twice_above, here + k * width, before + k * width, above[k] + stride, width);
            above[k][stride + width] = above[k][width - 1];
        }
    }
    give_back(&taken);
    return DONE;
}

/* ---- filters ---- */

enum { SECOND = 8, MIXED = 16, BOX = 2 * SECOND + MIXED, CORNERS = BOX + 4, MOST_FILTERS = 24, TILE = 180, CLIMBS = 8, FIELDS = 6 };
static const float DXY_WEIGHT = 0.81f;
/* Of threshold and least quotient, from which a grid position is climbed from, for off its middle a blob answers less:
   set by hand, random images lose no marker by it. */
static const double EARLY = 0.5;

/* A Hessian's three box filters: where their corners lie from a grid position, 8 of Dxx, 8 of Dyy, 16 of Dxy, and 4 of all. */
typedef struct {
    int64_t down[CORNERS], right[CORNERS]; /* lattice units */
    int64_t halves[CORNERS], full[CORNERS]; /* the same as steps in `halves` and in the sums themselves */
    int64_t top, bottom, first, last;      /* the farthest corners */
    int64_t along, across;                 /* sides of the filter, in its own directions */
    double side, best;                     /* root of its area, px; its largest response to levels of variance 1 */
    float trace_along, trace_across, mixed;
} filter;

/* What is sought in one octave: in `halves` the sums at every 2^octave-th row and column, even columns before odd ones. */
typedef struct {
    const uint32_t *sums, *squares;
    int64_t rows, columns, stride, unit; /* of the lattice; of a row of sums; px */
    bool is_tilted;
    uint32_t *halves;
    int64_t half; /* length of half a row of these */
    filter filters[MOST_FILTERS];
    int64_t families, layers; /* of a family's layers the first and the last are only compared with, the last but one only climbed to */
    int64_t top, bottom, left, right; /* grid positions, half-open; lattice positions are twice as large */
    float *ring, *highest;
    int32_t *scratch;
    uint8_t *flags;
    double pad, threshold, least_quotient;
    int64_t height, width;
    double *found;
    int64_t count, room;
} blobs;

static void set_corner(const blobs *s, filter *f, int k, int64_t along, int64_t across) {
    int64_t a = f->along, b = f->across;
    int64_t right = s->is_tilted ? along - across - ((a - b) >> 1) : along - a / 2;
    int64_t down = s->is_tilted ? along + across - ((a + b) >> 1) : across - b / 2;
    f->right[k] = right, f->down[k] = down;
    f->halves[k] = down * 2 * s->half + (right & 1) * s->half + (right >> 1);
    f->full[k] = (down * s->stride + right) * s->unit;
    f->top = least(f->top, down), f->bottom = most(f->bottom, down);
    f->first = least(f->first, right), f->last = most(f->last, right);
}

/* The filter with thirds of a length along its first direction and across. */
static filter filter_of(const blobs *s, int64_t along, int64_t across, double best) {
    int64_t a = 3 * along, b = 3 * across, low_a = (4 * a + 9) / 18, low_b = (4 * b + 9) / 18;
    int64_t near_a = (2 * a + 9) / 18, near_b = (2 * b + 9) / 18, k = 0;
    const int64_t order[4] = {3, 0, 2, 1};
    const int64_t mixed_a[4] = {near_a + along, near_a, a - near_a, a - near_a - along};
    const int64_t mixed_b[4] = {near_b + across, near_b, b - near_b, b - near_b - across};
    filter f = {.along = a, .across = b, .best = best, .top = INT64_MAX, .bottom = INT64_MIN, .first = INT64_MAX,
                .last = INT64_MIN};
    for (int i = 0; i < 4; i++, k += 2)
        set_corner(s, &f, (int)k, order[i] * along, b - low_b), set_corner(s, &f, (int)k + 1, order[i] * along, low_b);
    for (int i = 0; i < 4; i++, k += 2)
        set_corner(s, &f, (int)k, a - low_a, order[i] * across), set_corner(s, &f, (int)k + 1, low_a, order[i] * across);
    for (int i = 0; i < MIXED; i++) set_corner(s, &f, (int)k + i, mixed_a[i % 4], mixed_b[i / 4]);
    for (int i = 0; i < 4; i++) set_corner(s, &f, BOX + i, i % 2 * a, i / 2 * b);
    double cell = (double)(s->unit * s->unit * (s->is_tilted ? 2 : 1));
    f.side = sqrt((double)(a * b) * cell);
    f.trace_along = (float)(1 / ((double)(along * (b - 2 * low_b)) * cell));
    f.trace_across = (float)(1 / ((double)(across * (a - 2 * low_a)) * cell));
    double mixed = 1 / ((double)(along * across) * cell);
    f.mixed = (float)((double)DXY_WEIGHT * mixed * mixed);
    return f;
}

static bool fits(const blobs *s, const filter *f, int64_t y, int64_t x) {
    return y + f->top >= 0 && y + f->bottom < s->rows && x + f->first >= 0 && x + f->last < s->columns;
}

static int32_t second_at(const uint32_t *from, const int64_t *k) {
    uint32_t ends = (from[k[0]] - from[k[1]]) - (from[k[2]] - from[k[3]]);
    return (int32_t)(ends - 3 * ((from[k[4]] - from[k[5]]) - (from[k[6]] - from[k[7]])));
}

static int32_t mixed_at(const uint32_t *from, const int64_t *k) {
    uint32_t sum = 0;
    for (int i = 0; i < 16; i += 4) {
        uint32_t edge = from[k[i]] - from[k[i + 1]] - from[k[i + 2]] + from[k[i + 3]];
        sum += i == 0 || i == 12 ? edge : 0 - edge;
    }
    return (int32_t)sum;
}

/* Determinant and trace of the Hessian at a lattice position; 0 where the filter is not wholly in the image. */
static float response_at(const blobs *s, const filter *f, int64_t y, int64_t x, float *trace) {
    if (!fits(s, f, y, x)) return 0;
    const uint32_t *from = s->sums + (y * s->stride + x) * s->unit;
    float xx = (float)second_at(from, f->full), yy = (float)second_at(from, f->full + SECOND);
    float xy = (float)mixed_at(from, f->full + 2 * SECOND);
    xx *= f->trace_along, yy *= f->trace_across;
    if (trace) *trace = xx + yy;
    return xx * yy - xy * f->mixed * xy;
}

/* ---- variances ---- */

static uint32_t box_of(const blobs *s, const uint32_t *sums, int64_t y, int64_t x, int64_t along, int64_t across) {
    const uint32_t *from = sums + y * s->stride + x;
    int64_t by_along = s->is_tilted ? along * (s->stride + 1) : along;
    int64_t by_across = s->is_tilted ? across * (s->stride - 1) : across * s->stride;
    return from[by_along + by_across] - from[by_along] - from[by_across] + from[0];
}

/* Variance of the levels in a box from a corner on, in pixels; in parts whose sums of squares are below 2^32. */
static double variance_of(const blobs *s, int64_t y, int64_t x, int64_t along, int64_t across) {
    double sum = 0, squares = 0, count = (double)(along * across * (s->is_tilted ? 2 : 1));
    for (int64_t a = 0; a < along; a += TILE)
        for (int64_t b = 0; b < across; b += TILE) {
            int64_t row = s->is_tilted ? y + a + b : y + b, column = s->is_tilted ? x + a - b : x + a;
            int64_t wide = least(TILE, along - a), high = least(TILE, across - b);
            sum += box_of(s, s->sums, row, column, wide, high);
            squares += box_of(s, s->squares, row, column, wide, high);
        }
    double mean = sum / count;
    return greater(squares / count - mean * mean, 0);
}

/* Variance in a filter's box around a lattice position, its sides times a share; −1 where it is not inside the image. */
static double variance_under(const blobs *s, const filter *f, double y, double x, double share) {
    double unit = (double)s->unit;
    int64_t a = most(1, (int64_t)rint((double)f->along * unit * share));
    int64_t b = most(1, (int64_t)rint((double)f->across * unit * share));
    double half_x = (double)(s->is_tilted ? a - b : a) / 2, half_y = (double)(s->is_tilted ? a + b : b) / 2;
    int64_t column = (int64_t)rint(x * unit - half_x), row = (int64_t)rint(y * unit - half_y);
    int64_t left = s->is_tilted ? column - b : column, right = column + a;
    int64_t bottom = s->is_tilted ? row + a + b : row + b;
    bool is_inside = left >= 0 && row >= 0 && right < s->stride && bottom < s->height + 2 * (int64_t)s->pad + 1;
    return is_inside ? variance_of(s, row, column, a, b) : -1;
}

/* Variance in a filter's box at a lattice position, where the filter fits. */
static double own_variance(const blobs *s, const filter *f, int64_t y, int64_t x) {
    int64_t along = f->along * s->unit, across = f->across * s->unit, at = (y * s->stride + x) * s->unit;
    const int64_t *k = f->full + BOX;
    if (most(along, across) > TILE) {
        int64_t corner = at + k[0];
        return variance_of(s, corner / s->stride, corner % s->stride, along, across);
    }
    const uint32_t *sums = s->sums + at, *squares = s->squares + at;
    double each = 1 / (double)(along * across * (s->is_tilted ? 2 : 1));
    double mean = (double)(sums[k[3]] - sums[k[1]] - sums[k[2]] + sums[k[0]]) * each;
    return greater((double)(squares[k[3]] - squares[k[1]] - squares[k[2]] + squares[k[0]]) * each - mean * mean, 0);
}

/* ---- maxima ---- */

/* First − last, less three times the middle one's, of eight corners. */
static void second_row(const uint32_t *from, const int64_t *k, int32_t *restrict out, int64_t n) {
    const uint32_t *c0 = from + k[0], *c1 = from + k[1], *c2 = from + k[2], *c3 = from + k[3];
    const uint32_t *c4 = from + k[4], *c5 = from + k[5], *c6 = from + k[6], *c7 = from + k[7];
    for (int64_t j = 0; j < n; j++)
        out[j] = (int32_t)((c0[j] - c1[j]) - (c2[j] - c3[j]) - 3 * ((c4[j] - c5[j]) - (c6[j] - c7[j])));
}

/* Of eight corners the boxes' difference, less that of the other eight. */
static void mixed_row(const uint32_t *from, const int64_t *k, const int32_t *restrict other, int32_t *restrict out,
                      int64_t n) {
    const uint32_t *c0 = from + k[0], *c1 = from + k[1], *c2 = from + k[2], *c3 = from + k[3];
    const uint32_t *c4 = from + k[4], *c5 = from + k[5], *c6 = from + k[6], *c7 = from + k[7];
    for (int64_t j = 0; j < n; j++)
        out[j] = (int32_t)((c0[j] - c1[j]) - (c2[j] - c3[j]) - ((c4[j] - c5[j]) - (c6[j] - c7[j])) - (uint32_t)other[j]);
}

static void determinant_row(const filter *f, const int32_t *xx, const int32_t *yy, const int32_t *xy, float *restrict out,
                            int64_t n) {
    const float along = f->trace_along, across = f->trace_across, mixed = f->mixed;
    for (int64_t j = 0; j < n; j++) {
        float dxy = (float)xy[j];
        out[j] = ((float)xx[j] * along) * ((float)yy[j] * across) - dxy * mixed * dxy;
    }
}

/* Responses of a filter at grid row i, from column `left` on; 0 where it is not wholly in the image. */
static void respond(const blobs *s, const filter *f, int64_t i, float *out) {
    int64_t width = s->right - s->left, y = 2 * i;
    int64_t first = most(s->left, (1 - f->first) >> 1), end = least(s->right, (s->columns - 1 - f->last) / 2 + 1);
    memset(out, 0, (size_t)width * sizeof *out);
    if (y + f->top < 0 || y + f->bottom >= s->rows || s->columns - 1 - f->last < 0 || first >= end) return;
    const uint32_t *from = s->halves + y * 2 * s->half + first;
    int64_t n = end - first;
    int32_t *xx = s->scratch, *yy = xx + width, *xy = yy + width, *other = xy + width;
    second_row(from, f->halves, xx, n), second_row(from, f->halves + SECOND, yy, n);
    memset(xy, 0, (size_t)n * sizeof *xy);
    mixed_row(from, f->halves + 2 * SECOND + 8, xy, other, n), mixed_row(from, f->halves + 2 * SECOND, other, xy, n);
    determinant_row(f, xx, yy, xy, out + first - s->left, n);
}

static float larger(float a, float b) { return a > b ? a : b; }

static void max3(const float *a, const float *b, const float *c, float *restrict out, int64_t n) {
    for (int64_t j = 0; j < n; j++) out[j] = larger(larger(a[j], b[j]), c[j]);
}

static void flag_maxima(const float *values, const float *below, const float *here, const float *above, float threshold,
                        uint8_t *restrict flags, int64_t n) {
    for (int64_t j = 0; j < n; j++)
        flags[j] = (values[j] > threshold) & (values[j] >= larger(larger(below[j], here[j]), above[j]));
}

/* Responses around a lattice position, and of the layers below and above. */
typedef struct {
    float around[3][3], below, above, trace;
} neighbours;

/* Whether a filter's middle lies half a unit from its grid position. */
static bool is_half_x(const blobs *s, const filter *f) { return (s->is_tilted ? f->along - f->across : f->along) & 1; }
static bool is_half_y(const blobs *s, const filter *f) { return (s->is_tilted ? f->along + f->across : f->across) & 1; }

/* The largest response of another filter whose middle is as near to that of a filter as it can be, and where. */
static float response_beside(const blobs *s, const filter *f, const filter *other, int64_t *y, int64_t *x) {
    int64_t by_x = (int64_t)is_half_x(s, f) - (int64_t)is_half_x(s, other), at_x = *x;
    int64_t by_y = (int64_t)is_half_y(s, f) - (int64_t)is_half_y(s, other), at_y = *y;
    float best = -INFINITY;
    for (int64_t dy = least(by_y, 0); dy <= most(by_y, 0); dy++)
        for (int64_t dx = least(by_x, 0); dx <= most(by_x, 0); dx++) {
            float value = response_at(s, other, at_y + dy, at_x + dx, NULL);
            if (value > best) best = value, *y = at_y + dy, *x = at_x + dx;
        }
    return best;
}

/* Climb to a maximum over positions and layers, and fill in what is around it; false where it leads out of the layers. */
static bool climb(const blobs *s, const filter *family, int64_t *y, int64_t *x, int64_t *layer, neighbours *n) {
    for (int step = 0; step < CLIMBS && *layer > 0 && *layer < s->layers - 1; step++) {
        const filter *f = family + *layer;
        float best = n->around[1][1] = response_at(s, f, *y, *x, &n->trace);
        int64_t to_y = *y, to_x = *x, level = 0, below_y = *y, below_x = *x, above_y = *y, above_x = *x;
        for (int64_t dy = -1; dy <= 1; dy++)
            for (int64_t dx = -1; dx <= 1; dx++) {
                if (dx == 0 && dy == 0) continue;
                float value = n->around[dy + 1][dx + 1] = response_at(s, f, *y + dy, *x + dx, NULL);
                if (value > best) best = value, to_y = *y + dy, to_x = *x + dx;
            }
        n->below = response_beside(s, f, f - 1, &below_y, &below_x);
        n->above = response_beside(s, f, f + 1, &above_y, &above_x);
        if (n->below > best) best = n->below, to_y = below_y, to_x = below_x, level = -1;
        if (n->above > best) to_y = above_y, to_x = above_x, level = 1;
        if (to_y == *y && to_x == *x && !level) return true;
        *y = to_y, *x = to_x, *layer += level;
    }
    return false;
}

/* Where a parabola through three values has its maximum, from the middle; at most half the way to the next value. */
static double peak_of(double before, double here, double after, double step_before, double step_after) {
    double slope_before = (here - before) / step_before, slope_after = (after - here) / step_after;
    double bend = (slope_before - slope_after) / (step_before + step_after);
    if (!(bend > 0)) return 0;
    double peak = (slope_after + bend * step_after) / (2 * bend);
    return lesser(greater(peak, -step_before / 2), step_after / 2);
}

/* Add what a flagged position climbs to, if it is a blob inside the image. */
static void settle(blobs *s, const filter *family, int64_t layer, int64_t i, int64_t j) {
    int64_t y = 2 * i, x = 2 * j;
    neighbours n;
    if (!climb(s, family, &y, &x, &layer, &n)) return;
    const filter *f = family + layer;
    double response = n.around[1][1], unit = (double)s->unit;
    double at_y = (double)y + (is_half_y(s, f) ? 0.5 : 0) + peak_of(n.around[0][1], response, n.around[2][1], 1, 1);
    double at_x = (double)x + (is_half_x(s, f) ? 0.5 : 0) + peak_of(n.around[1][0], response, n.around[1][2], 1, 1);
    double side = f->side + peak_of(n.below, response, n.above, f->side - (f - 1)->side, (f + 1)->side - f->side);
    double py = at_y * unit - 0.5 - s->pad, px = at_x * unit - (s->is_tilted ? 0 : 0.5) - s->pad;
    bool is_inside = px > -0.5 && px < (double)s->width - 0.5 && py > -0.5 && py < (double)s->height - 0.5;
    if (!is_inside || !(response > s->threshold)) return;
    double variance = variance_under(s, f, at_y, at_x, side / f->side);
    if (variance < 0) variance = own_variance(s, f, y, x);
    double quotient = response / f->best / greater(variance, 1e-3);
    if (!(quotient > s->least_quotient)) return;
    double row[FIELDS] = {px, py, side, response, n.trace > 0 ? 1 : -1, quotient};
    if (s->count < s->room) memcpy(s->found + FIELDS * s->count, row, sizeof row);
    s->count++;
}

/* Whether a flagged position may still be a blob when it has climbed. */
static bool is_promising(const blobs *s, const filter *f, float response, int64_t i, int64_t j) {
    return response > EARLY * s->least_quotient * f->best * own_variance(s, f, 2 * i, 2 * j);
}

static void settle_row(blobs *s, const filter *family, const float *ring, const float *highest, int64_t layer, int64_t i) {
    int64_t width = s->right - s->left, n = width - 2;
    const float *values = ring + (3 * layer + i % 3) * width + 1;
    const float *here = highest + layer * width + 1;
    const float *below = layer > 1 ? here - width : here, *above = layer < s->layers - 3 ? here + width : here;
    flag_maxima(values, below, here, above, (float)(s->threshold * EARLY), s->flags, n);
    memset(s->flags + n, 0, 8);
    for (int64_t k = 0; k < n; k += 8) {
        uint64_t word;
        memcpy(&word, s->flags + k, sizeof word);
        for (int64_t j = k; word && j < least(k + 8, n); j++)
            if (s->flags[j] && is_promising(s, family + layer, values[j], i, s->left + 1 + j))
                settle(s, family, layer, i, s->left + 1 + j);
    }
}

static void search_rows(blobs *s) {
    int64_t width = s->right - s->left, ring = 3 * s->layers * width, highest = s->layers * width;
    for (int64_t i = s->top; i < s->bottom; i++)
        for (int64_t k = 0; k < s->families; k++) {
            const filter *family = s->filters + k * s->layers;
            float *own = s->ring + k * ring, *peaks = s->highest + k * highest, *spare = s->highest + s->families * highest;
            for (int64_t layer = 1; layer < s->layers - 2; layer++) {
                float *rows = own + 3 * layer * width;
                respond(s, family + layer, i, rows + i % 3 * width);
                max3(rows, rows + width, rows + 2 * width, spare, width);
                max3(spare, spare + 1, spare + 2, peaks + layer * width + 1, width - 2);
            }
            for (int64_t layer = 1; i >= s->top + 2 && layer < s->layers - 2; layer++)
                settle_row(s, family, own, peaks, layer, i - 1);
        }
}

static void fill_halves(blobs *s) {
    for (int64_t y = 0; y < s->rows; y++) {
        const uint32_t *from = s->sums + y * s->unit * s->stride;
        uint32_t *even = s->halves + y * 2 * s->half, *odd = even + s->half;
        if (s->unit == 1)
            for (int64_t j = 0; j < s->columns / 2; j++) even[j] = from[2 * j], odd[j] = from[2 * j + 1];
        else
            for (int64_t j = 0; j < s->columns / 2; j++) even[j] = from[2 * j * s->unit], odd[j] = from[(2 * j + 1) * s->unit];
        if (s->columns % 2) even[s->columns / 2] = from[(s->columns - 1) * s->unit];
    }
}

static bool take_rows(blobs *s, memory *taken) {
    int64_t across = s->right - s->left, ring = s->families * 3 * s->layers * across;
    s->halves = take(taken, s->rows * 2 * s->half, sizeof *s->halves), s->ring = take(taken, ring, sizeof *s->ring);
    s->highest = take(taken, (s->families * s->layers + 1) * across, sizeof *s->highest);
    s->scratch = take(taken, 4 * across, sizeof *s->scratch), s->flags = take(taken, across + 8, 1);
    if (!s->halves || !s->ring || !s->highest || !s->scratch || !s->flags) return false;
    memset(s->ring, 0, (size_t)ring * sizeof *s->ring);
    return true;
}

/* Write the rows of the blobs of an octave (x, y, side, response, sign, quotient) and count them; those without room are
   counted only. Filters have thirds (along, across), families of layers that follow each other; `best` is of each the
   response over the variance of what it answers to most. */
EXPORT status find_blobs(const uint32_t *sums, int64_t rows, int64_t stride, const uint32_t *squares, bool is_tilted,
                         int64_t octave, const int64_t *thirds, int64_t families, int64_t layers, const double *best,
                         int64_t pad, int64_t height, int64_t width, double threshold, double least_quotient, double *found,
                         int64_t room, int64_t *count) {
    if (families * layers > MOST_FILTERS) return TOO_LARGE;
    memory taken = {.count = 0};
    int64_t unit = (int64_t)1 << octave, columns = (stride - 1) / unit + 1;
    blobs s = {.sums = sums, .squares = squares, .rows = (rows - 1) / unit + 1, .columns = columns, .stride = stride,
               .unit = unit, .is_tilted = is_tilted, .half = (columns + 1) / 2, .families = families, .layers = layers,
               .top = pad / (2 * unit) - 1, .bottom = (pad + height) / (2 * unit) + 3, .left = pad / (2 * unit) - 1,
               .right = (pad + width) / (2 * unit) + 3, .pad = (double)pad, .threshold = threshold,
               .least_quotient = least_quotient, .height = height, .width = width, .found = found, .room = room};
    for (int64_t k = 0; k < families * layers; k++) s.filters[k] = filter_of(&s, thirds[2 * k], thirds[2 * k + 1], best[k]);
    bool is_ready = take_rows(&s, &taken);
    if (is_ready) fill_halves(&s), search_rows(&s);
    give_back(&taken);
    *count = s.count;
    return is_ready ? DONE : OUT_OF_MEMORY;
}
