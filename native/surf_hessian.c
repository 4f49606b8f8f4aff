/* Serves peakmark/surf/hessian.py, which says how the search goes. */

#include <math.h>
#include <string.h>
#include "memory.h"
#include "surf_exact.h"

/* Quick responses are off by less than this share of |Dxx Dyy| + Dxy². */
static const float SLACK = 0x1p-12f;

/* Part of an octave's grid in which maxima are sought, see `Block` in hessian.py, and the memory for it. */
typedef struct {
    int64_t octave, layers, rows, columns, top, bottom, left, right;
    const uint32_t *sums, *mask;
    int64_t stride, width; /* of a row of sums; of a row of the ring */
    float threshold;
    float *ring;    /* column k is grid column left − 1 + k; layer 1's last three grid rows, then layer 2's … */
    float *highest; /* of each layer the largest of 3×3 neighbours, and a spare row */
    uint8_t *flags;
    uint32_t *scratch;
    int64_t length; /* of an eighth of the scratch memory */
    float *records;
    int64_t count;
} search;

/* Sums over the middle five ninths of the rows, for Dxx. */
static void difference(const uint32_t *restrict r2, const uint32_t *restrict r7, uint32_t *restrict out, int64_t n) {
    for (int64_t x = 0; x < n; x++) out[x] = r7[x] - r2[x];
}

/* Top − 2 middle + bottom third, for Dyy: (r3 − r0) − 2 (r6 − r3) + (r9 − r6). */
static void second_difference(const uint32_t *restrict r0, const uint32_t *restrict r3, const uint32_t *restrict r6,
                              const uint32_t *restrict r9, uint32_t *restrict out, int64_t n) {
    for (int64_t x = 0; x < n; x++) out[x] = (r9[x] - r0[x]) - 3 * (r6[x] - r3[x]);
}

/* Upper − lower boxes, for Dxy. */
static void mixed_difference(const uint32_t *restrict r1, const uint32_t *restrict r4, const uint32_t *restrict r5,
                             const uint32_t *restrict r8, uint32_t *restrict out, int64_t n) {
    for (int64_t x = 0; x < n; x++) out[x] = (r4[x] - r1[x]) - (r8[x] - r5[x]);
}

/* Differences down the filter's rows, for Dxx, Dyy and Dxy, into the first three rows of the scratch memory. */
static void difference_rows(const search *s, int64_t corner, int64_t side, int64_t n) {
    int64_t third = side / 3, near = (2 * side + 9) / 18, low = (4 * side + 9) / 18, stride = s->stride;
    const uint32_t *from = s->sums + corner;
    difference(from + low * stride, from + (side - low) * stride, s->scratch, n);
    second_difference(from, from + third * stride, from + 2 * third * stride, from + side * stride,
                      s->scratch + s->length, n);
    mixed_difference(from + near * stride, from + (near + third) * stride, from + (side - near - third) * stride,
                     from + (side - near) * stride, s->scratch + 2 * s->length, n);
}

/* Copy every step-th element side by side, so that loops over positions can use vectors. */
static const uint32_t *every(const uint32_t *restrict from, int64_t step, uint32_t *restrict to, int64_t n) {
    if (step == 2) /* steps that are known let compilers shuffle vectors */
        for (int64_t j = 0; j < n; j++) to[j] = from[2 * j];
    else if (step == 4)
        for (int64_t j = 0; j < n; j++) to[j] = from[4 * j];
    else
        for (int64_t j = 0; j < n; j++) to[j] = from[j * step];
    return to;
}

/* Row differences at the columns of the boxes, by ninths of the side; of Dxx, Dyy and the two halves of Dxy. */
typedef struct {
    const uint32_t *x0, *x3, *x6, *x9, *y2, *y7, *u1, *u4, *u5, *u8;
    float dxx_dyy, dxy_dxy;
} boxes;

/* Dxx Dyy − 0.81 Dxy² from row differences. */
static void determinants(const boxes *b, float *restrict out, int64_t n) {
    const uint32_t *x0 = b->x0, *x3 = b->x3, *x6 = b->x6, *x9 = b->x9, *y2 = b->y2, *y7 = b->y7;
    const uint32_t *u1 = b->u1, *u4 = b->u4, *u5 = b->u5, *u8 = b->u8;
    const float dxx_dyy = b->dxx_dyy, dxy_dxy = b->dxy_dxy;
    for (int64_t j = 0; j < n; j++) {
        float dxx = (float)(int32_t)((x9[j] - x0[j]) - 3 * (x6[j] - x3[j])), dyy = (float)(int32_t)(y7[j] - y2[j]);
        float dxy = (float)(int32_t)((u4[j] - u1[j]) - (u8[j] - u5[j]));
        out[j] = dxx * dxx_dyy * dyy - dxy * dxy_dxy * dxy;
    }
}

