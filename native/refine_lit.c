/* Serves peakmark/refine/lit.py. */

#include <math.h>
#include <string.h>
#include "elementary.h"
#include "refine_align.h"

/* As lit.py explains. */
static const double TONE = 0.35, TONE_SPREAD = 0.4, GAIN_SPREAD = 0.5, OFFSET_SPREAD = 0.3, MOTION_SPREAD = 0.2;
enum { PART_PIXELS = 800, RAMP_PIXELS = 250, SEEN_PIXELS = 300 };
static const double UNCLEAR = 0.012, RAMP_CENTER_SPREAD = 0.1, RAMP_SHAPE_SPREAD = 0.25, SOFTENED = 0.1406;
static const double WORTH = 25, LOST = 0.12;
static const double REST_NOISE = 6, REST_SHARE = 0.006, FIRST_CUT = 2, CUT_SIGMAS = 3, CUT_SHARE = 0.08, LEFT = 0.15;
static const double SOFT_LEFT = 0.003, LEAST_SOFT_SHARE = 0.35, LEAST_SHARE = 0.3, OPEN_SHARE = 0.6, AWAY = 0.25;
static const double RIM_BLUR = 0.03, WHITE_RIM = 3;

static const patience LAST_FIT = {10, 1.0, 1e-2, 0}, LONG_FIT = {25, 1.0, 1e-2, 0}, SHORT_FIT = {4, 1.0, 0.1, 0};

static double per_square(double spread) { return 1 / (spread * spread); }

static void use_free(prior *before) {
    for (int k = 0; k < LIT; k++) before->used[k] = before->precision[k] < 0.5 * HELD;
}

static void set_anchor(model *m, double x, double y, double side) {
    m->anchor[0] = x, m->anchor[1] = y, m->anchor[2] = side;
}

/* Keep a fit with more parameters where it is worth them: its log likelihood is larger by WORTH. */
static void keep_better(const pixels *chosen, const fitted *richer, fitted *result) {
    double gain = (double)chosen->count / 2 * (same_log(result->noise) - same_log(greater(richer->noise, 1e-12)));
    if (richer->converged && richer->theta[8] > 0 && gain > WORTH) *result = *richer;
}

/* A fit that ends where it cannot be worth its parameters. */
static patience to_be_worth(patience limits, const pixels *chosen, const fitted *poorer) {
    limits.goal = poorer->noise * same_exp(-2 * WORTH / (double)chosen->count);
    return limits;
}

/* The fit of blur along a direction, with the planes of light that were kept. */
static fitted fit_motion(model *m, const pixels *chosen, double size, const fitted *still, prior *before) {
    double start[LIT];
    memcpy(start, still->theta, sizeof start);
    start[10] += 0.2;
    for (int k = 11; k < 15; k++) if (still->theta[k] == 0) before->precision[k] = HELD;
    before->precision[16] = before->precision[17] = per_square(MOTION_SPREAD * size * MOTION_SPREAD * size);
    use_free(before);
    return fit(m, chosen, start, before, to_be_worth(LAST_FIT, chosen, still));
}

/* Whether a fit with more parameters could be worth them, down to half the image's own noise. */
static bool may_improve(const pixels *chosen, const fitted *result, double sigma) {
    double least_noise = greater(sigma * sigma / 2, 1.0 / 12);
    return (double)chosen->count / 2 * same_log(greater(result->noise / least_noise, 1)) > WORTH;
}

/* Whether the tone alone leaves so much that there is no marker: light, motion and covers explain a part of it only. */
static bool is_lost(const fitted *result, double sigma) {
    double gain = result->theta[8];
    return !(gain > 0) || result->noise - sigma * sigma > LOST * gain * gain;
}

static void free_planes(prior *before) {
    before->precision[11] = before->precision[12] = per_square(GAIN_SPREAD);
    before->precision[13] = before->precision[14] = per_square(OFFSET_SPREAD);
    use_free(before);
}

