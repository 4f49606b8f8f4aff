/* Serves peakmark/refine/model.py, and lit.py with it. */

#include <math.h>
#include "elementary.h"
#include "lanes.h"
#include "refine_model.h"

static const double PIXEL_VARIANCE = 1.0 / 12, MIN_BLUR = 1e-3, REACH = 3.5, MIN_DEPTH = 0.05, DENSITY = 0.39894228040143267794;
static const float CLIPPED = 253.5f; /* grey level from which a pixel counts as white */

/* Φ(z) = ½ + φ(z) (z + z³/3 + z⁵/(3·5) + …): no term has another sign. */
static double normal(double z) {
    double term = z, sum = z;
    for (double k = 3; fabs(term) > 1e-17 * fabs(sum); k += 2) sum += term *= z * z / k;
    return 0.5 + DENSITY * same_exp(-0.5 * z * z) * sum;
}

EXPORT void normal_distribution(const double *z, int64_t n, double *values) {
    for (int64_t i = 0; i < n; i++) values[i] = z[i] > 8.5 ? 1 : z[i] > -8.5 ? normal(z[i]) : 0;
}

typedef struct {
    int64_t left, top, right, bottom;
} bounds;

/* The pixels around the pattern's extent, inside the image. */
static bounds pixel_bounds(const double *theta, double extent, int64_t width, int64_t height) {
    double x_low = 1e9, y_low = 1e9, x_high = -1e9, y_high = -1e9;
    for (int k = 0; k < 4; k++) {
        double u = k % 2 ? extent : -extent, v = k / 2 ? extent : -extent;
        double w = greater(1 + theta[6] * u + theta[7] * v, MIN_DEPTH);
        double x = theta[0] + (theta[2] * u + theta[3] * v) / w, y = theta[1] + (theta[4] * u + theta[5] * v) / w;
        x_low = lesser(x, x_low), x_high = greater(x, x_high);
        y_low = lesser(y, y_low), y_high = greater(y, y_high);
    }
    return (bounds){
        (int64_t)lesser(greater(floor(x_low), 0), (double)width),
        (int64_t)lesser(greater(floor(y_low), 0), (double)height),
        (int64_t)greater(lesser(floor(x_high) + 2, (double)width), 0),
        (int64_t)greater(lesser(floor(y_high) + 2, (double)height), 0),
    };
}

static int64_t area(bounds b) { return most(0, b.right - b.left) * most(0, b.bottom - b.top); }

int64_t pixels_around(const model *m, const double *theta, int64_t height, int64_t width) {
    return area(pixel_bounds(theta, m->extent, width, height));
}

/* Whether a pixel is inside the extent: 0 no, 1 yes, 2 yes and within reach of a line. */
static int worth(const model *m, const double *theta, double reach, double x, double y) {
    pattern_view at = pattern_point(theta, x, y);
    double reach_u = reach * sqrt(at.ux * at.ux + at.uy * at.uy), reach_v = reach * sqrt(at.vx * at.vx + at.vy * at.vy);
    if (at.w <= MIN_DEPTH || fabs(at.u) > m->extent - reach_u || fabs(at.v) > m->extent - reach_v) return 0;
    for (int64_t k = 0; k < m->line_count; k++)
        if (fabs(at.u - m->lines[k]) < 1.4 * reach_u || fabs(at.v - m->lines[k]) < 1.4 * reach_v) return 2;
    return 1;
}

/* Pixels within reach of a line lie on every stride-th diagonal; others tell gain and offset, on a grid 4 times as wide. */
static bool is_taken(int64_t x, int64_t y, bool near, int64_t stride) {
    return near ? (x + y) % stride == 0 : x % (4 * stride) == 0 && y % (4 * stride) == 0;
}

static int64_t select_from(const model *m, const double *theta, int64_t height, int64_t width, int64_t stride,
                           int32_t *xy, bool *near) {
    bounds b = pixel_bounds(theta, m->extent, width, height);
    double reach = 2.5 * sqrt(PIXEL_VARIANCE + theta[10]);
    int64_t count = 0;
    for (int64_t y = b.top; y < b.bottom; y++)
        for (int64_t x = b.left; x < b.right; x++) {
            int kind = worth(m, theta, reach, (double)x, (double)y);
            if (!kind || !is_taken(x, y, kind == 2, stride)) continue;
            xy[2 * count] = (int32_t)x, xy[2 * count + 1] = (int32_t)y;
            near[count++] = kind == 2;
        }
    return count;
}