/* Determinants of n filters of one layer, the first with its corner at sums[corner], a step apart. */
static void response_row(const search *s, int64_t corner, int64_t index, float *out, int64_t n) {
    int64_t step = (int64_t)1 << s->octave, side = side_of(s->octave, index), length = s->length;
    int64_t third = side / 3, near = (2 * side + 9) / 18, low = (4 * side + 9) / 18, m = n + side / step;
    difference_rows(s, corner, side, (n - 1) * step + side + 1);
    const uint32_t *xx = s->scratch, *yy_low = xx + length, *yy_high = yy_low, *xy_near = xx + 2 * length, *xy_far = xy_near;
    if (s->octave) { /* the boxes of Dyy and Dxy lie symmetrically in the filter: two phases each */
        uint32_t *to = s->scratch + 3 * length;
        int64_t phase = low % step, mirrored = (step - phase) % step;
        xx = every(xx, step, to, m);
        const uint32_t *yy = yy_low, *xy = xy_near;
        yy_low = yy_high = every(yy + phase, step, to + length, m);
        if (mirrored != phase) yy_high = every(yy + mirrored, step, to + 2 * length, m);
        phase = near % step, mirrored = (step - phase) % step;
        xy_near = xy_far = every(xy + phase, step, to + 3 * length, m);
        if (mirrored != phase) xy_far = every(xy + mirrored, step, to + 4 * length, m);
    }
    double mean = 1.0 / (double)(third * (side - 2 * low)), mixed_mean = 1.0 / (double)(third * third);
    const boxes b = {
        xx, xx + third / step, xx + 2 * third / step, xx + side / step,
        yy_low + low / step, yy_high + (side - low) / step,
        xy_near + near / step, xy_near + (near + third) / step,
        xy_far + (side - near - third) / step, xy_far + (side - near) / step,
        (float)(mean * mean), (float)((double)DXY_WEIGHT * mixed_mean * mixed_mean),
    };
    determinants(&b, out, n);
}

/* Compute grid row i of every searched layer that has one, with one column more on each side of the block. */
static void respond(const search *s, int64_t i) {
    for (int64_t index = 1; index <= s->layers; index++) {
        int64_t offset = 4 + 3 * index;
        int64_t first = most(s->left - 1, offset), end = least(s->right + 1, s->columns - offset);
        if (i < offset || i >= s->rows - offset || first >= end) continue;
        float *target = s->ring + ((index - 1) * 3 + i % 3) * s->width + first - s->left + 1;
        response_row(s, corner_of(s->stride, s->octave, index, i, first), index, target, end - first);
    }
}

static float larger(float a, float b) { return a > b ? a : b; }

static void max3(const float *a, const float *b, const float *c, float *restrict out, int64_t n) {
    for (int64_t j = 0; j < n; j++) out[j] = larger(larger(a[j], b[j]), c[j]);
}

/* Largest of the 3×3 neighbours in each layer, for the middle row; undefined at the first and last column. */
static void raise_to_neighbours(const search *s) {
    float *spare = s->highest + s->layers * s->width;
    for (int64_t m = 0; m < s->layers; m++) {
        const float *row = s->ring + 3 * m * s->width;
        max3(row, row + s->width, row + 2 * s->width, spare, s->width);
        max3(spare, spare + 1, spare + 2, s->highest + m * s->width + 1, s->width - 2);
    }
}

/* Mark the values over the threshold that no neighbour clearly exceeds. */
static void flag_peaks(const float *values, const float *below, const float *here, const float *above, float loose,
                       float slack, uint8_t *restrict flags, int64_t n) {
    for (int64_t j = 0; j < n; j++) {
        float value = values[j], rival = larger(larger(below[j], here[j]), above[j]);
        flags[j] = (value > loose) & (value + value * SLACK + slack >= rival);
    }
}

/* Mark the candidates of a layer's grid row i; return the number of columns searched, from `first` on. */
static int64_t flag_row(const search *s, int64_t index, int64_t i, int64_t *first) {
    int64_t margin = 8 + 3 * index, end = least(s->right, s->columns - margin), m = index - 1;
    *first = most(s->left, margin);
    if (i < margin || i >= s->rows - margin || *first >= end) return 0;
    int64_t n = end - *first, k = *first - s->left + 1;
    float slack = s->threshold < 0x1p-8f ? s->threshold : 0x1p-8f;
    memset(s->flags + n, 0, (size_t)((n + 7) / 8 * 8 - n));
    flag_peaks(s->ring + (3 * m + i % 3) * s->width + k, s->highest + most(m - 1, 0) * s->width + k,
               s->highest + m * s->width + k, s->highest + least(m + 1, s->layers - 1) * s->width + k,
               s->threshold - s->threshold * SLACK - slack, slack, s->flags, n);
    return n;
}