/* The last fits, to the image's own pixels: tone first, then planes of light and motion. */
static void fit_light(model *m, const pixels *chosen, double size, double sigma, bool has_ramp, prior *before,
                      fitted *result) {
    use_free(before);
    if (has_ramp) free_planes(before);
    *result = fit(m, chosen, result->theta, before, LAST_FIT);
    if (!has_ramp && is_lost(result, sigma)) result->length = INFINITY;
    if (!has_ramp && (result->length == INFINITY || !may_improve(chosen, result, sigma))) return;
    free_planes(before);
    fitted lit = fit(m, chosen, result->theta, before, to_be_worth(has_ramp ? LONG_FIT : LAST_FIT, chosen, result));
    keep_better(chosen, &lit, result);
    if (is_lost(result, sigma)) result->length = INFINITY;
    if (result->length == INFINITY || !may_improve(chosen, result, sigma)) return;
    fitted moved = fit_motion(m, chosen, size, result, before);
    keep_better(chosen, &moved, result);
}

/* The prior of a last fit, of the parameters that it has: planes and motion that are 0 were not kept. */
static prior last_prior(const model *m, const double *theta, double size, double focal) {
    double bent = per_square(size / focal), motion = per_square(MOTION_SPREAD * size * MOTION_SPREAD * size);
    prior before = {.mean = {[10] = SHARP, [15] = TONE},
                    .precision = {[6] = bent, [7] = bent, [10] = per_square(BLUR_SPREAD), per_square(GAIN_SPREAD),
                                  per_square(GAIN_SPREAD), per_square(OFFSET_SPREAD), per_square(OFFSET_SPREAD),
                                  per_square(TONE_SPREAD), motion, motion}};
    for (int k = 11; k < LIT; k++)
        if (theta[k] == 0) before.precision[k] = HELD;
    hold_turn(m, &before);
    use_free(&before);
    return before;
}

/* The last fit once more, to all pixels, where it was to a much smaller part of them. */
static status polish(model *m, picture crop, double size, double focal, int64_t part, fitted *result, double cut,
                     memory *taken) {
    pixels all;
    status state = read_pixels(m, crop, result->theta, PIXELS, taken, &all);
    if (state != DONE || all.count < part * 3 / 2) return state;
    prior last = last_prior(m, result->theta, size, focal);
    m->cut = cut;
    fitted polished = fit(m, &all, result->theta, &last, (patience){6, 1.0, 1e-2, 0});
    m->cut = 0;
    if (polished.converged && polished.theta[8] > 0) *result = polished;
    return DONE;
}

/* The last fits to a part of the pixels, then to all. */
static status fit_image(model *m, picture crop, double size, double focal, double sigma, bool has_ramp, prior *before,
                        fitted *result, memory *taken) {
    pixels part;
    status state = read_pixels(m, crop, result->theta, PART_PIXELS, taken, &part);
    if (state != DONE) return state;
    fit_light(m, &part, size, sigma, has_ramp, before, result);
    return result->length < 1 ? polish(m, crop, size, focal, part.count, result, 0, taken) : DONE;
}

/* Where planes of light explain the softened image and nothing else does, a steep ramp, the fit with them: from the coarse
   search, which takes a plane out, for a fit without has gone astray. The blur is held here, so that it cannot explain a
   pattern away. */
static status find_ramp(model *m, const surroundings *around, const double *center, double size, const coarse *search,
                        double sigma, const prior *before, double enough, fitted *result, bool *has_ramp) {
    prior here = *before;
    fitted lit = {.length = INFINITY};
    double start[LIT] = {center[0], center[1]}, score, expected = SOFTENED * sigma * sigma / (double)(around->block * around->block);
    const double *shape = search->shapes + 4 * best_shape(search, around->soft, center, size, 0, search->shape_count, &score);
    for (int k = 0; k < 4; k++) start[2 + k] = size * shape[k];
    start[8] = result->theta[8], start[9] = result->theta[9], start[10] = 0.5, start[15] = TONE;
    memcpy(here.mean, start, sizeof start);
    here.precision[0] = here.precision[1] = per_square(RAMP_CENTER_SPREAD * size);
    for (int k = 2; k < 6; k++) here.precision[k] = per_square(RAMP_SHAPE_SPREAD * size);
    hold_turn(m, &here);
    free_planes(&here);
    m->is_soft = true;
    status state = fit_picture(m, around->soft, start, RAMP_PIXELS, &here, LONG_FIT, &lit);
    m->is_soft = false;
    *has_ramp = state == DONE && lit.noise > 0 && lit.theta[8] > 0 &&
                lit.noise - expected < enough * lit.theta[8] * lit.theta[8];
    if (*has_ramp) *result = lit;
    return state;
}

