/* Serves peakmark/refine/align.py. */

#include <math.h>
#include "elementary.h"
#include "lanes.h"
#include "linear.h"
#include "refine_align.h"

/* As align.py explains. */
enum { SOFT_PIXELS = 250, GROUP = 24, ROUND_GROUP = 4, MOST_GROUPS = 64, BEST_GROUPS = 3 };
static const double MIN_BLUR = 1e-3, RIDGE = 1e-9, CLEAR = 0.01, PERFECT = 1e-4, NOISE_FLOOR = 1.0 / 12;
static const double CENTER_SPREAD = 0.1, SHAPE_SPREAD = 0.25, SOFT_TONE_SPREAD = 0.15;
static const double SOFTENED = 0.1406, TWICE_SOFTENED = 0.0748; /* shares of a pixel's variance that are left */

/* ---- the image around a position ---- */

EXPORT void block_means(const float *image, int64_t height, int64_t width, int64_t block, float *means, int64_t rows,
                        int64_t columns) {
    (void)height;
    float pixels_each = (float)(block * block);
    memset(means, 0, (size_t)(rows * columns) * sizeof *means);
    for (int64_t y = 0; y < rows * block; y++) {
        const float *from = image + y * width;
        float *to = means + y / block * columns;
        for (int64_t x = 0; x < columns; x++)
            for (int64_t i = 0; i < block; i++) to[x] += from[x * block + i];
    }
    for (int64_t i = 0; i < rows * columns; i++) means[i] /= pixels_each;
}

EXPORT void softened(const float *image, int64_t height, int64_t width, float *rows, float *result) {
    for (int64_t y = 0; y < height; y++) {
        const float *from = image + y * width;
        float *to = rows + y * width;
        for (int64_t x = 1; x < width - 1; x++) to[x] = (from[x - 1] + 2 * from[x] + from[x + 1]) / 4;
        to[0] = (from[0] + 2 * from[0] + from[least(1, width - 1)]) / 4;
        to[width - 1] = (from[most(width - 2, 0)] + 2 * from[width - 1] + from[width - 1]) / 4;
    }
    for (int64_t y = 0; y < height; y++) {
        const float *middle = rows + y * width, *above = rows + most(y - 1, 0) * width;
        const float *below = rows + least(y + 1, height - 1) * width;
        for (int64_t x = 0; x < width; x++) result[y * width + x] = (above[x] + 2 * middle[x] + below[x]) / 4;
    }
}

/* Softened by one filter, or an image without levels where memory runs out. */
picture softened_picture(picture image, memory *taken) {
    float *rows = take(taken, image.height * image.width, sizeof *rows);
    float *result = take(taken, image.height * image.width, sizeof *result);
    if (!rows || !result) return (picture){0};
    softened(image.levels, image.height, image.width, rows, result);
    return (picture){result, image.height, image.width};
}

bool is_too_small(const surroundings *around) { return least(around->level.height, around->level.width) < 4; }

static int64_t inside(double position, int64_t length) {
    return position < 0 ? 0 : position < (double)length ? (int64_t)position : length;
}

static picture cropped(const uint8_t *gray, int64_t width, int64_t left, int64_t top, int64_t right, int64_t bottom,
                       memory *taken) {
    picture crop = {NULL, most(0, bottom - top), most(0, right - left)};
    float *levels = take(taken, crop.height * crop.width, sizeof *levels);
    for (int64_t y = 0; levels && y < crop.height; y++)
        for (int64_t x = 0; x < crop.width; x++) levels[y * crop.width + x] = gray[(top + y) * width + left + x];
    crop.levels = levels;
    return crop;
}

static void add_row(const uint8_t *restrict row, int64_t n, uint32_t *restrict sums) {
    for (int64_t x = 0; x < n; x++) sums[x] += row[x];
}

