/* Serves peakmark/identification/correlation.py. */

#include <math.h>
#include <string.h>
#include "lanes.h"
#include "refine_align.h"

enum { MOST_GROUPS = 64, TRIED_GROUPS = 8, BEST_GROUPS = 3, OFTEN = 4, BEST_SHAPES = 6, MOST_SIDE = 80 };
static const double CORRELATED_SIDE = 12.0; /* px, to which block means bring a larger pattern, at least */

/* Of each group of shapes the first one is tried, of the best groups these, too: every other size of every third rotation,
   see shape_grid; then all shapes of the best. */
static const int64_t TRIED[OFTEN] = {1, 2, 13, 14};

/* An image around a candidate: block means in which the pattern has 12 px a side and more, softened; and those with a level
   between each two neighbours, the nearest of which serves as a level between pixels. */
typedef struct {
    float means[MOST_SIDE * MOST_SIDE], rows[MOST_SIDE * MOST_SIDE], soft[MOST_SIDE * MOST_SIDE];
    float doubled[4 * MOST_SIDE * MOST_SIDE];
    uint32_t *sums; /* of an image's columns */
    int64_t height, width, left, top, block;
} neighbourhood;

/* Where a pattern lies: its centre, and what turns its points into pixels from there; and how well it correlates. */
typedef struct {
    double center[2], shape[4], score;
} posture;

static void double_row(const float *restrict from, float level, float *restrict to, int64_t n) {
    for (int64_t x = 0; x < n - 1; x++) to[2 * x] = from[x] - level, to[2 * x + 1] = (from[x] + from[x + 1]) / 2 - level;
    to[2 * n - 2] = from[n - 1] - level;
}

static void fill_doubled(neighbourhood *around, float level) {
    int64_t width = 2 * around->width - 1;
    for (int64_t y = 0; y < around->height; y++) {
        float *here = around->doubled + 2 * y * width, *before = here - width, *above = before - width;
        double_row(around->soft + y * around->width, level, here, around->width);
        for (int64_t x = 0; y > 0 && x < width; x++) before[x] = (above[x] + here[x]) / 2;
    }
}

static void add_row(const uint8_t *restrict row, int64_t n, uint32_t *restrict sums) {
    for (int64_t x = 0; x < n; x++) sums[x] += row[x];
}

/* Means of whole blocks from a corner on. */
static void fill_means(neighbourhood *around, const uint8_t *from, int64_t stride) {
    int64_t block = around->block, across = around->width * block;
    float each = (float)(block * block);
    for (int64_t y = 0; y < around->height; y++, from += block * stride) {
        float *to = around->means + y * around->width;
        if (block == 1)
            for (int64_t x = 0; x < across; x++) to[x] = from[x];
        else {
            memset(around->sums, 0, (size_t)across * sizeof *around->sums);
            for (int64_t i = 0; i < block; i++) add_row(from + i * stride, across, around->sums);
            for (int64_t x = 0; x < around->width; x++) {
                uint32_t sum = 0;
                for (int64_t i = 0; i < block; i++) sum += around->sums[x * block + i];
                to[x] = (float)sum / each;
            }
        }
    }
}

static int64_t inside(double position, int64_t length) {
    return position < 0 ? 0 : position < (double)length ? (int64_t)position : length;
}

/* Fill in what is around a candidate; false where that is too small. */
static bool see_around(neighbourhood *around, const uint8_t *gray, int64_t height, int64_t width, const double *xy,
                       double side) {
    double reach = 1.2 * side + 4;
    int64_t block = around->block = most(1, (int64_t)(side / CORRELATED_SIDE));
    around->left = inside(xy[0] - reach, width), around->top = inside(xy[1] - reach, height);
    int64_t right = least(inside(xy[0] + reach, width) + 1, width), bottom = least(inside(xy[1] + reach, height) + 1, height);
    around->height = least(most(0, bottom - around->top) / block, MOST_SIDE);
    around->width = least(most(0, right - around->left) / block, MOST_SIDE);
    if (least(around->height, around->width) < 4) return false;
    fill_means(around, gray + around->top * width + around->left, width);
    softened(around->means, around->height, around->width, around->rows, around->soft);
    return true;
}