/* ---- a second look, at parts ---- */

enum { SECTORS = 8, LEAST_SECTORS = 4, MOST_SECTORS = 6, ALL_SECTORS = 8 };

/* A run of sectors around the centre in which pattern and image agree best. */
typedef struct {
    int first, count;
    double worth;
} sector_run;

/* Which of eight sectors, centred on the sides and corners, a point of the pattern lies in. */
static int sector_of(double u, double v) {
    double a = fabs(u), b = fabs(v);
    if (b <= 0.41421356 * a) return u >= 0 ? 0 : 4;
    if (a <= 0.41421356 * b) return v >= 0 ? 2 : 6;
    return v >= 0 ? (u >= 0 ? 1 : 3) : (u >= 0 ? 7 : 5);
}

static bool is_within(const sector_run *run, double u, double v) {
    return (sector_of(u, v) - run->first + SECTORS) % SECTORS < run->count;
}

typedef struct {
    double n, a, b, aa, bb, ab;
} moments;

static void add_moments(moments *sum, const moments *other) {
    sum->n += other->n, sum->a += other->a, sum->b += other->b;
    sum->aa += other->aa, sum->bb += other->bb, sum->ab += other->ab;
}

/* −n ln (1 − ρ²): how much better the pattern explains the points than their mean does. */
static double worth_of(const moments *sum) {
    double ab = sum->ab - sum->a * sum->b / sum->n;
    double aa = greater(sum->aa - sum->a * sum->a / sum->n, 1e-6), bb = greater(sum->bb - sum->b * sum->b / sum->n, 1e-9);
    return ab > 0 ? -sum->n * same_log(greater(1 - ab * ab / (aa * bb), 1e-3)) : 0;
}

static sector_run best_run(const coarse *search, const float *values) {
    moments of[SECTORS] = {{0}};
    for (int64_t i = 0; i < (int64_t)search->count; i++) {
        double a = values[i], b = search->expected[i];
        moments one = {1, a, b, a * a, b * b, a * b};
        add_moments(&of[sector_of(search->u[i], search->v[i])], &one);
    }
    sector_run best = {0, ALL_SECTORS, 0};
    for (int first = 0; first < SECTORS; first++) {
        moments sum = {0};
        for (int count = 1; count <= MOST_SECTORS; count++) {
            add_moments(&sum, &of[(first + count - 1) % SECTORS]);
            double worth = count < LEAST_SECTORS ? 0 : worth_of(&sum);
            if (worth > best.worth) best = (sector_run){first, count, worth};
        }
        if (first > 0) continue;
        for (int rest = MOST_SECTORS; rest < SECTORS; rest++) add_moments(&sum, &of[rest]);
        double worth = worth_of(&sum);
        if (worth > best.worth) best = (sector_run){0, ALL_SECTORS, worth};
    }
    return best;
}

static double worth_of_best_run(const coarse *search, const float *values) { return best_run(search, values).worth; }

/* Keep the pixels that lie in a run of sectors. */
static void keep_run(const sector_run *run, const double *theta, int32_t *xy, float *levels, pixels *chosen) {
    int64_t kept = 0;
    for (int64_t i = 0; i < chosen->count; i++) {
        pattern_view at = pattern_point(theta, xy[2 * i], xy[2 * i + 1]);
        if (!is_within(run, at.u, at.v)) continue;
        xy[2 * kept] = xy[2 * i], xy[2 * kept + 1] = xy[2 * i + 1];
        levels[kept++] = levels[i];
    }
    *chosen = (pixels){xy, levels, kept};
}

/* The fit of what may be covered in part, from the shape and the sectors in which the softened image agrees best: first to
   these alone, then to all pixels, of which those far off count little. */