/* The means of whole blocks from a corner of an image on, as `block_means` has them of a crop. */
static picture means_of(const uint8_t *gray, int64_t width, int64_t left, int64_t top, int64_t rows, int64_t columns,
                        int64_t block, memory *taken) {
    picture means = {NULL, rows, columns};
    float *levels = take(taken, rows * columns, sizeof *levels), each = (float)(block * block);
    uint32_t *sums = take(taken, columns * block, sizeof *sums);
    for (int64_t y = 0; levels && sums && y < rows; y++) {
        memset(sums, 0, (size_t)(columns * block) * sizeof *sums);
        for (int64_t i = 0; i < block; i++) add_row(gray + (top + y * block + i) * width + left, columns * block, sums);
        for (int64_t x = 0; x < columns; x++) {
            uint32_t sum = 0;
            for (int64_t i = 0; i < block; i++) sum += sums[x * block + i];
            levels[y * columns + x] = (float)sum / each;
        }
    }
    means.levels = sums ? levels : NULL;
    return means;
}

status set_surroundings(surroundings *around, const uint8_t *gray, int64_t height, int64_t width, const double *center,
                        double size, double level_side, bool has_crop, memory *taken) {
    double reach = 1.2 * size + 4;
    around->left = inside(center[0] - reach, width), around->top = inside(center[1] - reach, height);
    int64_t right = least(inside(center[0] + reach, width) + 1, width);
    int64_t bottom = least(inside(center[1] + reach, height) + 1, height);
    around->block = most(1, (int64_t)(size / level_side));
    int64_t rows = most(0, bottom - around->top) / around->block, columns = most(0, right - around->left) / around->block;
    around->crop = (picture){NULL, 0, 0};
    if (has_crop || around->block == 1)
        around->crop = around->level = cropped(gray, width, around->left, around->top, right, bottom, taken);
    if (around->block > 1)
        around->level = means_of(gray, width, around->left, around->top, rows, columns, around->block, taken);
    if (!around->level.levels || (has_crop && !around->crop.levels)) return OUT_OF_MEMORY;
    if (is_too_small(around)) return DONE;
    around->soft = softened_picture(around->level, taken);
    return around->soft.levels ? DONE : OUT_OF_MEMORY;
}

/* ---- coarse search over shapes ---- */

/* Levels at the samples under a shape, less one level, bilinear between pixels; outside the image its nearest pixel. */
void sample(const coarse *search, picture image, const double *center, const double *shape, double size, float level,
            float *values) {
    const float a = (float)(shape[0] * size), b = (float)(shape[1] * size), c = (float)(shape[2] * size);
    const float d = (float)(shape[3] * size), cx = (float)center[0], cy = (float)center[1];
    const float right = (float)image.width - 1.001f, bottom = (float)image.height - 1.001f;
    const int32_t width = (int32_t)image.width;
    int32_t at[MOST_SAMPLES];
    float fx[MOST_SAMPLES], fy[MOST_SAMPLES], above[2 * MOST_SAMPLES], below[2 * MOST_SAMPLES];
    for (int64_t i = 0; i < search->padded; i++) {
        float x = cx + a * search->u[i] + b * search->v[i], y = cy + c * search->u[i] + d * search->v[i];
        x = x > 0 ? x : 0, y = y > 0 ? y : 0;
        x = x < right ? x : right, y = y < bottom ? y : bottom;
        int32_t column = (int32_t)x, row = (int32_t)y;
        fx[i] = x - (float)column, fy[i] = y - (float)row;
        at[i] = row * width + column;
    }
    for (int64_t i = 0; i < search->padded; i++) {
        const float *from = image.levels + at[i];
        memcpy(above + 2 * i, from, 2 * sizeof *from), memcpy(below + 2 * i, from + width, 2 * sizeof *from);
    }
    for (int64_t i = 0; i < search->padded; i++) {
        float upper = above[2 * i] + fx[i] * (above[2 * i + 1] - above[2 * i]);
        float lower = below[2 * i] + fx[i] * (below[2 * i + 1] - below[2 * i]);
        values[i] = (upper + fy[i] * (lower - upper) - level) * search->used[i];
    }
}

static double correlation(const coarse *search, const float *values) {
    float8 total = {0}, squares = {0}, product = {0}, along = {0}, down = {0};
    for (int64_t i = 0; i < search->padded; i += 8) {
        float8 value = load8(values + i);
        total += value, squares += value * value, product += value * load8(search->expected + i);
        along += value * load8(search->u + i), down += value * load8(search->v + i);
    }
    double sum = sum8(total), x = sum8(along), y = sum8(down), variance = sum8(squares) - sum * sum / search->count;
    if (search->has_plane) variance -= (x * x + y * y) / search->spread;
    return sum8(product) / sqrt(greater(variance, search->has_plane ? 1e-6 : 1e-9));
}