/* Fill in at most about `wanted` pixels that are worth comparing, of room for `pixels_around`; return how many. */
int64_t choose_pixels(const model *m, const double *theta, int64_t height, int64_t width, int64_t wanted, int32_t *xy,
                      bool *near) {
    int64_t count = select_from(m, theta, height, width, 1, xy, near);
    int64_t stride = (count + wanted - 1) / wanted;
    if (stride <= 1) return count;
    int64_t kept = 0;
    for (int64_t i = 0; i < count; i++)
        if (is_taken(xy[2 * i], xy[2 * i + 1], near[i], stride)) {
            xy[2 * kept] = xy[2 * i], xy[2 * kept + 1] = xy[2 * i + 1];
            near[kept++] = near[i];
        }
    return kept;
}

EXPORT int64_t bounded_area(const double *theta, double extent, int64_t height, int64_t width) {
    return area(pixel_bounds(theta, extent, width, height));
}

EXPORT int64_t select_pixels(const double *theta, const double *lines, int64_t line_count, double extent, int64_t height,
                             int64_t width, int64_t stride, int32_t *xy, int64_t room, bool *near) {
    (void)room;
    model m = {.lines = lines, .line_count = line_count, .extent = extent};
    return select_from(&m, theta, height, width, stride, xy, near);
}

/* How the printed levels show under the tone exponent, and the derivatives by its logarithm. */
void prepare(model *m, const double *theta) {
    if (m->parameters == PLAIN) return;
    int64_t cells = (m->line_count + 1) * (m->line_count + 1);
    double exponent = same_exp(theta[15]), shown[MOST_LINES + 1], slopes[MOST_LINES + 1];
    for (int64_t k = 0; k < m->base_count; k++) {
        bool is_black_or_white = m->base[k] <= 0.0 || m->base[k] >= 1.0;
        shown[k] = is_black_or_white ? m->base[k] : same_pow(m->base[k], exponent);
        slopes[k] = is_black_or_white ? 0.0 : shown[k] * same_log(m->base[k]) * exponent;
    }
    for (int64_t k = 0; k < cells; k++) {
        m->fitted[k] = shown[m->index[k]];
        m->tones[k] = slopes[m->index[k]];
    }
    m->levels = m->fitted;
}

/* Pixels of a tile, as columns: where each looks, and along either axis its box, its Gaussian, and how far they reach. */
typedef struct {
    double width[TILE], sigma[TILE], reach[TILE];
} axis_columns;

typedef struct {
    double x[TILE], y[TILE], u[TILE], v[TILE], w[TILE], ux[TILE], uy[TILE], vx[TILE], vy[TILE];
    axis_columns across, down;
} view_columns;

/* One axis of a pixel: the lines that it sees, the box and the Gaussian of its own, and where its steps are kept. */
typedef struct {
    int64_t first, last, at;
    double width, sigma;
} axis_view;

/* The smoothed steps of a tile: a box's two ends each line, in σ, and the normal distribution and density there. */
typedef struct {
    int64_t count;
    double ends[TILE * 2 * MOST_LINES * 2], steps[TILE * 2 * MOST_LINES * 2], densities[TILE * 2 * MOST_LINES * 2];
} step_table;

/* The wider of the two boxes is kept, the other's variance joins the Gaussian's: that is θ[10] in every direction, and in any
   light more along one than across it. */
static void fill_axis(const model *m, const double *theta, const double *by_x, const double *by_y, axis_columns *axis) {
    bool is_lit = m->parameters == LIT;
    double blur = theta[10], d = is_lit ? theta[16] : 0, e = is_lit ? theta[17] : 0, least_blur = is_lit ? MIN_BLUR : 0;
    for (int64_t i = 0; i < TILE; i++) {
        double a = fabs(by_x[i]), b = fabs(by_y[i]), width = a > b ? a : b, other = a > b ? b : a;
        double square = by_x[i] * by_x[i] + by_y[i] * by_y[i];
        double own_blur = blur * square + d * (by_x[i] * by_x[i] - by_y[i] * by_y[i]) + 2 * e * by_x[i] * by_y[i];
        own_blur = own_blur > least_blur * square ? own_blur : least_blur * square;
        double sigma = sqrt(other * other / 12 + own_blur);
        axis->width[i] = width, axis->sigma[i] = sigma;
        axis->reach[i] = width / 2 + REACH * sigma;
    }
}

