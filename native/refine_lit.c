/* Serves peakmark/refine/lit.py. */

#include <math.h>
#include <string.h>
#include "refine_align.h"

/* As lit.py explains. */
static const double TONE_SPREAD = 0.5, GAIN_SPREAD = 0.5, OFFSET_SPREAD = 0.3, WORTH = 0.8, CORRELATED_SIDE = 12.0;

static double per_square(double spread) { return 1 / (spread * spread); }

static void use_free(prior *before) {
    for (int k = 0; k < LIT; k++) before->used[k] = before->precision[k] < 0.5 * HELD;
}

static void set_anchor(model *m, double x, double y, double side) {
    m->anchor[0] = x, m->anchor[1] = y, m->anchor[2] = side;
}

static bool holds(const model *m) { return m->line_count <= MOST_LINES && m->base_count <= MOST_LINES; }

/* The last fit, to the image's own pixels: tone first, then planes of light, kept where they explain a fifth more. */
static status fit_light(model *m, picture crop, prior *before, fitted *result, memory *taken) {
    const patience limits = {15, 1.0, 1e-2};
    pixels chosen;
    status state = read_pixels(m, crop, result->theta, PIXELS, taken, &chosen);
    if (state != DONE) return state;
    use_free(before);
    *result = fit(m, &chosen, result->theta, before, limits);
    before->precision[11] = before->precision[12] = per_square(GAIN_SPREAD);
    before->precision[13] = before->precision[14] = per_square(OFFSET_SPREAD);
    use_free(before);
    fitted lit = fit(m, &chosen, result->theta, before, limits);
    bool is_worth_it = !result->converged || lit.noise < WORTH * result->noise;
    if (lit.converged && lit.theta[8] > 0 && is_worth_it) *result = lit;
    return DONE;
}

/* From the softened block means over the sharp ones to the image's own pixels; ends where the first explains nothing. */
static status align_lit(model *m, const surroundings *around, const double *center, double size, double focal,
                        const coarse *search, double hopeless, fitted *result, double *ratio, memory *taken) {
    double block = (double)around->block, precision = (focal / size) * (focal / size);
    const double local[2] = {(center[0] - (double)around->left - (block - 1) / 2) / block,
                             (center[1] - (double)around->top - (block - 1) / 2) / block};
    prior before = {.precision = {[6] = precision, [7] = precision, [10] = HELD, HELD, HELD, HELD, HELD,
                                  per_square(TONE_SPREAD)}};
    use_free(&before);
    set_anchor(m, local[0], local[1], size / block);
    status state = fit_softly(m, around, local, size / block, search, &before, hopeless, result, ratio, taken);
    if (state != DONE || *ratio > hopeless) return state;
    before.mean[10] = result->theta[10] = SHARP;
    if (around->block > 1)
        state = fit_picture(m, around->level, result->theta, BLOCK_PIXELS, &before, (patience){8, 1.0, 1.0}, result);
    if (state != DONE) return state;
    for (int k = 0; k < 2; k++) result->theta[k] = block * result->theta[k] + (block - 1) / 2;
    for (int k = 2; k < 6; k++) result->theta[k] *= block;
    set_anchor(m, center[0] - (double)around->left, center[1] - (double)around->top, size);
    before.precision[10] = per_square(BLUR_SPREAD);
    return fit_light(m, around->crop, &before, result, taken);
}

EXPORT status align_in_light(const uint8_t *gray, int64_t height, int64_t width, const double *center, double size,
                             const double *lines, int64_t line_count, const int64_t *index, int64_t intervals,
                             const double *base, int64_t base_count, double extent, double focal, const double *samples,
                             int64_t sample_count, const double *expected, const double *shapes, int64_t shape_count,
                             double hopeless, double *theta, double *noise, bool *converged, double *ratio) {
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .extent = extent};
    if (!holds(&m) || intervals != line_count + 1) return TOO_LARGE;
    memory taken = {.count = 0};
    coarse search;
    surroundings around;
    fitted result = {{0}, 0, false};
    *ratio = INFINITY;
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, true);
    if (state == DONE) state = set_surroundings(&around, gray, height, width, center, size, LEVEL_SIDE, &taken);
    bool is_tried = state == DONE && !is_too_small(&around);
    if (is_tried) state = align_lit(&m, &around, center, size, focal, &search, hopeless, &result, ratio, &taken);
    give_back(&taken);
    bool is_hopeless = *ratio > hopeless;
    if (is_tried && !is_hopeless) result.theta[0] += (double)around.left, result.theta[1] += (double)around.top;
    memcpy(theta, result.theta, sizeof result.theta);
    *noise = is_hopeless ? 0 : result.noise;
    *converged = !is_hopeless && result.converged && result.theta[8] > 0;
    return state;
}

EXPORT status lit_fit(const float *seen, int64_t n, const int32_t *xy, const double *start, const double *anchor,
                      const double *lines, int64_t line_count, const int64_t *index, int64_t intervals,
                      const double *base, int64_t base_count, const double *mean, const double *precision,
                      int64_t steps, double enough, double *theta, double *noise, bool *converged) {
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .anchor = {anchor[0], anchor[1], anchor[2]}};
    if (!holds(&m) || intervals != line_count + 1) return TOO_LARGE;
    prior before;
    memcpy(before.mean, mean, sizeof before.mean);
    memcpy(before.precision, precision, sizeof before.precision);
    use_free(&before);
    fitted result = fit(&m, &(pixels){xy, seen, n}, start, &before, (patience){steps, 1.0, enough});
    memcpy(theta, result.theta, sizeof result.theta);
    *noise = result.noise, *converged = result.converged;
    return DONE;
}

/* The best correlation of one candidate over shapes, then over shifts of its centre. */
static double best_correlation(const coarse *search, const surroundings *around, const double *xy, double side,
                               const double *shifts, int64_t shift_count) {
    double block = (double)around->block, size = side / block, best, score;
    const double center[2] = {(xy[0] - (double)around->left - (block - 1) / 2) / block,
                              (xy[1] - (double)around->top - (block - 1) / 2) / block};
    int64_t shape = best_shape(search, around->soft, center, size, 0, search->shape_count, &best);
    for (int64_t j = 0; j < shift_count; j++) {
        const double shifted[2] = {center[0] + shifts[2 * j] * size, center[1] + shifts[2 * j + 1] * size};
        best_shape(search, around->soft, shifted, size, shape, 1, &score);
        best = greater(score, best);
    }
    return best;
}

EXPORT status correlate_candidates(const uint8_t *gray, int64_t height, int64_t width, const double *xy, int64_t n,
                                   const double *sides, const double *samples, int64_t sample_count,
                                   const double *expected, const double *shapes, int64_t shape_count,
                                   const double *shifts, int64_t shift_count, double *found) {
    coarse search;
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, true);
    for (int64_t i = 0; i < n && state == DONE; i++) {
        memory taken = {.count = 0};
        surroundings around;
        state = set_surroundings(&around, gray, height, width, xy + 2 * i, sides[i], CORRELATED_SIDE, &taken);
        bool is_tried = state == DONE && !is_too_small(&around);
        found[i] = is_tried ? best_correlation(&search, &around, xy + 2 * i, sides[i], shifts, shift_count) : 0;
        give_back(&taken);
    }
    return state;
}