status set_coarse(coarse *search, const double *samples, const double *expected, int64_t count, const double *shapes,
                  int64_t shape_count, bool has_plane) {
    if (count > MOST_SAMPLES || shape_count < 1) return TOO_LARGE;
    *search = (coarse){.padded = (count + 7) / 8 * 8, .count = (double)count, .shapes = shapes,
                       .shape_count = shape_count, .has_plane = has_plane, .score = correlation};
    if (has_plane) search->group = shape_count % GROUP == 0 ? GROUP : shape_count % ROUND_GROUP == 0 ? ROUND_GROUP : 0;
    for (int64_t i = 0; i < count; i++) {
        search->u[i] = (float)samples[2 * i], search->v[i] = (float)samples[2 * i + 1];
        search->expected[i] = (float)expected[i], search->used[i] = 1;
        search->spread += samples[2 * i] * samples[2 * i];
    }
    return DONE;
}

/* The best of some shapes so far. */
typedef struct {
    int64_t shape;
    double score;
} best_of;

static best_of better(const coarse *search, picture image, const double *center, double size, float level, int64_t shape,
                      best_of best) {
    float values[MOST_SAMPLES];
    sample(search, image, center, search->shapes + 4 * shape, size, level, values);
    double score = search->score(search, values);
    return score > best.score ? (best_of){shape, score} : best;
}

/* Of each group every other size of every third rotation is tried, then all shapes of the best groups. */
static best_of best_in_groups(const coarse *search, picture image, const double *center, double size, float level,
                              int64_t first, int64_t count) {
    best_of groups[MOST_GROUPS], best = {first, -INFINITY};
    int64_t group_count = least(count / search->group, MOST_GROUPS);
    for (int64_t g = 0; g < group_count; g++) {
        groups[g] = best;
        for (int64_t k = 1; k < search->group; k += k % 2 ? 1 : 11) /* 1, 2; 13, 14: see shape_grid */
            groups[g] = better(search, image, center, size, level, first + g * search->group + k, groups[g]);
    }
    for (int n = 0; n < BEST_GROUPS && n < group_count; n++) {
        int64_t g = 0;
        for (int64_t k = 1; k < group_count; k++)
            if (groups[k].score > groups[g].score) g = k;
        groups[g].score = -INFINITY;
        for (int64_t k = 0; k < search->group; k++)
            best = better(search, image, center, size, level, first + g * search->group + k, best);
    }
    return best;
}

/* The shape of `count` from `first` on whose view of the pattern correlates best with the image, and that correlation. */
int64_t best_shape(const coarse *search, picture image, const double *center, double size, int64_t first, int64_t count,
                   double *score) {
    int64_t x = inside(center[0], image.width - 1), y = inside(center[1], image.height - 1);
    float level = image.levels[y * image.width + x];
    best_of best = {first, -INFINITY};
    if (search->group > 0 && count > search->group)
        best = best_in_groups(search, image, center, size, level, first, count);
    else
        for (int64_t k = first; k < first + count; k++) best = better(search, image, center, size, level, k, best);
    *score = best.score;
    return best.shape;
}

/* ---- Levenberg–Marquardt ---- */

/* The equations of the parameters that are used: those of others say that they stay. */
typedef struct {
    int64_t count, listed[LIT], blur;
    double hessian[LIT * LIT], slope[LIT];
} system_used;

static system_used used_part(const double *hessian, const double *slope, int64_t n, const bool *used) {
    system_used part = {.count = 0, .blur = -1};
    for (int64_t k = 0; k < n; k++) {
        if (used[k] && k == 10) part.blur = part.count;
        if (used[k]) part.listed[part.count++] = k;
    }
    for (int64_t a = 0; a < part.count; a++) {
        part.slope[a] = slope[part.listed[a]];
        for (int64_t b = 0; b < part.count; b++) part.hessian[a * part.count + b] = hessian[part.listed[a] * n + part.listed[b]];
    }
    return part;
}