/* Where the pixels of a tile look; beyond `count` the last one again. */
static void fill_views(const model *m, const double *theta, const int32_t *xy, int64_t count, view_columns *views) {
    for (int64_t i = 0; i < TILE; i++) {
        views->x[i] = xy[2 * least(i, count - 1)], views->y[i] = xy[2 * least(i, count - 1) + 1];
    }
    for (int64_t i = 0; i < TILE; i++) {
        pattern_view at = pattern_point(theta, views->x[i], views->y[i]);
        views->u[i] = at.u, views->v[i] = at.v, views->w[i] = at.w;
        views->ux[i] = at.ux, views->uy[i] = at.uy, views->vx[i] = at.vx, views->vy[i] = at.vy;
    }
    fill_axis(m, theta, views->ux, views->uy, &views->across);
    fill_axis(m, theta, views->vx, views->vy, &views->down);
}

/* List the steps that a pixel sees along an axis. */
static axis_view view_axis(const model *m, double u, const axis_columns *columns, int64_t i, step_table *table) {
    axis_view axis = {.width = columns->width[i], .sigma = columns->sigma[i], .at = table->count};
    double reach = columns->reach[i], per_sigma = 1 / axis.sigma;
    int64_t k = 0;
    while (k < m->line_count && u - m->lines[k] > reach) k++;
    axis.first = k;
    for (; k < m->line_count && m->lines[k] - u < reach; k++) {
        table->ends[table->count++] = (u - m->lines[k] + axis.width / 2) * per_sigma;
        table->ends[table->count++] = (u - m->lines[k] - axis.width / 2) * per_sigma;
    }
    axis.last = k;
    return axis;
}

/* The normal distribution and its density, within 1e-7 (Abramowitz & Stegun 26.2.17). */
static void fill_steps(step_table *table) {
    for (int64_t i = 0; i < table->count; i++) {
        double z = table->ends[i], density = DENSITY * same_exp(-0.5 * z * z), t = 1 / (1 + 0.2316419 * fabs(z));
        double tail = density * t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))));
        table->densities[i] = density;
        table->steps[i] = z > 0 ? 1 - tail : tail;
    }
}

typedef struct {
    double value[MOST_LINES + 1], slope[MOST_LINES + 1], bend[MOST_LINES + 1];
} share_table;

/* Each interval's share of what a pixel sees along an axis, with its first and second derivative; interval k ends at
   line k. */
static void fill_shares(const axis_view *axis, const step_table *table, share_table *shares) {
    double above = 1, above_slope = 0, above_bend = 0, per_width = 1 / axis->width, scale = axis->sigma * per_width;
    const double *ends = table->ends + axis->at, *steps = table->steps + axis->at, *density = table->densities + axis->at;
    for (int64_t k = axis->first; k < axis->last; k++, ends += 2, steps += 2, density += 2) {
        double step = (ends[0] * steps[0] + density[0] - ends[1] * steps[1] - density[1]) * scale;
        double slope = (steps[0] - steps[1]) * per_width, bend = (density[0] - density[1]) / (axis->sigma * axis->width);
        shares->value[k] = above - step, shares->slope[k] = above_slope - slope, shares->bend[k] = above_bend - bend;
        above = step, above_slope = slope, above_bend = bend;
    }
    shares->value[axis->last] = above, shares->slope[axis->last] = above_slope, shares->bend[axis->last] = above_bend;
}

/* What a pixel sees of the pattern, 0…1, with derivatives by u and v, twice by each, and by the tone. */
typedef struct {
    double level, by_u, by_v, by_uu, by_vv, by_tone;
} sight;

static sight look(const model *m, const axis_view *u, const axis_view *v, const step_table *table) {
    share_table across, down;
    fill_shares(u, table, &across);
    fill_shares(v, table, &down);
    sight seen = {0};
    for (int64_t row = v->first; row <= v->last; row++) {
        const double *levels = m->levels + row * (m->line_count + 1), *tones = m->tones + row * (m->line_count + 1);
        double value = 0, slope = 0, bend = 0, tone = 0;
        for (int64_t k = u->first; k <= u->last; k++) {
            value += levels[k] * across.value[k];
            slope += levels[k] * across.slope[k];
            bend += levels[k] * across.bend[k];
            if (m->parameters == LIT) tone += tones[k] * across.value[k];
        }
        seen.level += down.value[row] * value;
        seen.by_u += down.value[row] * slope;
        seen.by_v += down.slope[row] * value;
        seen.by_uu += down.value[row] * bend;
        seen.by_vv += down.bend[row] * value;
        seen.by_tone += down.value[row] * tone;
    }
    return seen;
}

