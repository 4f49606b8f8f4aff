/* Serves peakmark/refine/model.py, and lit.py with it. */

#include <math.h>
#include <string.h>
#include "elementary.h"
#include "lanes.h"
#include "refine_model.h"

static const double PIXEL_VARIANCE = 1.0 / 12, MIN_BLUR = 1e-3, MIN_DEPTH = 0.05;
static const float REACH = 3.5f, DENSITY = 0.39894228f;
static const float LEAST_BLUR_OF_SERIES = 0.3f; /* of a Gaussian over the box, from which a series is good enough for quick fits */
static const float CLIPPED = 253.5f; /* grey level from which a pixel counts as white */

/* Φ(z) = ½ + φ(z) (z + z³/3 + z⁵/(3·5) + …): no term has another sign. */
static double normal(double z) {
    double term = z, sum = z;
    for (double k = 3; fabs(term) > 1e-17 * fabs(sum); k += 2) sum += term *= z * z / k;
    return 0.5 + 0.39894228040143267794 * same_exp(-0.5 * z * z) * sum;
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

/* A round pattern's radius where eight pixels look, and its gradient in the image and across it. */
typedef struct {
    float8 radius, x, y, p, q;
} radial_views;

static inline radial_views radial8(float8 u, float8 v, float8 ux, float8 uy, float8 vx, float8 vy) {
    float8 radius = root8(u * u + v * v), tiny = all8(1e-9f);
    float8 inverse = all8(1) / choose8(radius > tiny, radius, all8(1));
    u = choose8(radius > tiny, u * inverse, all8(1)), v *= inverse;
    return (radial_views){radius, u * ux + v * vx, u * uy + v * vy, u * vx - v * ux, u * vy - v * uy};
}

static lanes8 rate_round8(const model *m, const eight_views *at, float reach) {
    radial_views radial = radial8(at->u, at->v, at->ux, at->uy, at->vx, at->vy);
    float8 own = all8(reach) * root8(radial.x * radial.x + radial.y * radial.y);
    lanes8 is_inside = (at->w > all8((float)MIN_DEPTH)) & (radial.radius <= all8((float)m->extent) - own), is_near = {0};
    own *= all8(1.4f);
    float lowest = least8(radial.radius - own), highest = most8(radial.radius + own);
    for (int64_t k = 0; k < m->line_count && m->lines[k] <= highest; k++)
        if (m->lines[k] >= lowest) is_near |= absolute8(radial.radius - all8((float)m->lines[k])) < own;
    return (lanes8){0} - is_inside - (is_inside & is_near);
}

/* Whether each of eight pixels of a row is inside the extent: 0 no, 1 yes, 2 yes and within reach of a line. */
static lanes8 rate8(const model *m, const double *theta, float reach, int64_t left, int64_t y) {
    eight_views at = view8(theta, all8((float)((double)left - theta[0])) + STEPS, all8((float)((double)y - theta[1])));
    if (m->is_round) return rate_round8(m, &at, reach);
    float8 reach_u = all8(reach) * root8(at.ux * at.ux + at.uy * at.uy), u = absolute8(at.u);
    float8 reach_v = all8(reach) * root8(at.vx * at.vx + at.vy * at.vy), v = absolute8(at.v), extent = all8((float)m->extent);
    lanes8 is_inside = (at.w > all8((float)MIN_DEPTH)) & (u <= extent - reach_u) & (v <= extent - reach_v), is_near = {0};
    reach_u *= all8(1.4f), reach_v *= all8(1.4f);
    for (int64_t k = 0; k < m->line_count; k++) {
        float8 line = all8((float)m->lines[k]);
        is_near |= (absolute8(at.u - line) < reach_u) | (absolute8(at.v - line) < reach_v);
    }
    return (lanes8){0} - is_inside - (is_inside & is_near);
}

/* Pixels within reach of a line lie on every stride-th diagonal; others tell gain and offset, on a grid 4 times as wide. */
static bool is_taken(int64_t x, int64_t y, bool near, int64_t stride) {
    return near ? (x + y) % stride == 0 : x % (4 * stride) == 0 && y % (4 * stride) == 0;
}

/* Of a large round pattern only every so many blocks of pixels are looked at, for most would not be taken. */
static int64_t block_step(const model *m, bounds b, int64_t wanted) {
    return m->is_round ? most(1, (int64_t)sqrt((double)area(b) / (16 * (double)wanted))) : 1;
}

/* Pixels follow each other in blocks of 4 × 2, so that eight of them see few lines. */
static int64_t select_from(const model *m, const double *theta, int64_t height, int64_t width, int64_t stride, int64_t wanted,
                           int32_t *xy, bool *near) {
    bounds b = pixel_bounds(theta, m->extent, width, height);
    int64_t step = block_step(m, b, wanted);
    double reach = 2.5 * sqrt(PIXEL_VARIANCE + theta[10]);
    int64_t count = 0;
    for (int64_t top = b.top; top < b.bottom; top += 2)
        for (int64_t left = b.left; left < b.right; left += 8) {
            if (((top - b.top) / 2 + (left - b.left) / 8) % step) continue;
            lanes8 kinds[2] = {rate8(m, theta, (float)reach, left, top), rate8(m, theta, (float)reach, left, top + 1)};
            for (int64_t i = 0; i < 16; i++) {
                int64_t column = i % 4 + i / 8 * 4, row = i / 4 % 2, x = left + column, y = top + row;
                int32_t kind = x < b.right && y < b.bottom ? kinds[row][column] : 0;
                if (!kind || !is_taken(x, y, kind == 2, stride)) continue;
                xy[2 * count] = (int32_t)x, xy[2 * count + 1] = (int32_t)y;
                near[count++] = kind == 2;
            }
        }
    return count;
}

/* Fill in at most about `wanted` pixels that are worth comparing, of room for `pixels_around`; return how many. */
int64_t choose_pixels(const model *m, const double *theta, int64_t height, int64_t width, int64_t wanted, int32_t *xy,
                      bool *near) {
    int64_t count = select_from(m, theta, height, width, 1, wanted, xy, near);
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
    model m = {.lines = lines, .line_count = line_count, .extent = extent};
    return select_from(&m, theta, height, width, stride, room, xy, near);
}

/* The changes of slope at the radii of levels that are linear between them, and level before the first and beyond the last. */
static void fill_bends(const model *m, const float *levels, float *bends) {
    double before = 0;
    for (int64_t k = 0; m->is_round && k < m->line_count; k++) {
        bool is_last = k == m->line_count - 1;
        double slope = is_last ? 0 : ((double)levels[k + 1] - levels[k]) / (m->lines[k + 1] - m->lines[k]);
        bends[k] = (float)(slope - before);
        before = slope;
    }
}

static void fill_sums(model *m) {
    ramps sums = {0, 0, 0, 0};
    for (int64_t k = 0; m->is_round && k <= m->line_count; k++) {
        m->before[k] = sums;
        if (k == m->line_count) return;
        sums.slope += m->bends[k], sums.level += m->bends[k] * m->own_lines[k];
        if (m->parameters == LIT) sums.tone_slope += m->tone_bends[k], sums.tone += m->tone_bends[k] * m->own_lines[k];
    }
}

/* How the printed levels show, under the tone exponent with derivatives by its logarithm; in single precision, with the lines. */
void prepare(model *m, const double *theta) {
    int64_t cells = m->is_round ? m->line_count : (m->line_count + 1) * (m->line_count + 1);
    for (int64_t k = 0; k < m->line_count; k++) m->own_lines[k] = (float)m->lines[k];
    if (m->parameters == PLAIN) {
        for (int64_t k = 0; k < cells; k++) m->shown[k] = (float)m->levels[k];
        fill_bends(m, m->shown, m->bends);
        fill_sums(m);
        return;
    }
    double exponent = same_exp(theta[15]), shown[MOST_LINES + 1], slopes[MOST_LINES + 1];
    for (int64_t k = 0; k < m->base_count; k++) {
        bool is_black_or_white = m->base[k] <= 0.0 || m->base[k] >= 1.0;
        shown[k] = is_black_or_white ? m->base[k] : same_pow(m->base[k], exponent);
        slopes[k] = is_black_or_white ? 0.0 : shown[k] * same_log(m->base[k]) * exponent;
    }
    for (int64_t k = 0; k < cells; k++) {
        m->shown[k] = (float)shown[m->index[k]];
        m->tones[k] = (float)slopes[m->index[k]];
    }
    fill_bends(m, m->shown, m->bends);
    fill_bends(m, m->tones, m->tone_bends);
    fill_sums(m);
}

/* Pixels of a tile, as columns: along either axis of the pattern the box, the Gaussian, and how far they reach. */
typedef struct {
    float width[TILE], sigma[TILE], reach[TILE];
} axis_columns;

/* Where they lie from the pattern's centre, px, and from the planes' anchor, sides; and where they look. */
typedef struct {
    float x[TILE], y[TILE], p[TILE], q[TILE], u[TILE], v[TILE], w[TILE], ux[TILE], uy[TILE], vx[TILE], vy[TILE];
    axis_columns across, down;
} view_columns;

/* The wider of the two boxes is kept, the other's variance joins the Gaussian's: that is θ[10] in every direction, and in any
   light more along one than across it. */
static void fill_axis(const model *m, const double *theta, const float *by_x, const float *by_y, int64_t n, axis_columns *axis) {
    bool is_lit = m->parameters == LIT;
    const float blur = (float)theta[10], d = is_lit ? (float)theta[16] : 0, e = is_lit ? (float)theta[17] : 0;
    const float least_blur = is_lit ? (float)MIN_BLUR : 0;
    for (int64_t i = 0; i < n; i++) {
        float x = by_x[i], y = by_y[i], a = fabsf(x), b = fabsf(y), width = a > b ? a : b, other = a > b ? b : a;
        float square = x * x + y * y, own_blur = blur * square + d * (x * x - y * y) + 2 * e * x * y;
        own_blur = own_blur > least_blur * square ? own_blur : least_blur * square;
        float sigma = sqrtf(other * other / 12 + own_blur + (m->is_soft ? width * width / 12 : 0));
        axis->width[i] = width, axis->sigma[i] = sigma;
        axis->reach[i] = (m->is_soft ? 0 : width / 2) + REACH * sigma;
    }
}

static void fill_places(const model *m, const double *theta, const int32_t *xy, int64_t count, int64_t n, view_columns *views) {
    double side = m->parameters == LIT ? m->anchor[2] : 1;
    for (int64_t i = 0; i < n; i++) {
        double x = xy[2 * least(i, count - 1)], y = xy[2 * least(i, count - 1) + 1];
        views->x[i] = (float)(x - theta[0]), views->y[i] = (float)(y - theta[1]);
        views->p[i] = (float)((x - m->anchor[0]) / side), views->q[i] = (float)((y - m->anchor[1]) / side);
    }
}

/* Where the first n ≥ count pixels of a tile look; beyond `count` the last one again. */
static void fill_views(const model *m, const double *theta, const int32_t *xy, int64_t count, int64_t n, view_columns *views) {
    fill_places(m, theta, xy, count, n, views);
    for (int64_t i = 0; i < n; i += 8) {
        eight_views at = view8(theta, load8(views->x + i), load8(views->y + i));
        store8(views->u + i, at.u), store8(views->v + i, at.v), store8(views->w + i, at.w);
        store8(views->ux + i, at.ux), store8(views->uy + i, at.uy), store8(views->vx + i, at.vx), store8(views->vy + i, at.vy);
    }
    if (m->is_round) return;
    fill_axis(m, theta, views->ux, views->uy, n, &views->across);
    fill_axis(m, theta, views->vx, views->vy, n, &views->down);
}

/* The density of the normal distribution, and the distribution within 1e-7 (Abramowitz & Stegun 26.2.17). */
static inline float8 density8(float8 z) { return all8(DENSITY) * exp8(all8(-0.5f) * z * z); }

static inline float8 normal8(float8 z, float8 density) {
    float8 t = all8(1) / (all8(1) + all8(0.2316419f) * absolute8(z)), series = all8(1.330274429f);
    series = all8(1.781477937f) + t * (all8(-1.821255978f) + t * series);
    float8 tail = density * t * (all8(0.319381530f) + t * (all8(-0.356563782f) + t * series));
    return choose8(z > all8(0), all8(1) - tail, tail);
}

/* Each interval's share of what eight pixels see along an axis, with its first and second derivative; interval k ends at
   line k, and none but first … last is seen by any of them. */
typedef struct {
    int64_t first, last;
    float8 value[MOST_LINES + 1], slope[MOST_LINES + 1], bend[MOST_LINES + 1];
} share_table;

/* What is past an edge, with its first and second derivative along the axis. */
typedef struct {
    float8 value, slope, bend;
} edge;

/* An edge at a distance t, under a Gaussian that the pixel's box has joined. */
static inline edge soft_edge(float8 t, float8 per_sigma) {
    float8 z = t * per_sigma, density = density8(z), slope = density * per_sigma;
    return (edge){normal8(z, density), slope, all8(0) - z * slope * per_sigma};
}

/* One under a box and a Gaussian. */
static inline edge sharp_edge(float8 t, float8 half, float8 sigma, float8 per_sigma, float8 per_width) {
    float8 z = t * per_sigma, left = z + half, right = z - half, at_left = density8(left), at_right = density8(right);
    float8 up_left = normal8(left, at_left), up_right = normal8(right, at_right);
    return (edge){(left * up_left + at_left - right * up_right - at_right) * sigma * per_width,
                  (up_left - up_right) * per_width, (at_left - at_right) * per_sigma * per_width};
}

/* One under a box that a Gaussian of LEAST_BLUR_OF_SERIES of its width and more blurs: by Edgeworth's series up to the box's fourth
   cumulant, within 0.002 of itself. `per_sigma` is of both, `excess` a 24th of the fourth cumulant over the fourth power of
   their σ. */
static inline edge blurred_edge(float8 t, float8 per_sigma, float8 excess) {
    float8 z = t * per_sigma, square = z * z, density = density8(z), three = all8(3);
    float8 value = normal8(z, density) - excess * density * z * (square - three);
    float8 slope = density * (all8(1) + excess * (square * (square - all8(6)) + three));
    float8 bend = all8(0) - density * z * (all8(1) + excess * (square * (square - all8(10)) + all8(15)));
    return (edge){value, slope * per_sigma, bend * per_sigma * per_sigma};
}

static void fill_shares(const model *m, float8 u, const axis_columns *axis, int64_t i, share_table *shares) {
    float8 width = load8(axis->width + i), sigma = load8(axis->sigma + i), reach = load8(axis->reach + i);
    float8 per_sigma = all8(1) / sigma, per_width = all8(1) / width, half = all8(0.5f) * width * per_sigma;
    float8 above = all8(1), above_slope = all8(0), above_bend = all8(0);
    float lowest = least8(u - reach), highest = most8(u + reach);
    bool is_blurred = m->is_quick && !m->is_soft && least8(sigma - all8(LEAST_BLUR_OF_SERIES) * width) > 0;
    float8 variance = sigma * sigma + width * width * all8(1.0f / 12), per_both = all8(1) / root8(variance);
    float8 box = width * per_both, excess = all8(-1.0f / 2880) * box * box * box * box;
    int64_t k = 0;
    while (k < m->line_count && m->own_lines[k] < lowest) k++;
    for (shares->first = k; k < m->line_count && m->own_lines[k] < highest; k++) {
        float8 t = u - all8(m->own_lines[k]);
        lanes8 is_seen = absolute8(t) < reach;
        edge at = m->is_soft ? soft_edge(t, per_sigma)
                  : is_blurred ? blurred_edge(t, per_both, excess) : sharp_edge(t, half, sigma, per_sigma, per_width);
        float8 step = choose8(is_seen, at.value, only8(t > all8(0), all8(1)));
        float8 slope = only8(is_seen, at.slope), bend = only8(is_seen, at.bend);
        shares->value[k] = above - step, shares->slope[k] = above_slope - slope, shares->bend[k] = above_bend - bend;
        above = step, above_slope = slope, above_bend = bend;
    }
    shares->value[k] = above, shares->slope[k] = above_slope, shares->bend[k] = above_bend;
    shares->last = k;
}

/* What eight pixels see of the pattern, 0…1, with derivatives by x and y in the image, twice by each and by both, as blur
   along them acts, and by the tone. */
typedef struct {
    float8 level, by_x, by_y, by_xx, by_yy, by_xy, by_tone;
} sight;

static sight look(const model *m, const view_columns *views, int64_t i, const share_table *across, const share_table *down) {
    sight seen = {all8(0), all8(0), all8(0), all8(0), all8(0), all8(0), all8(0)};
    float8 by_u = all8(0), by_v = all8(0), by_uu = all8(0), by_vv = all8(0);
    float8 ux = load8(views->ux + i), uy = load8(views->uy + i), vx = load8(views->vx + i), vy = load8(views->vy + i);
    for (int64_t row = down->first; row <= down->last; row++) {
        const float *levels = m->shown + row * (m->line_count + 1), *tones = m->tones + row * (m->line_count + 1);
        float8 value = all8(0), slope = all8(0), bend = all8(0), tone = all8(0);
        for (int64_t k = across->first; k <= across->last; k++) {
            float8 level = all8(levels[k]);
            value += level * across->value[k], slope += level * across->slope[k], bend += level * across->bend[k];
            if (m->parameters == LIT) tone += all8(tones[k]) * across->value[k];
        }
        seen.level += down->value[row] * value, by_v += down->slope[row] * value, by_vv += down->bend[row] * value;
        by_u += down->value[row] * slope, by_uu += down->value[row] * bend;
        seen.by_tone += down->value[row] * tone;
    }
    seen.by_x = by_u * ux + by_v * vx, seen.by_y = by_u * uy + by_v * vy;
    seen.by_xx = by_uu * ux * ux + by_vv * vx * vx, seen.by_yy = by_uu * uy * uy + by_vv * vy * vy;
    seen.by_xy = by_uu * ux * uy + by_vv * vx * vy;
    return seen;
}

/* What ramps that begin at the radii show under a Gaussian at a distance from the centre: level, slope, bend, and by tone. */
typedef struct {
    float8 level, slope, bend, tone;
} profile;

static void add_ramps(const model *m, float8 radius, float8 sigma, float8 sign, profile *sums) {
    float8 per_sigma = all8(1) / sigma, reach = all8(REACH);
    float highest = most8(radius + reach * sigma), lowest = least8(radius - reach * sigma);
    int64_t k = 0;
    while (k < m->line_count && m->own_lines[k] < lowest) k++; /* past these all eight */
    const ramps *before = &m->before[k];
    sums->level += all8(before->slope) * radius - all8(before->level), sums->slope += sign * all8(before->slope);
    if (m->parameters == LIT) sums->tone += all8(before->tone_slope) * radius - all8(before->tone);
    for (; k < m->line_count && m->own_lines[k] < highest; k++) {
        float8 t = radius - all8(m->own_lines[k]), z = t * per_sigma, density = density8(z), step = normal8(z, density);
        lanes8 is_seen = absolute8(z) < reach, is_past = t > all8(0);
        float8 value = choose8(is_seen, t * step + sigma * density, only8(is_past, t));
        step = choose8(is_seen, step, only8(is_past, all8(1)));
        sums->level += all8(m->bends[k]) * value, sums->slope += sign * all8(m->bends[k]) * step;
        sums->bend += all8(m->bends[k]) * only8(is_seen, density * per_sigma);
        if (m->parameters == LIT) sums->tone += all8(m->tone_bends[k]) * value;
    }
}

/* The distance from the centre of what a pixel sees, as a normal distribution with the right second and fourth moments, at
   radius r under a blur of variance a along it, c across it and covariance e: ρ² = (r + x)² + y² has the mean r² + a + c and the
   variance 4 r² a + 2 a² + 2 c² + 4 e². Its derivatives by r, a, c and e, half of those by its variance beside them. */
typedef struct {
    float8 mean, variance, by_r, by_a, by_c, by_e, half_by_r, half_by_a, half_by_c, half_by_e;
} distance;

static inline distance seen_distance(float8 r, float8 a, float8 c, float8 e) {
    const float8 zero = all8(0), two = all8(2), half = all8(0.5f), tiny = all8(1e-12f);
    float8 square = r * r, fourth = square * square + two * c * (square + a) - two * e * e;
    float8 mean_square = root8(choose8(fourth > tiny, fourth, tiny)), mean = root8(mean_square);
    float8 variance = square + a + c - mean_square, inverse = all8(1) / mean_square, per_mean = half / mean;
    float8 by_r = two * r * (square + c) * inverse, by_a = c * inverse, by_c = (square + a) * inverse; /* of mean² */
    float8 by_e = zero - two * e * inverse;
    return (distance){mean, choose8(variance > tiny, variance, tiny),
                      by_r * per_mean, by_a * per_mean, by_c * per_mean, by_e * per_mean,
                      r - half * by_r, half - half * by_a, half - half * by_c, zero - half * by_e};
}

/* What eight pixels see of a round pattern: its profile, under the distribution of distances that blur and a pixel's square
   make of its own one. */
static sight look_round(const model *m, const double *theta, const view_columns *views, int64_t i) {
    const bool is_lit = m->parameters == LIT;
    const float8 d = all8(is_lit ? (float)theta[16] : 0), e = all8(is_lit ? (float)theta[17] : 0), two = all8(2);
    const float8 blur = all8((float)(PIXEL_VARIANCE + greater(theta[10], is_lit ? MIN_BLUR : 0)));
    radial_views radial = radial8(load8(views->u + i), load8(views->v + i), load8(views->ux + i), load8(views->uy + i),
                                  load8(views->vx + i), load8(views->vy + i));
    float8 x = radial.x, y = radial.y, p = radial.p, q = radial.q;
    float8 along = blur * (x * x + y * y) + d * (x * x - y * y) + two * e * x * y;
    float8 across = blur * (p * p + q * q) + d * (p * p - q * q) + two * e * p * q;
    float8 both = blur * (x * p + y * q) + d * (x * p - y * q) + e * (x * q + y * p);
    distance at = seen_distance(radial.radius, along, across, both);
    float8 sigma = root8(at.variance);
    profile sums = {all8(m->shown[0]), all8(0), all8(0), all8(is_lit ? m->tones[0] : 0)};
    add_ramps(m, at.mean, sigma, all8(1), &sums);
    add_ramps(m, all8(0) - at.mean, sigma, all8(-1), &sums);
    float8 outwards = sums.slope * at.by_r + sums.bend * at.half_by_r, own = radial.radius;
    float8 by_a = sums.slope * at.by_a + sums.bend * at.half_by_a, by_c = sums.slope * at.by_c + sums.bend * at.half_by_c;
    float8 by_e = sums.slope * at.by_e + sums.bend * at.half_by_e; /* around the centre the blur turns against the radius */
    float8 turning = two * both * (by_a - by_c) + (across - along) * by_e, is_off = all8(1e-3f) * at.mean;
    float8 aside = only8(own > is_off, turning / choose8(own > is_off, own, at.mean));
    return (sight){sums.level, outwards * x + aside * p, outwards * y + aside * q,
                   two * (by_a * x * x + by_c * p * p + by_e * x * p), two * (by_a * y * y + by_c * q * q + by_e * y * q),
                   two * (by_a * x * y + by_c * p * q) + by_e * (x * q + y * p), sums.tone};
}

/* Add to the derivatives by A and g how they change the blur in the pattern's units, by A −D Σ H, by g
   tr(Σ H) u + D Σ (H (x − c) + ∇): D = ∂u/∂x, Σ is the blur, ∇ and H are the prediction's first and second derivatives. */
static void add_blur_of_shape(const model *m, const double *theta, const view_columns *views, int64_t i, const sight *seen,
                              float8 shown, float8 *by) {
    const bool is_lit = m->parameters == LIT;
    const float8 d = all8(is_lit ? (float)theta[16] : 0), e = all8(is_lit ? (float)theta[17] : 0);
    const float8 blur = all8((float)(PIXEL_VARIANCE + greater(theta[10], is_lit ? MIN_BLUR : 0)));
    float8 xx = (blur + d) * seen->by_xx + e * seen->by_xy, xy = (blur + d) * seen->by_xy + e * seen->by_yy; /* Σ H */
    float8 yx = e * seen->by_xx + (blur - d) * seen->by_xy, yy = e * seen->by_xy + (blur - d) * seen->by_yy;
    float8 x = load8(views->x + i), y = load8(views->y + i), scale = shown / load8(views->w + i);
    float8 px = xx * x + xy * y + (blur + d) * seen->by_x + e * seen->by_y;
    float8 py = yx * x + yy * y + e * seen->by_x + (blur - d) * seen->by_y;
    float8 ux = scale * load8(views->ux + i), uy = scale * load8(views->uy + i);
    float8 vx = scale * load8(views->vx + i), vy = scale * load8(views->vy + i);
    by[2] -= ux * xx + uy * yx, by[3] -= vx * xx + vy * yx;
    by[4] -= ux * xy + uy * yy, by[5] -= vx * xy + vy * yy;
    by[6] += scale * (xx + yy) * load8(views->u + i) + ux * px + uy * py;
    by[7] += scale * (xx + yy) * load8(views->v + i) + vx * px + vy * py;
}

/* Write the residuals of eight pixels, and the derivatives of their predictions; of square patterns those by A and g leave out
   how they change the blur. */
static void compare(const model *m, const double *theta, const view_columns *views, int64_t i, const sight *seen,
                    float8 level, tile_rows rows) {
    bool is_lit = m->parameters == LIT;
    float8 p = load8(views->p + i), q = load8(views->q + i), light = all8(1), shade = all8(0), gain = all8((float)theta[8]);
    if (is_lit) {
        light = all8(1) + all8((float)theta[11]) * p + all8((float)theta[12]) * q;
        shade = all8((float)theta[13]) * p + all8((float)theta[14]) * q;
    }
    float8 lit = light * seen->level + shade, value = all8((float)theta[9]) + gain * lit;
    lanes8 is_before = load8(views->w + i) > all8((float)MIN_DEPTH), is_white = (value >= all8(CLIPPED)) & (level >= all8(CLIPPED));
    if (is_lit) is_before &= ~is_white;
    else is_white &= is_before & ~is_before;
    store8(rows[m->parameters] + i, choose8(is_before, level - value, only8(~is_white, all8(255))));
    /* (px, py) is the prediction's gradient in the image; ∂prediction/∂θ = −(px, py)·∂x/∂θ at fixed u */
    float8 shown = gain * light, px = shown * seen->by_x, py = shown * seen->by_y;
    float8 along = px * load8(views->x + i) + py * load8(views->y + i), per_w = all8(1) / load8(views->w + i);
    float8 u = load8(views->u + i) * per_w, v = load8(views->v + i) * per_w, zero = all8(0);
    float8 half = all8(0.5f) * shown, xx = seen->by_xx, yy = seen->by_yy, xy = seen->by_xy;
    float8 by[LIT] = {zero - px, zero - py, zero - px * u, zero - px * v, zero - py * u, zero - py * v, along * u, along * v,
                            lit, all8(1), half * (xx + yy), gain * p * seen->level, gain * q * seen->level, gain * p, gain * q,
                            shown * seen->by_tone, half * (xx - yy), all8(2) * half * xy};
    if (m->is_round) add_blur_of_shape(m, theta, views, i, seen, shown, by);
    for (int64_t k = 0; k < m->parameters; k++) store8(rows[k] + i, only8(is_before, by[k]));
}

/* Fill in the rows of a tile: derivatives of the prediction by each parameter, then image − prediction, of count ≤ TILE
   pixels, and 0 up to whole lanes; beyond the pattern's horizon 0 and 255, where image and prediction are both white 0
   and 0. `prepare` comes before. Returns the pixels with those up to whole lanes. */
int64_t compare_tile(const model *m, const double *theta, const int32_t *xy, const float *levels, int64_t count, tile_rows rows) {
    view_columns views;
    share_table across, down;
    float padded[TILE] = {0};
    int64_t n = (count + 7) / 8 * 8;
    memcpy(padded, levels, (size_t)count * sizeof *levels);
    fill_views(m, theta, xy, count, n, &views);
    for (int64_t i = 0; i < n; i += 8) {
        sight seen;
        if (m->is_round) {
            seen = look_round(m, theta, &views, i);
        } else {
            fill_shares(m, load8(views.u + i), &views.across, i, &across);
            fill_shares(m, load8(views.v + i), &views.down, i, &down);
            seen = look(m, &views, i, &across, &down);
        }
        compare(m, theta, &views, i, &seen, load8(padded + i), rows);
    }
    for (int64_t k = 0; count < n && k <= m->parameters; k++) memset(rows[k] + count, 0, (size_t)(n - count) * sizeof rows[k][0]);
    return n;
}

/* Add a tile's products of rows to their lanes: of each of the listed rows with those listed before it, and itself. */
static void add_products(tile_rows rows, int64_t n, const int64_t *listed, int64_t count, float8 lanes[LIT + 1][LIT + 1]) {
    for (int64_t a = 0; a < count; a++) {
        const float *row = rows[listed[a]];
        float8 *sums = lanes[a];
        int64_t b = 0;
        for (; b + 4 <= a + 1; b += 4) { /* four at a time, for a row is read more slowly than multiplied */
            const float *b0 = rows[listed[b]], *b1 = rows[listed[b + 1]], *b2 = rows[listed[b + 2]], *b3 = rows[listed[b + 3]];
            float8 s0 = sums[b], s1 = sums[b + 1], s2 = sums[b + 2], s3 = sums[b + 3];
            for (int64_t i = 0; i < n; i += 8) {
                float8 value = load8(row + i);
                s0 += value * load8(b0 + i), s1 += value * load8(b1 + i);
                s2 += value * load8(b2 + i), s3 += value * load8(b3 + i);
            }
            sums[b] = s0, sums[b + 1] = s1, sums[b + 2] = s2, sums[b + 3] = s3;
        }
        for (; b <= a; b++) {
            float8 sum = sums[b];
            for (int64_t i = 0; i < n; i += 8) sum += load8(row + i) * load8(rows[listed[b]] + i);
            sums[b] = sum;
        }
    }
}

/* Scale a tile's rows by the roots of Geman and McClure's weights of its residuals, and return the sum of the weights. */
static double weigh(tile_rows rows, int64_t parameters, int64_t count, double cut) {
    double sum = 0;
    float root[TILE];
    for (int64_t i = 0; i < count; i++) {
        float z = rows[parameters][i] / (float)cut;
        root[i] = 1 / (1 + z * z);
        sum += root[i] * root[i];
    }
    for (int64_t k = 0; k <= parameters; k++)
        for (int64_t i = 0; i < count; i++) rows[k][i] *= root[i];
    return sum;
}

/* Compare all pixels, and add up the normal equations of the parameters that are used; those of others are 0. */
void add_up(model *m, const double *theta, const pixels *chosen, const bool *used, equations *sums) {
    int64_t n = m->parameters, listed[LIT + 1], last = 0;
    tile_rows rows;
    double weight = 0;
    float8 lanes[LIT + 1][LIT + 1];
    for (int64_t k = 0; k < n; k++)
        if (used[k]) listed[last++] = k;
    listed[last] = n; /* the residuals */
    memset(lanes, 0, (size_t)(last + 1) * sizeof lanes[0]);
    prepare(m, theta);
    for (int64_t first = 0; first < chosen->count; first += TILE) {
        int64_t count = least(TILE, chosen->count - first);
        int64_t room = compare_tile(m, theta, chosen->xy + 2 * first, chosen->levels + first, count, rows);
        weight += m->cut > 0 ? weigh(rows, n, count, m->cut) : (double)count;
        add_products(rows, room, listed, last + 1, lanes);
    }
    memset(sums, 0, sizeof *sums);
    sums->weight = weight;
    for (int64_t a = 0; a < last; a++) {
        for (int64_t b = 0; b <= a; b++) {
            double sum = sum8(lanes[a][b]);
            sums->hessian[listed[a] * n + listed[b]] = sums->hessian[listed[b] * n + listed[a]] = sum;
        }
        sums->slope[listed[a]] = sum8(lanes[last][a]);
    }
    sums->squares = sum8(lanes[last][last]);
}

/* Fill in residuals (n,), and unless NULL the derivatives (parameters, n), of all pixels. */
void compare_all(model *m, const double *theta, const pixels *chosen, double *r, double *jacobian) {
    tile_rows rows;
    prepare(m, theta);
    for (int64_t first = 0; first < chosen->count; first += TILE) {
        int64_t count = least(TILE, chosen->count - first);
        compare_tile(m, theta, chosen->xy + 2 * first, chosen->levels + first, count, rows);
        for (int64_t i = 0; i < count; i++) r[first + i] = rows[m->parameters][i];
        for (int64_t k = 0; jacobian && k < m->parameters; k++)
            for (int64_t i = 0; i < count; i++) jacobian[k * chosen->count + first + i] = rows[k][i];
    }
}

EXPORT status residuals(const float *seen, int64_t n, const int32_t *xy, const double *theta, const double *lines,
                        int64_t line_count, const double *levels, int64_t rows, int64_t intervals, double *r,
                        double *jacobian) {
    model m = {.parameters = PLAIN, .lines = lines, .line_count = line_count, .levels = levels};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    compare_all(&m, theta, &(pixels){xy, seen, n}, r, jacobian);
    return DONE;
}

EXPORT status lit_residuals(const float *seen, int64_t n, const int32_t *xy, const double *theta, const double *anchor,
                            const double *lines, int64_t line_count, const int64_t *index, int64_t rows,
                            int64_t intervals, const double *base, int64_t base_count, bool is_quick, double *r, double *jacobian) {
    model m = {.parameters = LIT, .is_quick = is_quick, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .anchor = {anchor[0], anchor[1], anchor[2]}};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    compare_all(&m, theta, &(pixels){xy, seen, n}, r, jacobian);
    return DONE;
}