/* Fill in the step of a damped Newton iteration, with the blur held at its least, and return its length in σ². */
static double damped_step(const double *hessian, const double *slope, int64_t n, const bool *used, double blur, double *step) {
    system_used part = used_part(hessian, slope, n, used), own = part;
    int64_t count = part.count;
    if (!solve(own.hessian, count, own.slope, 1)) own.slope[0] = NAN;
    bool is_bounded = part.blur >= 0 && blur + own.slope[part.blur] < MIN_BLUR;
    if (is_bounded) {
        own = part;
        own.hessian[part.blur * count + part.blur] += HELD;
        own.slope[part.blur] = HELD * (MIN_BLUR - blur);
        if (!solve(own.hessian, count, own.slope, 1)) own.slope[0] = NAN;
    }
    double length = 0;
    for (int64_t k = 0; k < n; k++) step[k] = 0;
    for (int64_t a = 0; a < count; a++) {
        step[part.listed[a]] = own.slope[a];
        length += is_bounded && a == part.blur ? 0 : own.slope[a] * part.slope[a];
    }
    return length;
}

/* The posterior's slope at θ, and its Hessian damped; false where the slope is not finite. */
static bool posterior(const equations *sums, const double *theta, const prior *before, int64_t n, double noise,
                      double damping, double *slope, double *hessian) {
    bool is_finite = true;
    for (int64_t k = 0; k < n; k++) {
        slope[k] = before->used[k] ? sums->slope[k] / noise + before->precision[k] * (before->mean[k] - theta[k]) : 0;
        is_finite = is_finite && isfinite(slope[k]);
        for (int64_t j = 0; j < n; j++)
            hessian[k * n + j] = before->used[k] && before->used[j] ? sums->hessian[k * n + j] / noise : 0;
        hessian[k * n + k] = (hessian[k * n + k] + before->precision[k]) * (1 + damping) + RIDGE;
    }
    return is_finite;
}

static double noise_of(const equations *sums) {
    return greater(sums->squares / greater(sums->weight - PLAIN, 1), NOISE_FLOOR);
}

/* Let blur along a direction leave blur across it. */
static void bound_blur(double *theta) {
    double most_apart = greater(theta[10] - MIN_BLUR, 0), apart = sqrt(theta[16] * theta[16] + theta[17] * theta[17]);
    if (apart > most_apart) theta[16] *= most_apart / apart, theta[17] *= most_apart / apart;
}

/* Whether a step of four times what the last one promised would leave the noise above a goal. A step of length² σ² gains half
   of it in log likelihood. */
static bool is_in_vain(const fitted *result, int64_t count, double goal) {
    return goal > 0 && (double)count / 2 * same_log(result->noise / goal) > 4 * result->length / 2;
}

/* Damping up to which a step's length tells how far the end is; a DoG's size, contrast and blur lie along a bent valley. */
static const double FREE_DAMPING = 2e-3;

static double penalty(const double *theta, const prior *before, int64_t n) {
    double sum = 0;
    for (int64_t k = 0; k < n; k++)
        if (before->used[k]) sum += before->precision[k] * (theta[k] - before->mean[k]) * (theta[k] - before->mean[k]);
    return sum;
}

/* Whether a step is taken: of a pattern without edges, whose derivatives are whole, one that gains. */
static bool is_taken(const model *m, const double *theta, const equations *here, const double *trial, const equations *there,
                     const prior *before, double noise) {
    if (!is_graded(m)) return there->squares <= 1.2 * here->squares;
    double gain = (here->squares - there->squares) / noise;
    return gain + penalty(theta, before, m->parameters) - penalty(trial, before, m->parameters) >= -1e-3;
}