static status look_again(model *m, const surroundings *around, const double *center, double size, const coarse *search,
                         const prior *before, fitted *result, memory *taken) {
    coarse partly = *search;
    prior here = *before;
    double start[LIT] = {center[0], center[1]}, score, low = INFINITY, high = -INFINITY;
    float values[MOST_SAMPLES];
    partly.score = worth_of_best_run;
    const double *shape = partly.shapes + 4 * best_shape(&partly, around->soft, center, size, 0, partly.shape_count, &score);
    sample(search, around->soft, center, shape, size, 0, values);
    sector_run run = best_run(search, values);
    for (int64_t i = 0; i < (int64_t)search->count; i++)
        if (is_within(&run, search->u[i], search->v[i])) low = lesser(low, values[i]), high = greater(high, values[i]);
    for (int k = 0; k < 4; k++) start[2 + k] = size * shape[k];
    start[8] = high - low, start[9] = low, start[10] = 0.5, start[15] = TONE;
    *result = (fitted){.length = INFINITY};
    memcpy(result->theta, start, sizeof start);
    memcpy(here.mean, start, sizeof start);
    here.precision[0] = here.precision[1] = per_square(RAMP_CENTER_SPREAD * size);
    for (int k = 2; k < 6; k++) here.precision[k] = per_square(RAMP_SHAPE_SPREAD * size);
    pixels chosen;
    status state = read_pixels(m, around->soft, start, SEEN_PIXELS, taken, &chosen);
    if (state != DONE) return state;
    keep_run(&run, start, (int32_t *)chosen.xy, (float *)chosen.levels, &chosen);
    m->is_soft = true;
    *result = fit(m, &chosen, start, &here, LAST_FIT);
    free_planes(&here);
    for (double times = FIRST_CUT; times >= 1 && result->noise > 0 && result->theta[8] > 0 && state == DONE; times /= 2) {
        m->cut = times * CUT_SHARE * result->theta[8];
        state = fit_picture(m, around->soft, result->theta, SEEN_PIXELS, &here, times > 1 ? SHORT_FIT : LAST_FIT, result);
    }
    m->cut = 0, m->is_soft = false;
    return state;
}

/* ---- all steps ---- */

/* An alignment goes through stages: to the softened image, to its own pixels, and, where that explains little, a second look at
   parts. */
enum { SOFT_STAGE, SHARP_STAGE, PARTS_STAGE, PART_STAGE };

/* Where an alignment stands: the fit, in the image's pixels; noise over gain² of the fit to the softened image, and whether that
   has planes of light; the `cut` of the second look, 0 where all pixels count; and the noise of the first look that the second has
   to be below, ∞ where that was given up. */
typedef struct {
    fitted result;
    double ratio, cut, was;
    bool has_ramp;
} standing;

/* From block means to the image's own pixels. */
static void enlarge(fitted *result, double block) {
    for (int k = 0; k < 2; k++) result->theta[k] = block * result->theta[k] + (block - 1) / 2;
    for (int k = 2; k < 6; k++) result->theta[k] *= block;
}

static prior first_prior(const model *m, double size, double focal) {
    double precision = (focal / size) * (focal / size);
    prior before = {.mean = {[15] = TONE},
                    .precision = {[6] = precision, [7] = precision, [10] = HELD, HELD, HELD, HELD, HELD,
                                  per_square(TONE_SPREAD), HELD, HELD}};
    hold_turn(m, &before);
    if (m->is_round) hold(&before, 6), hold(&before, 7); /* a ramp of light looks like perspective: that comes last */
    use_free(&before);
    return before;
}

/* Anchor the planes in the block means, and return in `local` where the centre is there. */
static void set_local(model *m, const surroundings *around, const double *center, double size, double *local) {
    double block = (double)around->block;
    local[0] = (center[0] - (double)around->left - (block - 1) / 2) / block;
    local[1] = (center[1] - (double)around->top - (block - 1) / 2) / block;
    set_anchor(m, local[0], local[1], size / block);
}

/* From block means to the image's own pixels, which are blurred less. */
static void go_to_pixels(model *m, const surroundings *around, const double *center, double size, fitted *result,
                         prior *before) {
    enlarge(result, (double)around->block);
    set_anchor(m, center[0] - (double)around->left, center[1] - (double)around->top, size);
    before->precision[10] = per_square(BLUR_SPREAD);
}

/* To block means from the image's own pixels; the inverse of `enlarge`. */
static void reduce(fitted *result, double block) {
    for (int k = 0; k < 2; k++) result->theta[k] = (result->theta[k] - (block - 1) / 2) / block;
    for (int k = 2; k < 6; k++) result->theta[k] /= block;
}