static void leave_out(int64_t parameters, double residual, double *r, double *jacobian, int64_t stride) {
    *r = residual;
    for (int64_t k = 0; k < parameters; k++) jacobian[k * stride] = 0;
}

/* Write a pixel's residual, and the derivatives of its prediction; those by A and g leave out how they change the blur. */
static void compare(const model *m, const double *theta, const view_columns *views, int64_t i, const sight *seen,
                    float level, double *r, double *jacobian, int64_t stride) {
    double x = views->x[i], y = views->y[i];
    bool is_lit = m->parameters == LIT;
    double p = is_lit ? (x - m->anchor[0]) / m->anchor[2] : 0, q = is_lit ? (y - m->anchor[1]) / m->anchor[2] : 0;
    double light = is_lit ? 1 + theta[11] * p + theta[12] * q : 1, shade = is_lit ? theta[13] * p + theta[14] * q : 0;
    double gain = theta[8], value = theta[9] + gain * (light * seen->level + shade);
    if (is_lit && value >= CLIPPED && level >= CLIPPED) {
        leave_out(m->parameters, 0, r, jacobian, stride);
        return;
    }
    *r = level - value;
    /* (px, py) is the prediction's gradient in the image; ∂prediction/∂θ = −(px, py)·∂x/∂θ at fixed u */
    double ux = views->ux[i], uy = views->uy[i], vx = views->vx[i], vy = views->vy[i];
    double px = gain * light * (seen->by_u * ux + seen->by_v * vx), py = gain * light * (seen->by_u * uy + seen->by_v * vy);
    double along = px * (x - theta[0]) + py * (y - theta[1]), u = views->u[i] / views->w[i], v = views->v[i] / views->w[i];
    /* a pixel's blur along x, along y and between them, as each axis of the pattern has it */
    double half = gain * light / 2, xx = seen->by_uu * ux * ux + seen->by_vv * vx * vx;
    double yy = seen->by_uu * uy * uy + seen->by_vv * vy * vy, xy = seen->by_uu * ux * uy + seen->by_vv * vx * vy;
    const double by[LIT] = {-px, -py, -px * u, -px * v, -py * u, -py * v, along * u, along * v,
                            light * seen->level + shade, 1, half * (xx + yy),
                            gain * p * seen->level, gain * q * seen->level, gain * p, gain * q,
                            gain * light * seen->by_tone, half * (xx - yy), 2 * half * xy};
    for (int64_t k = 0; k < m->parameters; k++) jacobian[k * stride] = by[k];
}

/* Fill in image − prediction (count ≤ TILE) and the prediction's derivatives (parameters, stride); beyond the pattern's
   horizon 255 and 0, where image and prediction are both white 0 and 0. `prepare` comes before. */
void compare_tile(const model *m, const double *theta, const int32_t *xy, const float *levels, int64_t count, double *r,
                  double *jacobian, int64_t stride) {
    step_table table;
    view_columns views;
    axis_view across[TILE], down[TILE];
    table.count = 0;
    fill_views(m, theta, xy, count, &views);
    for (int64_t i = 0; i < count; i++) {
        if (views.w[i] <= MIN_DEPTH) continue;
        across[i] = view_axis(m, views.u[i], &views.across, i, &table);
        down[i] = view_axis(m, views.v[i], &views.down, i, &table);
    }
    fill_steps(&table);
    for (int64_t i = 0; i < count; i++) {
        if (views.w[i] <= MIN_DEPTH) {
            leave_out(m->parameters, 255, r + i, jacobian + i, stride);
            continue;
        }
        sight seen = look(m, across + i, down + i, &table);
        compare(m, theta, &views, i, &seen, levels[i], r + i, jacobian + i, stride);
    }
}