/* Solve Jᵀr / noise = precision (θ − mean), the noise being the residuals' own mean square; see gauss_newton. */
fitted fit(model *m, const pixels *chosen, const double *start, const prior *before, patience limits) {
    int64_t n = m->parameters;
    fitted result = {.length = INFINITY};
    memcpy(result.theta, start, (size_t)n * sizeof *start);
    if (chosen->count < MIN_PIXELS) return result;
    equations here, there;
    double damping = 1e-3, factor = is_graded(m) ? 10 : 30, slope[LIT], hessian[LIT * LIT], step[LIT], trial[LIT];
    add_up(m, result.theta, chosen, before->used, &here);
    result.noise = noise_of(&here);
    for (int64_t i = 0; i < limits.steps; i++) {
        double noise = weighed_by(m, result.noise, result.theta[8]);
        if (!posterior(&here, result.theta, before, n, noise, damping, slope, hessian)) {
            result.converged = false;
            return result;
        }
        double length = damped_step(hessian, slope, n, before->used, result.theta[10], step);
        for (int64_t k = 0; k < n; k++) trial[k] = result.theta[k] + step[k];
        if (n == LIT) bound_blur(trial);
        add_up(m, trial, chosen, before->used, &there);
        result.converged = false;
        if (!is_taken(m, result.theta, &here, trial, &there, before, noise)) {
            damping *= factor;
            continue;
        }
        memcpy(result.theta, trial, sizeof trial);
        here = there;
        result.noise = noise_of(&here);
        bool is_held_back = is_graded(m) && damping > FREE_DAMPING;
        damping /= factor;
        result.share = here.weight / (double)chosen->count;
        result.length = length;
        result.converged = length < limits.converged && !is_held_back;
        if (length < limits.enough && !is_held_back) break;
        if (is_in_vain(&result, chosen->count, limits.goal)) {
            result.converged = false;
            break;
        }
    }
    /* clean edges make every step from a perfect fit look wrong */
    if ((n == LIT || m->is_round) && result.noise < PERFECT * result.theta[8] * result.theta[8]) result.converged = true;
    return result;
}

/* Choose pixels of an image and read their levels, with room that the caller gives back. */
status read_pixels(const model *m, picture image, const double *theta, int64_t wanted, memory *taken, pixels *chosen) {
    int64_t room = pixels_around(m, theta, image.height, image.width);
    int32_t *xy = take(taken, 2 * room, sizeof *xy);
    bool *near = take(taken, room, sizeof *near);
    if (!xy || !near) return OUT_OF_MEMORY;
    int64_t count = choose_pixels(m, theta, image.height, image.width, wanted, xy, near);
    float *levels = take(taken, count, sizeof *levels);
    if (!levels) return OUT_OF_MEMORY;
    for (int64_t i = 0; i < count; i++) levels[i] = image.levels[xy[2 * i + 1] * image.width + xy[2 * i]];
    *chosen = (pixels){xy, levels, count};
    return DONE;
}

/* Fit the pattern to the pixels that are worth comparing, at most about `wanted`; with too few the noise is 0. */
status fit_picture(model *m, picture image, const double *start, int64_t wanted, const prior *before, patience limits,
                   fitted *result) {
    memory taken = {.count = 0};
    pixels chosen;
    status state = read_pixels(m, image, start, wanted, &taken, &chosen);
    if (state == DONE) *result = fit(m, &chosen, start, before, limits);
    give_back(&taken);
    return state;
}

/* ---- the first fit, to the softened image ---- */

static void set_shape(double *theta, const double *shape, double size, int third) {
    double sine, cosine;
    same_sincos(third * PI / 6, &sine, &cosine);
    double c = size * cosine, s = size * sine;
    theta[2] = shape[0] * c + shape[1] * s, theta[3] = shape[1] * c - shape[0] * s;
    theta[4] = shape[2] * c + shape[3] * s, theta[5] = shape[3] * c - shape[2] * s;
}

/* A fit from one start: to the softened image, or where that leaves too few pixels to the sharp one. */
static status fit_start(model *m, picture soft, picture level, double blur, double *start, prior *before,
                        fitted *result) {
    const patience limits = {12, m->parameters == LIT ? 1.0 : 0.3, 0.3, 0};
    const picture images[2] = {soft, level};
    for (int k = 0; k < 2; k++) {
        start[10] = k ? SHARP : blur;
        memcpy(before->mean, start, LIT * sizeof *start);
        m->is_soft = k == 0 && m->parameters == LIT;
        status state = fit_picture(m, images[k], start, SOFT_PIXELS, before, limits, result);
        m->is_soft = false;
        if (state != DONE || result->noise > 0) return state;
    }
    return DONE;
}