/* The fit to the softened block means; given up where that explains nothing. */
static status fit_soft_image(model *m, const surroundings *around, const double *center, double size, double focal,
                             const coarse *search, double sigma, double hopeless, standing *now, memory *taken) {
    double local[2], block = (double)around->block;
    prior before = first_prior(m, size, focal);
    set_local(m, around, center, size, local);
    status state = fit_softly(m, around, local, size / block, search, &before, sigma, hopeless, &now->result, &now->ratio, taken);
    if (state == DONE && now->ratio > UNCLEAR && now->ratio < INFINITY)
        state = find_ramp(m, around, local, size / block, search, sigma, &before, lesser(now->ratio, hopeless) / 4, &now->result, &now->has_ramp);
    if (now->has_ramp) now->ratio = lesser(now->ratio, hopeless);
    if (now->ratio > hopeless) now->result.length = INFINITY;
    enlarge(&now->result, block);
    return state;
}

/* From the softened block means over the sharp ones to the image's own pixels. */
static status fit_sharp_image(model *m, const surroundings *around, const double *center, double size, double focal,
                              double sigma, standing *now, memory *taken) {
    double local[2], block = (double)around->block;
    status state = DONE;
    prior before = first_prior(m, size, focal);
    set_local(m, around, center, size, local);
    reduce(&now->result, block);
    before.mean[10] = now->result.theta[10] = SHARP;
    if (around->block > 1)
        state = fit_picture(m, around->level, now->result.theta, BLOCK_PIXELS, &before, (patience){8, 1.0, 1.0, 0}, &now->result);
    if (state != DONE) return state;
    go_to_pixels(m, around, center, size, &now->result, &before);
    return fit_image(m, around->crop, size, focal, sigma, now->has_ramp, &before, &now->result, taken);
}

/* Whether a fit ended far from where it began. */
static bool is_away(const model *m, const fitted *result) {
    double x = result->theta[0] - m->anchor[0], y = result->theta[1] - m->anchor[1];
    return x * x + y * y > AWAY * AWAY * m->anchor[2] * m->anchor[2];
}

static bool is_given_up(const model *m, const fitted *result) {
    return !(result->length < INFINITY && result->theta[8] > 0) || is_away(m, result);
}

/* Whether much is left that noise does not explain. */
static bool is_unexplained(const fitted *result, double sigma) {
    return result->noise > REST_NOISE * greater(sigma * sigma, 1) &&
           result->noise > REST_SHARE * result->theta[8] * result->theta[8];
}

/* The fit to the image's own pixels of what may be covered in part; without a cut where that explains all. */
static fitted fit_part(model *m, const pixels *chosen, const double *start, double sigma, prior *before, double *cut) {
    fitted part = {.length = INFINITY};
    memcpy(part.theta, start, sizeof part.theta);
    free_planes(before);
    for (double times = FIRST_CUT; times >= 1; times /= 2) {
        m->cut = *cut = times * greater(CUT_SIGMAS * sigma, CUT_SHARE * part.theta[8]);
        part = fit(m, chosen, part.theta, before, times > 1 ? SHORT_FIT : LAST_FIT);
    }
    m->cut = 0;
    if (!(part.share > OPEN_SHARE)) return part;
    fitted open = fit(m, chosen, part.theta, before, LAST_FIT);
    if (!open.converged || is_unexplained(&open, sigma)) return part;
    *cut = 0;
    return open;
}

/* A second look at the softened image; given up where that is not likely. Its ratio is that of what is seen, its cut the share
   that is. */
static status look_at_parts(model *m, const surroundings *around, const double *center, double size, double focal,
                            const coarse *search, double sigma, standing *now, memory *taken) {
    double block = (double)around->block, local[2];
    fitted *part = &now->result;
    now->was = is_given_up(m, part) ? INFINITY : part->noise;
    part->length = INFINITY;
    prior before = first_prior(m, size, focal);
    set_local(m, around, center, size, local);
    status state = look_again(m, around, local, size / block, search, &before, part, taken);
    double gain = part->theta[8], expected = SOFTENED * sigma * sigma / (block * block);
    now->ratio = greater(part->noise - expected, 0) / (gain * gain), now->cut = part->share;
    bool is_likely = gain > 0 && part->noise > 0 && part->share > LEAST_SOFT_SHARE && now->ratio < SOFT_LEFT;
    if (!is_likely) part->length = INFINITY;
    enlarge(part, block);
    return state;
}