/* Levels at the samples under a shape; outside the picture its nearest. */
static void sample_nearest(const coarse *search, const neighbourhood *around, const double *center, const double *shape,
                           double size, float *restrict values) {
    const float a = (float)(2 * shape[0] * size), b = (float)(2 * shape[1] * size), c = (float)(2 * shape[2] * size);
    const float e = (float)(2 * shape[3] * size), cx = (float)(2 * center[0] + 0.5), cy = (float)(2 * center[1] + 0.5);
    const int32_t width = (int32_t)(2 * around->width - 1);
    const float right = (float)(width - 1), bottom = (float)(2 * around->height - 2);
    int32_t at[MOST_SAMPLES];
    for (int64_t i = 0; i < search->padded; i++) {
        float x = cx + a * search->u[i] + b * search->v[i], y = cy + c * search->u[i] + e * search->v[i];
        x = x > 0 ? x : 0, y = y > 0 ? y : 0;
        x = x < right ? x : right, y = y < bottom ? y : bottom;
        at[i] = (int32_t)y * width + (int32_t)x;
    }
    for (int64_t i = 0; i < search->padded; i++) values[i] = around->doubled[at[i]] * search->used[i];
}

/* A shape, or a group by its first shape, and the best score there. */
typedef struct {
    int64_t shape;
    double score;
} scored;

/* The best shapes so far, best first. */
typedef struct {
    scored best[BEST_SHAPES];
} ranking;

/* Score a shape, and keep it if it is among the best. */
static double try_shape(const coarse *search, const neighbourhood *around, const posture *start, double size, int64_t shape,
                        ranking *found) {
    float values[MOST_SAMPLES];
    sample_nearest(search, around, start->center, search->shapes + 4 * shape, size, values);
    double score = search->score(search, values);
    scored own = {shape, score};
    for (int k = 0; k < BEST_SHAPES && own.score > found->best[BEST_SHAPES - 1].score; k++)
        if (own.score > found->best[k].score) {
            scored worse = found->best[k];
            found->best[k] = own, own = worse;
        }
    return score;
}

/* Bring the best `wanted` of some groups to the front. */
static void put_best_first(scored *groups, int64_t count, int64_t wanted) {
    for (int64_t n = 0; n < wanted; n++) {
        int64_t best = n;
        for (int64_t k = n + 1; k < count; k++)
            if (groups[k].score > groups[best].score) best = k;
        scored swapped = groups[n];
        groups[n] = groups[best], groups[best] = swapped;
    }
}

static bool is_tried(int64_t k) { return k == TRIED[0] || k == TRIED[1] || k == TRIED[2] || k == TRIED[3]; }

/* About the best of all shapes; where none of those that are tried first comes near to a pattern's correlation, the best of
   them. */
static ranking search_shapes(const coarse *search, const neighbourhood *around, const posture *start, double size,
                             double hopeless) {
    scored groups[MOST_GROUPS];
    ranking found;
    for (int k = 0; k < BEST_SHAPES; k++) found.best[k] = (scored){0, -INFINITY};
    int64_t each = most(search->group, 1), count = least(search->shape_count / each, MOST_GROUPS);
    int64_t tried = least(TRIED_GROUPS, count), kept = least(BEST_GROUPS, count);
    for (int64_t g = 0; g < count; g++)
        groups[g] = (scored){g * each, try_shape(search, around, start, size, g * each + least(TRIED[0], each - 1), &found)};
    put_best_first(groups, count, tried);
    for (int64_t g = 0; g < tried; g++)
        for (int k = 1; k < OFTEN && TRIED[k] < each; k++) {
            double score = try_shape(search, around, start, size, groups[g].shape + TRIED[k], &found);
            groups[g].score = greater(score, groups[g].score);
        }
    if (found.best[0].score < hopeless) return found;
    put_best_first(groups, tried, kept);
    for (int64_t g = 0; g < kept; g++)
        for (int64_t k = 0; k < each; k++)
            if (!is_tried(k)) try_shape(search, around, start, size, groups[g].shape + k, &found);
    return found;
}