static void set_light(picture image, double *theta) {
    float low = image.levels[0], high = image.levels[0];
    for (int64_t i = 1; i < image.height * image.width; i++) {
        low = image.levels[i] < low ? image.levels[i] : low;
        high = image.levels[i] > high ? image.levels[i] : high;
    }
    theta[8] = high - low, theta[9] = low;
}

/* Find the best fit to the softened image, and its noise over gain²; see soft_fit. */
status fit_softly(model *m, const surroundings *around, const double *center, double size, const coarse *search,
                  const prior *before, double sigma, double hopeless, fitted *best, double *ratio, memory *taken) {
    bool is_lit = m->parameters == LIT;
    bool is_large = size > LEVEL_SIDE;
    picture soft = is_large ? softened_picture(around->soft, taken) : around->soft;
    if (!soft.levels) return OUT_OF_MEMORY;
    prior here = *before;
    double start[LIT] = {center[0], center[1]}, score;
    set_light(soft, start);
    here.precision[0] = here.precision[1] = 1 / (CENTER_SPREAD * size * CENTER_SPREAD * size);
    for (int k = 2; k < 6; k++) here.precision[k] = 1 / (SHAPE_SPREAD * size * SHAPE_SPREAD * size);
    hold_turn(m, &here);
    start[15] = before->mean[15];
    if (is_lit) here.precision[15] = 1 / (SOFT_TONE_SPREAD * SOFT_TONE_SPREAD);
    double expected = sigma * sigma * (is_large ? TWICE_SOFTENED : SOFTENED) / (double)(around->block * around->block);
    *best = (fitted){.length = INFINITY};
    memcpy(best->theta, start, sizeof start);
    *ratio = INFINITY;
    for (int64_t part = 1; part <= 3; part += 2) {
        int64_t shape = best_shape(search, soft, center, size, 0, search->shape_count / part, &score);
        for (int third = 0; third < (m->is_round ? 1 : 3) && !(is_lit && *ratio < CLEAR); third++) {
            fitted result;
            set_shape(start, search->shapes + 4 * shape, size, third);
            status state = fit_start(m, soft, around->level, is_large ? 1.0 : 0.5, start, &here, &result);
            if (state != DONE) return state;
            double left = greater(result.noise - expected, 0) / (result.theta[8] * result.theta[8]);
            if (result.noise > 0 && result.theta[8] > 0 && left < *ratio) *best = result, *ratio = left;
        }
        if (*ratio < CLEAR || *ratio > hopeless) break;
    }
    return DONE;
}

/* ---- in even light ---- */

static void use_all(prior *before) {
    for (int k = 0; k < LIT; k++) before->used[k] = true;
}

/* Write out (n, n) = a b of square matrices. */
static void multiply(const double *a, const double *b, int64_t n, double *out) {
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            double sum = 0;
            for (int64_t k = 0; k < n; k++) sum += a[i * n + k] * b[k * n + j];
            out[i * n + j] = sum;
        }
}

/* A pixel's own share in its residual is at least so much: those that a cut lets count little would have less than none. */
static const double LEAST_LEFT = 0.1;

/* Add e² j jᵀ of some pixels to the middle (n, n), e being a pixel's residual from a fit without it, over the noise. */
static void add_squares(const double *r, const double *jacobian, int64_t stride, int64_t count, const double *inverse, int64_t n,
                        double noise, double *middle) {
    double leverage[TILE] = {0}, weight[TILE] = {0}, sums[TILE], scaled[LIT][TILE] = {{0}};
    for (int64_t a = 0; a < n; a++) {
        const double *row = jacobian + a * stride;
        for (int64_t i = 0; i < count; i++) sums[i] = inverse[a * n + a] * row[i] / 2;
        for (int64_t b = 0; b < a; b++)
            for (int64_t i = 0; i < count; i++) sums[i] += inverse[a * n + b] * jacobian[b * stride + i];
        for (int64_t i = 0; i < count; i++) leverage[i] += 2 * row[i] * sums[i];
    }
    for (int64_t i = 0; i < count; i++) weight[i] = r[i] / sqrt(greater(1 - leverage[i] / noise, LEAST_LEFT)) / noise;
    for (int64_t a = 0; a < n; a++)
        for (int64_t i = 0; i < count; i++) scaled[a][i] = weight[i] * jacobian[a * stride + i];
    for (int64_t a = 0; a < n; a++)
        for (int64_t b = 0; b <= a; b++) {
            double4 lanes = {0};
            for (int64_t i = 0; i < TILE; i += 4) lanes += load4(scaled[a] + i) * load4(scaled[b] + i);
            middle[a * n + b] += sum4(lanes);
            if (a != b) middle[b * n + a] = middle[a * n + b];
        }
}