/* The second look at the image's own pixels; given up where it does not leave much less than the first. */
static status fit_in_part(model *m, const surroundings *around, double size, double focal, double sigma, standing *now,
                          memory *taken) {
    double own_cut;
    prior before = first_prior(m, size, focal);
    pixels chosen;
    now->result.theta[10] = before.mean[10] = SHARP;
    before.precision[10] = per_square(BLUR_SPREAD);
    status state = read_pixels(m, around->crop, now->result.theta, PART_PIXELS, taken, &chosen);
    if (state != DONE) return state;
    fitted part = fit_part(m, &chosen, now->result.theta, sigma, &before, &own_cut);
    double gain = part.theta[8];
    bool is_kept = gain > 0 && part.share > LEAST_SHARE && part.noise - sigma * sigma < REST_SHARE * gain * gain &&
                   part.noise < LEFT * now->was;
    now->result = part, now->cut = own_cut;
    if (!is_kept) now->result.length = INFINITY;
    return is_kept ? polish(m, around->crop, size, focal, chosen.count, &now->result, own_cut, taken) : DONE;
}

static void move(fitted *result, double x, double y) { result->theta[0] += x, result->theta[1] += y; }

/* Take an alignment one stage on, in an image of noise sigma; what cannot be tried is given up. */
static status align_on(model *m, const uint8_t *gray, int64_t height, int64_t width, const double *center, double size, double focal,
                const coarse *search, double sigma, double hopeless, int64_t stage, standing *now) {
    memory taken = {.count = 0};
    surroundings around;
    set_anchor(m, center[0], center[1], size);
    if (stage == PARTS_STAGE && !is_given_up(m, &now->result) && !is_unexplained(&now->result, sigma)) {
        now->result.length = INFINITY;
        return DONE;
    }
    status state = set_surroundings(&around, gray, height, width, center, size, LEVEL_SIDE, true, &taken);
    if (state == DONE && is_too_small(&around)) now->result.length = INFINITY;
    else if (state == DONE) {
        double left = (double)around.left, top = (double)around.top;
        if (stage != SOFT_STAGE) move(&now->result, -left, -top);
        set_anchor(m, center[0] - left, center[1] - top, size);
        if (stage == SOFT_STAGE)
            state = fit_soft_image(m, &around, center, size, focal, search, sigma, hopeless, now, &taken);
        else if (stage == SHARP_STAGE)
            state = fit_sharp_image(m, &around, center, size, focal, sigma, now, &taken);
        else if (stage == PARTS_STAGE)
            state = look_at_parts(m, &around, center, size, focal, search, sigma, now, &taken);
        else
            state = fit_in_part(m, &around, size, focal, sigma, now, &taken);
        move(&now->result, left, top);
    }
    give_back(&taken);
    return state;
}

/* Take alignments one stage on. Of each there are parameters, and noise, length of the last step (∞ where it was given up),
   `ratio`, `cut`, whether there is a ramp, and what the noise `was`: see `standing`. */
EXPORT status align_each(const uint8_t *gray, int64_t height, int64_t width, const double *xy, int64_t n, const double *sides,
                         const double *lines, int64_t line_count, const int64_t *index, int64_t rows, int64_t intervals,
                         const double *base, int64_t base_count, double extent, double focal, const double *samples, int64_t sample_count,
                         const double *expected, const double *shapes, int64_t shape_count, double sigma, double hopeless,
                         int64_t stage, double *theta, double *fits) {
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .extent = extent};
    m.is_quick = true; /* the last fit, which tells positions, is exact */
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    coarse search;
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, true);
    for (int64_t k = 0; k < n && state == DONE; k++) {
        double *found = theta + LIT * k, *fit = fits + 6 * k;
        standing now = {.result = {.length = INFINITY}, .ratio = INFINITY};
        if (stage != SOFT_STAGE) {
            memcpy(now.result.theta, found, sizeof now.result.theta);
            now.result.noise = fit[0], now.result.length = fit[1], now.ratio = fit[2], now.cut = fit[3], now.has_ramp = fit[4] > 0, now.was = fit[5];
        }
        state = align_on(&m, gray, height, width, xy + 2 * k, sides[k], focal, &search, sigma, hopeless, stage, &now);
        memcpy(found, now.result.theta, sizeof now.result.theta);
        fit[0] = now.result.noise, fit[1] = now.result.length, fit[2] = now.ratio, fit[3] = now.cut, fit[4] = now.has_ramp, fit[5] = now.was;
    }
    return state;
}