/* Add a tile's products of rows to their lanes: of each of the listed rows with those listed before it, and itself. */
static void add_products(const double rows[LIT + 1][TILE], const int64_t *listed, int64_t count,
                         double4 lanes[LIT + 1][LIT + 1]) {
    for (int64_t a = 0; a < count; a++) {
        const double *row = rows[listed[a]];
        double4 *sums = lanes[a];
        int64_t b = 0;
        for (; b + 4 <= a + 1; b += 4) { /* four at a time, for a row is read more slowly than multiplied */
            const double *b0 = rows[listed[b]], *b1 = rows[listed[b + 1]], *b2 = rows[listed[b + 2]], *b3 = rows[listed[b + 3]];
            double4 s0 = sums[b], s1 = sums[b + 1], s2 = sums[b + 2], s3 = sums[b + 3];
            for (int64_t i = 0; i < TILE; i += 4) {
                double4 value = load4(row + i);
                s0 += value * load4(b0 + i), s1 += value * load4(b1 + i);
                s2 += value * load4(b2 + i), s3 += value * load4(b3 + i);
            }
            sums[b] = s0, sums[b + 1] = s1, sums[b + 2] = s2, sums[b + 3] = s3;
        }
        for (; b <= a; b++)
            for (int64_t i = 0; i < TILE; i += 4) sums[b] += load4(row + i) * load4(rows[listed[b]] + i);
    }
}

/* Scale a tile's rows by the roots of Geman and McClure's weights of its residuals, and return the sum of the weights. */
static double weigh(double rows[LIT + 1][TILE], int64_t n, int64_t count, double cut) {
    double sum = 0;
    for (int64_t i = 0; i < count; i++) {
        double z = rows[n][i] / cut, root = 1 / (1 + z * z);
        for (int64_t k = 0; k <= n; k++) rows[k][i] *= root;
        sum += root * root;
    }
    return sum;
}

/* Compare all pixels, and add up the normal equations of the parameters that are used; those of others are 0. */
void add_up(model *m, const double *theta, const pixels *chosen, const bool *used, equations *sums) {
    int64_t n = m->parameters, listed[LIT + 1], last = 0;
    double rows[LIT + 1][TILE] = {{0}}, weight = 0;
    double4 lanes[LIT + 1][LIT + 1];
    for (int64_t k = 0; k < n; k++)
        if (used[k]) listed[last++] = k;
    listed[last] = n; /* the residuals */
    memset(lanes, 0, (size_t)(last + 1) * sizeof lanes[0]);
    prepare(m, theta);
    for (int64_t first = 0; first < chosen->count; first += TILE) {
        int64_t count = least(TILE, chosen->count - first);
        for (int64_t k = 0; count < TILE && k <= n; k++) memset(rows[k], 0, sizeof rows[k]);
        compare_tile(m, theta, chosen->xy + 2 * first, chosen->levels + first, count, rows[n], rows[0], TILE);
        weight += m->cut > 0 ? weigh(rows, n, count, m->cut) : (double)count;
        add_products((const double(*)[TILE])rows, listed, last + 1, lanes);
    }
    memset(sums, 0, sizeof *sums);
    sums->weight = weight;
    for (int64_t a = 0; a < last; a++) {
        for (int64_t b = 0; b <= a; b++) {
            double sum = sum4(lanes[a][b]);
            sums->hessian[listed[a] * n + listed[b]] = sums->hessian[listed[b] * n + listed[a]] = sum;
        }
        sums->slope[listed[a]] = sum4(lanes[last][a]);
    }
    sums->squares = sum4(lanes[last][last]);
}

static void compare_all(const model *m, const double *theta, const int32_t *xy, const float *levels, int64_t n,
                        double *r, double *jacobian) {
    for (int64_t first = 0; first < n; first += TILE)
        compare_tile(m, theta, xy + 2 * first, levels + first, least(TILE, n - first), r + first, jacobian + first, n);
}

EXPORT status residuals(const float *seen, int64_t n, const int32_t *xy, const double *theta, const double *lines,
                        int64_t line_count, const double *levels, int64_t intervals, double *r, double *jacobian) {
    if (line_count > MOST_LINES || intervals != line_count + 1) return TOO_LARGE;
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .levels = levels};
    compare_all(&m, theta, xy, seen, n, r, jacobian);
    return DONE;
}

EXPORT status lit_residuals(const float *seen, int64_t n, const int32_t *xy, const double *theta, const double *anchor,
                            const double *lines, int64_t line_count, const int64_t *index, int64_t intervals,
                            const double *base, int64_t base_count, double *r, double *jacobian) {
    if (line_count > MOST_LINES || base_count > MOST_LINES || intervals != line_count + 1) return TOO_LARGE;
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .anchor = {anchor[0], anchor[1], anchor[2]}};
    prepare(&m, theta);
    compare_all(&m, theta, xy, seen, n, r, jacobian);
    return DONE;
}