/* The covariance (n, n) of fitted parameters, see `sandwich` in align.py; where the pixels do not tell it, it stays. */
status fill_sandwich(model *m, const pixels *chosen, const double *theta, double noise, const double *precision,
                     double *covariance, memory *taken) {
    int64_t count = chosen->count, n = m->parameters;
    equations sums;
    prior everything;
    double hessian[LIT * LIT], inverse[LIT * LIT] = {0}, middle[LIT * LIT] = {0}, half[LIT * LIT];
    double *r = take(taken, count, sizeof *r), *jacobian = take(taken, n * count, sizeof *jacobian);
    if (!r || !jacobian) return OUT_OF_MEMORY;
    use_all(&everything);
    add_up(m, theta, chosen, everything.used, &sums);
    compare_all(m, theta, chosen, r, jacobian);
    for (int64_t k = 0; k < n * n; k++) hessian[k] = sums.hessian[k] / noise;
    for (int64_t k = 0; k < n; k++) hessian[k * n + k] += precision[k] + RIDGE, inverse[k * n + k] = 1;
    if (!solve(hessian, n, inverse, n)) return DONE;
    for (int64_t first = 0; first < count; first += TILE)
        add_squares(r + first, jacobian + first, count, least(TILE, count - first), inverse, n, noise, middle);
    for (int64_t k = 0; k < n; k++) middle[k * n + k] += precision[k];
    multiply(inverse, middle, n, half);
    multiply(half, inverse, n, covariance);
    return DONE;
}

/* From the softened block means over the sharp ones to the image's own pixels, in `result`, with its covariance. */
static status align_plainly(model *m, const surroundings *around, const double *center, double size, double focal,
                            const coarse *search, fitted *result, double *covariance, memory *taken) {
    double block = (double)around->block, ratio, precision = (focal / size) * (focal / size);
    const double local[2] = {(center[0] - (double)around->left - (block - 1) / 2) / block,
                             (center[1] - (double)around->top - (block - 1) / 2) / block};
    prior before = {.precision = {[6] = precision, [7] = precision, [10] = HELD}};
    use_all(&before);
    hold_turn(m, &before);
    status state = fit_softly(m, around, local, size / block, search, &before, 0, INFINITY, result, &ratio, taken);
    before.mean[10] = result->theta[10] = SHARP;
    if (state == DONE && around->block > 1)
        state = fit_picture(m, around->level, result->theta, BLOCK_PIXELS, &before, (patience){8, 1.0, 1.0, 0}, result);
    if (state != DONE) return state;
    for (int k = 0; k < 2; k++) result->theta[k] = block * result->theta[k] + (block - 1) / 2;
    for (int k = 2; k < 6; k++) result->theta[k] *= block;
    before.precision[10] = blur_precision(m);
    pixels chosen;
    state = read_pixels(m, around->crop, result->theta, PIXELS, taken, &chosen);
    if (state != DONE) return state;
    /* a DoG's size, contrast and blur are hard to tell apart */
    *result = fit(m, &chosen, result->theta, &before, is_graded(m) ? (patience){100, 1.0, 1e-2, 0} : (patience){15, 1e-2, 1e-2, 0});
    if (!result->converged) return DONE;
    double noise = weighed_by(m, result->noise, result->theta[8]);
    return fill_sandwich(m, &chosen, result->theta, noise, before.precision, covariance, taken);
}