/* Whether so little blur is left that white paper just outside the pattern stays white. */
static bool is_sharp(const double *theta) {
    double side = sqrt(fabs(theta[2] * theta[5] - theta[3] * theta[4]));
    double variance = greater(theta[10], 0) + sqrt(theta[16] * theta[16] + theta[17] * theta[17]);
    return variance < RIM_BLUR * RIM_BLUR * side * side;
}

/* The last fit with the pattern's rim, which has a third of the edges; kept where paper is white around it. */
static status fit_rim(model *m, picture crop, double rim, const prior *before, double *theta, pixels *chosen,
                      memory *taken) {
    pixels wider;
    equations sums;
    double extent = m->extent;
    if (rim <= extent || !is_sharp(theta)) return DONE;
    m->extent = rim;
    status state = read_pixels(m, crop, theta, PIXELS, taken, &wider);
    m->extent = extent;
    if (state != DONE) return state;
    add_up(m, theta, chosen, before->used, &sums);
    double noise = greater(sums.squares / greater(sums.weight - PLAIN, 1), 1);
    fitted with_rim = fit(m, &wider, theta, before, LAST_FIT);
    if (!with_rim.converged || !(with_rim.theta[8] > 0) || with_rim.noise > WHITE_RIM * noise) return DONE;
    memcpy(theta, with_rim.theta, sizeof with_rim.theta);
    *chosen = wider;
    return DONE;
}

/* The last fit once more, with the rim, and its covariance (LIT, LIT), nan where too few pixels tell. */
EXPORT status finish_in_light(const uint8_t *gray, int64_t height, int64_t width, const double *center, double size,
                              const double *lines, int64_t line_count, const int64_t *index, int64_t rows, int64_t intervals,
                              const double *base, int64_t base_count, double extent, double rim, double focal,
                              double cut, double *theta, double *covariance) {
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .extent = extent};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    memory taken = {.count = 0};
    surroundings around;
    pixels chosen;
    equations sums;
    for (int k = 0; k < LIT * LIT; k++) covariance[k] = NAN;
    status state = set_surroundings(&around, gray, height, width, center, size, LEVEL_SIDE, true, &taken);
    if (state == DONE) {
        theta[0] -= (double)around.left, theta[1] -= (double)around.top;
        set_anchor(&m, center[0] - (double)around.left, center[1] - (double)around.top, size);
        state = read_pixels(&m, around.crop, theta, PIXELS, &taken, &chosen);
    }
    if (state == DONE && chosen.count >= MIN_PIXELS) {
        m.cut = cut;
        prior before = last_prior(&m, theta, size, focal);
        before.precision[10] = blur_precision(&m);
        state = fit_rim(&m, around.crop, rim, &before, theta, &chosen, &taken);
        add_up(&m, theta, &chosen, before.used, &sums);
        double noise = greater(sums.squares / greater(sums.weight - PLAIN, 1), 1.0 / 12);
        if (state == DONE) state = fill_sandwich(&m, &chosen, theta, weighed_by(&m, noise, theta[8]), before.precision, covariance, &taken);
    }
    if (state == DONE) theta[0] += (double)around.left, theta[1] += (double)around.top;
    give_back(&taken);
    return state;
}

EXPORT status lit_fit(const float *seen, int64_t n, const int32_t *xy, const double *start, const double *anchor,
                      const double *lines, int64_t line_count, const int64_t *index, int64_t rows, int64_t intervals,
                      const double *base, int64_t base_count, const double *mean, const double *precision,
                      int64_t steps, double enough, double *theta, double *noise, bool *converged) {
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .anchor = {anchor[0], anchor[1], anchor[2]}};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    prior before;
    memcpy(before.mean, mean, sizeof before.mean);
    memcpy(before.precision, precision, sizeof before.precision);
    use_free(&before);
    fitted result = fit(&m, &(pixels){xy, seen, n}, start, &before, (patience){steps, 1.0, enough, 0});
    memcpy(theta, result.theta, sizeof result.theta);
    *noise = result.noise, *converged = result.converged;
    return DONE;
}