/* Copy the 3×3×3 neighbourhood of a candidate, as far as the ring holds its layers. */
static void cut_cube(const search *s, int64_t index, int64_t i, int64_t j, float cube[3][3][3]) {
    for (int64_t level = 0; level < 3; level++) {
        int64_t m = index - 2 + level;
        if (m < 0 || m >= s->layers) continue;
        for (int64_t di = 0; di < 3; di++)
            memcpy(cube[level][di], s->ring + (m * 3 + (i + di - 1) % 3) * s->width + j - s->left, sizeof cube[0][0]);
    }
}

/* Whether the middle of the cube exceeds its 26 neighbours; fills in layers that the ring does not hold. Where a
   neighbour comes within `doubt`, all of them are computed again in OpenCV's arithmetic. */
static bool is_maximum(const search *s, int64_t index, int64_t i, int64_t j, float cube[3][3][3], float doubt) {
    float response = cube[1][1][1];
    for (int64_t outer = index - 1; outer <= index + 1; outer += 2) {
        if (outer != 0 && outer != s->layers + 1) continue;
        int64_t corner = corner_of(s->stride, s->octave, outer, i, j);
        if (quick_response(s->sums, s->stride, corner, side_of(s->octave, outer)) > response + doubt) return false;
        fill_layer(s->sums, s->stride, s->octave, outer, i, j, false, cube[outer - index + 1]);
    }
    float rival = strongest_neighbour(cube);
    if (response - doubt <= rival && rival <= response + doubt) {
        for (int64_t level = 0; level < 3; level++)
            fill_layer(s->sums, s->stride, s->octave, index + level - 1, i, j, true, cube[level]);
        rival = strongest_neighbour(cube);
    }
    return response > rival;
}

/* Add a candidate to the records, if it is a maximum in OpenCV's arithmetic. */
static void settle(search *s, int64_t index, int64_t i, int64_t j) {
    int64_t corner = corner_of(s->stride, s->octave, index, i, j), side = side_of(s->octave, index);
    derivatives d = exact_derivatives(s->sums, s->stride, corner, side);
    float response = determinant_of(d), doubt = SLACK * (fabsf(d.xx * d.yy) + d.xy * d.xy), cube[3][3][3] = {{{0}}};
    if (!(response > s->threshold) || (s->mask && !mask_accepts(s->mask, s->stride, corner, side))) return;
    cut_cube(s, index, i, j, cube);
    cube[1][1][1] = response;
    if (!is_maximum(s, index, i, j, cube, doubt)) return;
    newton_step step = newton_offset(cube);
    if (!step.is_ok) return;
    write_record(s->records + RECORD * s->count++, s->octave, index, i, j, response, d.xx + d.yy, step);
}

/* Settle what is flagged in a row. */
static void settle_row(search *s, int64_t index, int64_t i) {
    int64_t first, n = flag_row(s, index, i, &first);
    for (int64_t k = 0; k < n; k += 8) {
        uint64_t word;
        memcpy(&word, s->flags + k, sizeof word);
        for (int64_t j = k; word && j < least(k + 8, n); j++)
            if (s->flags[j]) settle(s, index, i, first + j);
    }
}

static bool take_rows(search *s, memory *taken) {
    int64_t ring = 3 * s->layers * s->width, highest = (s->layers + 1) * s->width, flags = (s->width + 7) / 8 * 8;
    s->length = (s->width + 6 * s->layers + 11) << s->octave;
    s->ring = take(taken, ring, sizeof *s->ring), s->highest = take(taken, highest, sizeof *s->highest);
    s->flags = take(taken, flags, sizeof *s->flags), s->scratch = take(taken, 8 * s->length, sizeof *s->scratch);
    if (!s->ring || !s->highest || !s->flags || !s->scratch) return false;
    memset(s->ring, 0, (size_t)ring * sizeof *s->ring);
    memset(s->highest, 0, (size_t)highest * sizeof *s->highest);
    return true;
}

static void search_rows(search *s) {
    for (int64_t i = s->top - 1; i <= s->bottom; i++) {
        respond(s, i);
        if (i <= s->top) continue;
        raise_to_neighbours(s);
        for (int64_t index = 1; index <= s->layers; index++) settle_row(s, index, i - 1);
    }
}

/* Write the records of the maxima in a block, and how many. There is room for all: of four grid positions in a square at
   most one is a maximum of its layer. */
EXPORT status find_in_block(const int32_t *integral, int64_t height, int64_t stride, const int32_t *mask, float threshold,
                            int64_t octave, int64_t layers, int64_t rows, int64_t columns, int64_t top, int64_t bottom,
                            int64_t left, int64_t right, float *records, int64_t room, int64_t *count) {
    (void)height, (void)room;
    memory taken = {.count = 0};
    search s = {octave, layers, rows, columns, top, bottom, left, right, (const uint32_t *)integral,
                (const uint32_t *)mask, stride, right - left + 2, threshold, NULL, NULL, NULL, NULL, 0, records, 0};
    bool is_ready = take_rows(&s, &taken);
    if (is_ready) search_rows(&s);
    give_back(&taken);
    *count = s.count;
    return is_ready ? DONE : OUT_OF_MEMORY;
}