/* To block means from the image's own pixels. */
static posture in_blocks(const double *xy, const neighbourhood *around) {
    double block = (double)around->block, half = (block - 1) / 2;
    return (posture){{(xy[0] - (double)around->left - half) / block, (xy[1] - (double)around->top - half) / block}, {0}, 0};
}

static void write_posture(const posture *own, const neighbourhood *around, double *at) {
    double block = (double)around->block;
    at[0] = block * own->center[0] + (block - 1) / 2 + (double)around->left;
    at[1] = block * own->center[1] + (block - 1) / 2 + (double)around->top;
    for (int k = 0; k < 4; k++) at[2 + k] = block * own->shape[k];
}

static double exact_score(const coarse *search, const neighbourhood *around, const double *center, double size, int64_t shape) {
    double score;
    best_shape(search, (picture){around->soft, around->height, around->width}, center, size, shape, 1, &score);
    return score;
}

/* The best correlation of one candidate over shapes, then over shifts of its centre. */
static posture find_posture(const coarse *search, neighbourhood *around, const double *xy, double side, const double *shifts,
                            int64_t shift_count, double hopeless) {
    double size = side / (double)around->block;
    posture start = in_blocks(xy, around), best = start;
    int64_t x = inside(start.center[0], around->width - 1), y = inside(start.center[1], around->height - 1);
    fill_doubled(around, around->soft[y * around->width + x]);
    ranking ranked = search_shapes(search, around, &start, size, hopeless);
    bool is_hopeless = ranked.best[0].score < hopeless;
    scored found = {0, -INFINITY};
    for (int k = 0; k < (is_hopeless ? 1 : BEST_SHAPES); k++) {
        double score = exact_score(search, around, start.center, size, ranked.best[k].shape);
        if (score > found.score) found = (scored){ranked.best[k].shape, score};
    }
    best.score = found.score;
    for (int k = 0; k < 4; k++) best.shape[k] = size * search->shapes[4 * found.shape + k];
    for (int64_t j = 0; !is_hopeless && j < shift_count; j++) {
        const double shifted[2] = {start.center[0] + shifts[2 * j] * size, start.center[1] + shifts[2 * j + 1] * size};
        double score = exact_score(search, around, shifted, size, found.shape);
        if (score > best.score) best.center[0] = shifted[0], best.center[1] = shifted[1], best.score = score;
    }
    return best;
}

EXPORT status correlate_candidates(const uint8_t *gray, int64_t height, int64_t width, const double *xy, int64_t n,
                                   const double *sides, const double *samples, int64_t sample_count,
                                   const double *expected, const double *shapes, int64_t shape_count,
                                   const double *shifts, int64_t shift_count, double hopeless, double *found,
                                   double *postures) {
    coarse search;
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, true);
    memory taken = {.count = 0};
    neighbourhood *around = take(&taken, 1, sizeof *around);
    uint32_t *sums = take(&taken, width, sizeof *sums);
    if (!around || !sums) state = OUT_OF_MEMORY;
    else around->sums = sums;
    for (int64_t i = 0; i < n && state == DONE; i++) {
        found[i] = 0;
        memset(postures + 6 * i, 0, 6 * sizeof *postures);
        if (!see_around(around, gray, height, width, xy + 2 * i, sides[i])) continue;
        posture best = find_posture(&search, around, xy + 2 * i, sides[i], shifts, shift_count, hopeless);
        found[i] = best.score;
        write_posture(&best, around, postures + 6 * i);
    }
    give_back(&taken);
    return state;
}