EXPORT status align(const uint8_t *gray, int64_t height, int64_t width, const double *center, double size,
                    const double *lines, int64_t line_count, const double *levels, int64_t rows, int64_t intervals, double extent,
                    double focal, const double *samples, int64_t sample_count, const double *expected,
                    const double *shapes, int64_t shape_count, double *theta, double *covariance, double *noise,
                    bool *converged) {
    memory taken = {.count = 0};
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .levels = levels, .extent = extent};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    coarse search;
    surroundings around;
    fitted result = {.length = INFINITY};
    for (int k = 0; k < PLAIN * PLAIN; k++) covariance[k] = NAN;
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, false);
    if (state == DONE) state = set_surroundings(&around, gray, height, width, center, size, LEVEL_SIDE, true, &taken);
    bool is_tried = state == DONE && !is_too_small(&around);
    if (is_tried) state = align_plainly(&m, &around, center, size, focal, &search, &result, covariance, &taken);
    give_back(&taken);
    if (is_tried) result.theta[0] += (double)around.left, result.theta[1] += (double)around.top;
    memcpy(theta, result.theta, PLAIN * sizeof *theta);
    *noise = result.noise, *converged = result.converged;
    return state;
}

/* ---- the steps by themselves ---- */

EXPORT status chosen_pixels(const double *theta, const double *lines, int64_t line_count, double extent, int64_t height,
                            int64_t width, int64_t wanted, int32_t *xy, int64_t room, bool *near, int64_t *count) {
    (void)room;
    if (line_count > MOST_LINES) return TOO_LARGE;
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .extent = extent};
    *count = choose_pixels(&m, theta, height, width, wanted, xy, near);
    return DONE;
}

EXPORT status coarse_shape(const float *image, int64_t height, int64_t width, const double *center, double size,
                           const double *samples, int64_t sample_count, const double *expected, const double *shapes,
                           int64_t shape_count, int64_t *best) {
    coarse search;
    double score;
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, false);
    if (state == DONE) *best = best_shape(&search, (picture){image, height, width}, center, size, 0, shape_count, &score);
    return state;
}

EXPORT status gauss_newton(const float *seen, int64_t n, const int32_t *xy, const double *start, const double *lines,
                           int64_t line_count, const double *levels, int64_t rows, int64_t intervals, const double *mean,
                           const double *precision, int64_t steps, double done, double *theta, double *noise,
                           bool *converged) {
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .levels = levels};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    prior before = {.mean = {0}};
    memcpy(before.mean, mean, PLAIN * sizeof *mean);
    memcpy(before.precision, precision, PLAIN * sizeof *precision);
    use_all(&before);
    fitted result = fit(&m, &(pixels){xy, seen, n}, start, &before, (patience){steps, done, done, 0});
    memcpy(theta, result.theta, PLAIN * sizeof *theta);
    *noise = result.noise, *converged = result.converged;
    return DONE;
}

EXPORT status sandwich(const float *seen, int64_t n, const int32_t *xy, const double *theta, const double *lines,
                       int64_t line_count, const double *levels, int64_t rows, int64_t intervals, double noise, const double *precision,
                       double *covariance) {
    memory taken = {.count = 0};
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .levels = levels};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    status state = fill_sandwich(&m, &(pixels){xy, seen, n}, theta, noise, precision, covariance, &taken);
    give_back(&taken);
    return state;
}

EXPORT status soft_fit(const float *image, int64_t height, int64_t width, const double *center, double size,
                       const double *lines, int64_t line_count, const double *levels, int64_t rows, int64_t intervals, double extent,
                       const double *precision, const double *samples, int64_t sample_count, const double *expected,
                       const double *shapes, int64_t shape_count, double *theta) {
    memory taken = {.count = 0};
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .levels = levels, .extent = extent};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    picture level = {image, height, width};
    surroundings around = {level, level, softened_picture(level, &taken), 0, 0, 1};
    coarse search;
    prior before = {.mean = {0}};
    fitted result = {.length = INFINITY};
    double ratio;
    memcpy(before.precision, precision, PLAIN * sizeof *precision);
    use_all(&before);
    status state = set_coarse(&search, samples, expected, sample_count, shapes, shape_count, false);
    if (state == DONE && !around.soft.levels) state = OUT_OF_MEMORY;
    if (state == DONE) state = fit_softly(&m, &around, center, size, &search, &before, 0, INFINITY, &result, &ratio, &taken);
    give_back(&taken);
    memcpy(theta, result.theta, PLAIN * sizeof *theta);
    return state;
}
