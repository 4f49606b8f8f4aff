/* Serves peakmark/identification/alignment.py. */

#include <math.h>
#include <string.h>
#include "lanes.h"
#include "linear.h"
#include "refine_align.h"

enum { MOST_KNOTS = 13, MOST_ROWS = MOST_KNOTS + 3, MOST_PIXELS = 1500, CELLS = 11, CELLS_A_SIDE = 9 };
static const double FINE_SIDE = 45; /* px, of markers of which every pixel is counted in cells; of larger ones every second, … */

static double dot(const double *a, const double *b, int64_t n) {
    double4 lanes = {0};
    double rest = 0;
    int64_t i = 0;
    for (; i + 4 <= n; i += 4) lanes += load4(a + i) * load4(b + i);
    for (; i < n; i++) rest += a[i] * b[i];
    return sum4(lanes) + rest;
}

/* Products of the rows of a basis (k, n) with each other. */
static void fill_gram(const double *basis, int64_t k, int64_t n, double *gram) {
    for (int64_t a = 0; a < k; a++)
        for (int64_t b = 0; b <= a; b++) gram[a * MOST_ROWS + b] = gram[b * MOST_ROWS + a] = dot(basis + a * n, basis + b * n, n);
}

/* Write what least squares over the first k rows of a basis leave of values (n,). */
static void leave(const double *basis, const double *gram, int64_t k, const double *values, int64_t n, double *left) {
    double own[MOST_ROWS * MOST_ROWS], weights[MOST_ROWS];
    for (int64_t a = 0; a < k; a++) {
        memcpy(own + a * k, gram + a * MOST_ROWS, (size_t)k * sizeof *own);
        own[a * k + a] += 1e-6 * (double)n;
        weights[a] = dot(basis + a * n, values, n);
    }
    solve(own, k, weights, 1); /* positive definite, for its diagonal is */
    memcpy(left, values, (size_t)n * sizeof *left);
    for (int64_t a = 0; a < k; a++)
        for (int64_t i = 0; i < n; i++) left[i] -= weights[a] * basis[a * n + i];
}

/* The correlation of two columns over the chosen rows; `unknown` over `few` or fewer. */
static double correlation_of(const double *a, const double *b, const bool *chosen, int64_t n, int few, double unknown) {
    double count = 0, sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
    for (int64_t i = 0; i < n; i++)
        if (chosen[i]) count++, sum_a += a[i], sum_b += b[i];
    if (count <= few) return unknown;
    for (int64_t i = 0; i < n; i++)
        if (chosen[i]) {
            double x = a[i] - sum_a / count, y = b[i] - sum_b / count;
            aa += x * x, bb += y * y, ab += x * y;
        }
    return ab / sqrt(greater(aa * bb, 1e-9));
}

/* The columns of an alignment's pixels. */
typedef struct {
    int64_t n;
    double *values, *predicted, *flat, *round, *predicted_round, *u, *v, *r, *basis;
    bool *chosen;
} columns;

static status take_columns(columns *c, int64_t n, int64_t rows, memory *taken) {
    double **names[] = {&c->values, &c->predicted, &c->flat, &c->round, &c->predicted_round, &c->u, &c->v, &c->r};
    c->n = n;
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if (!(*names[k] = take(taken, n, sizeof(double)))) return OUT_OF_MEMORY;
    c->basis = take(taken, rows * n, sizeof(double));
    c->chosen = take(taken, n, sizeof(bool));
    return c->basis && c->chosen ? DONE : OUT_OF_MEMORY;
}

/* A plane, and tents over the radius that stand for everything radial. */
static void fill_basis(const columns *c, const pixels *chosen, const double *theta, const double *anchor,
                       const double *knots, int64_t knot_count) {
    for (int64_t i = 0; i < c->n; i++) {
        double x = chosen->xy[2 * i], y = chosen->xy[2 * i + 1];
        pattern_view at = pattern_point(theta, x, y);
        c->values[i] = chosen->levels[i], c->u[i] = at.u, c->v[i] = at.v;
        c->basis[i] = 1, c->basis[c->n + i] = (x - anchor[0]) / anchor[2], c->basis[2 * c->n + i] = (y - anchor[1]) / anchor[2];
        double radius = sqrt(at.u * at.u + at.v * at.v);
        for (int64_t k = 0; k < knot_count; k++)
            c->basis[(3 + k) * c->n + i] = greater(1 - fabs(radius - knots[k]) / 0.08, 0);
    }
}

/* The least correlations: of eight halves and quadrants, and of what is not radial in a quadrant; those that something
   covers are left out. */
static void fill_parts(const columns *c, bool is_covered, double *of_parts, double *of_quadrants) {
    int few = is_covered ? 20 : 5;
    *of_parts = *of_quadrants = 1;
    for (int part = 0; part < 8; part++) {
        bool is_right = part % 2 == 0, is_lower = part / 2 % 2 == 0;
        for (int64_t i = 0; i < c->n; i++) {
            double a = part < 4 ? c->u[i] : c->u[i] + c->v[i], b = part < 4 ? c->v[i] : c->u[i] - c->v[i];
            c->chosen[i] = (a >= 0) == is_right && (b >= 0) == is_lower;
        }
        *of_parts = lesser(correlation_of(c->values, c->predicted, c->chosen, c->n, few, is_covered), *of_parts);
        if (part < 4)
            *of_quadrants = lesser(correlation_of(c->round, c->predicted_round, c->chosen, c->n, few, is_covered), *of_quadrants);
    }
}

/* Leave out the pixels that something covers: whose residual is above twice the model's cut. Returns the share that stays. */
static double drop_covered(model *m, const double *theta, double *r, int32_t *xy, float *levels, pixels *chosen) {
    int64_t kept = 0, count = chosen->count;
    if (!(m->cut > 0)) return 1;
    compare_all(m, theta, chosen, r, NULL);
    for (int64_t i = 0; i < count; i++)
        if (fabs(r[i]) <= 2 * m->cut) {
            xy[2 * kept] = xy[2 * i], xy[2 * kept + 1] = xy[2 * i + 1];
            levels[kept++] = levels[i];
        }
    *chosen = (pixels){xy, levels, kept};
    return (double)kept / (double)most(count, 1);
}

static void measure(model *m, const double *theta, const pixels *chosen, const columns *c, const double *knots,
                    int64_t knot_count, double *figures) {
    int64_t rows = 3 + knot_count;
    double gram[MOST_ROWS * MOST_ROWS];
    fill_basis(c, chosen, theta, m->anchor, knots, knot_count);
    compare_all(m, theta, chosen, c->r, NULL);
    for (int64_t i = 0; i < c->n; i++) c->predicted[i] = c->values[i] - c->r[i];
    fill_gram(c->basis, rows, c->n, gram);
    leave(c->basis, gram, 3, c->values, c->n, c->flat);
    leave(c->basis, gram, rows, c->values, c->n, c->round);
    leave(c->basis, gram, rows, c->predicted, c->n, c->predicted_round);
    figures[0] = (double)c->n, figures[1] = dot(c->flat, c->flat, c->n), figures[2] = dot(c->round, c->round, c->n);
    figures[3] = dot(c->r, c->r, c->n);
    figures[4] = dot(c->round, c->predicted_round, c->n) /
                 sqrt(greater(figures[2] * dot(c->predicted_round, c->predicted_round, c->n), 1e-9));
    fill_parts(c, m->cut > 0, figures + 5, figures + 6);
}

/* Pixels on their way into cells, up to a tile of them. */
typedef struct {
    int64_t count, cells[TILE];
    int32_t xy[2 * TILE];
    float levels[TILE];
} counted;

static void count_up(model *m, const double *theta, counted *tile, double *sums, double *counts, double *all) {
    tile_rows rows;
    if (tile->count) compare_tile(m, theta, tile->xy, tile->levels, tile->count, rows);
    for (int64_t i = 0; i < tile->count; i++) {
        all[tile->cells[i]]++;
        if (m->cut > 0 && fabs(rows[LIT][i]) > 2 * m->cut) continue;
        sums[tile->cells[i]] += rows[LIT][i] / theta[8], counts[tile->cells[i]]++;
    }
    tile->count = 0;
}

static int64_t cell_at(double u, double reach) { return most(0, least(CELLS - 1, (int64_t)((u + reach) * CELLS_A_SIDE))); }

/* A position as a pixel's, inside the image; 0 if it is none. */
static int64_t nearest_pixel(double position, int64_t length) {
    return position > 0 ? (int64_t)lesser(position, (double)(length - 1)) : 0;
}

/* Sums of residuals over gain in 11 × 11 cells, the outermost beyond the pattern, how many pixels of each are compared,
   and how many are in each. */
static void fill_cells(model *m, const uint8_t *gray, int64_t height, int64_t width, const double *theta, double *sums,
                       double *counts, double *all) {
    double reach = (double)CELLS / CELLS_A_SIDE / 2, side = sqrt(fabs(theta[2] * theta[5] - theta[3] * theta[4]));
    double half_x = 1.3 * reach * (fabs(theta[2]) + fabs(theta[3])) + 1, half_y = 1.3 * reach * (fabs(theta[4]) + fabs(theta[5])) + 1;
    int64_t step = most(1, nearest_pixel(side / FINE_SIDE, most(height, width)));
    int64_t left = nearest_pixel(theta[0] - half_x, width), right = nearest_pixel(theta[0] + half_x, width);
    int64_t top = nearest_pixel(theta[1] - half_y, height), bottom = nearest_pixel(theta[1] + half_y, height);
    counted tile = {.count = 0};
    prepare(m, theta);
    for (int64_t y = top; y <= bottom; y += step)
        for (int64_t x = left; x <= right; x += 8 * step) {
            float8 from_center = all8((float)((double)x - theta[0])) + all8((float)step) * STEPS;
            eight_views at = view8(theta, from_center, all8((float)((double)y - theta[1])));
            lanes8 is_inside = (at.w > all8(0.05f)) & (absolute8(at.u) < all8((float)reach)) & (absolute8(at.v) < all8((float)reach));
            for (int64_t i = 0; i < 8 && x + i * step <= right; i++) {
                if (!is_inside[i]) continue;
                tile.xy[2 * tile.count] = (int32_t)(x + i * step), tile.xy[2 * tile.count + 1] = (int32_t)y;
                tile.levels[tile.count] = gray[y * width + x + i * step];
                tile.cells[tile.count++] = cell_at(at.v[i], reach) * CELLS + cell_at(at.u[i], reach);
                if (tile.count == TILE) count_up(m, theta, &tile, sums, counts, all);
            }
        }
    count_up(m, theta, &tile, sums, counts, all);
}

/* Choose pixels and read them straight from the image: the marker may be as large as it. */
static status read_bytes(const model *m, const uint8_t *gray, int64_t height, int64_t width, const double *theta,
                         memory *taken, int32_t **pixel_xy, float **pixel_levels, pixels *chosen) {
    int64_t room = pixels_around(m, theta, height, width);
    int32_t *xy = take(taken, 2 * room, sizeof *xy);
    bool *near = take(taken, room, sizeof *near);
    if (!xy || !near) return OUT_OF_MEMORY;
    int64_t count = choose_pixels(m, theta, height, width, MOST_PIXELS, xy, near);
    float *levels = take(taken, count, sizeof *levels);
    if (!levels) return OUT_OF_MEMORY;
    for (int64_t i = 0; i < count; i++) levels[i] = gray[xy[2 * i + 1] * width + xy[2 * i]];
    *chosen = (pixels){xy, levels, count};
    *pixel_xy = xy, *pixel_levels = levels;
    return DONE;
}

EXPORT status measure_alignment(const uint8_t *gray, int64_t height, int64_t width, const double *theta,
                                const double *center, double size, const double *lines, int64_t line_count,
                                const int64_t *index, int64_t rows, int64_t intervals, const double *base, int64_t base_count,
                                double extent, const double *knots, int64_t knot_count, double cut, double *figures,
                                double *sums, double *counts, double *all) {
    if (knot_count > MOST_KNOTS) return TOO_LARGE;
    model m = {.parameters = LIT, .lines = lines, .line_count = line_count, .index = index, .base = base,
               .base_count = base_count, .extent = extent, .anchor = {center[0], center[1], size}, .cut = cut};
    if (!set_grid(&m, rows, intervals)) return TOO_LARGE;
    memory taken = {.count = 0};
    pixels chosen;
    columns c;
    int32_t *xy;
    float *levels;
    memset(figures, 0, 8 * sizeof *figures);
    memset(sums, 0, CELLS * CELLS * sizeof *sums);
    memset(counts, 0, CELLS * CELLS * sizeof *counts);
    memset(all, 0, CELLS * CELLS * sizeof *all);
    status state = read_bytes(&m, gray, height, width, theta, &taken, &xy, &levels, &chosen);
    double *r = state == DONE ? take(&taken, chosen.count, sizeof *r) : NULL;
    if (state == DONE && !r) state = OUT_OF_MEMORY;
    if (state == DONE) figures[7] = drop_covered(&m, theta, r, xy, levels, &chosen);
    if (state == DONE && chosen.count >= MIN_PIXELS) {
        state = take_columns(&c, chosen.count, 3 + knot_count, &taken);
        if (state == DONE) measure(&m, theta, &chosen, &c, knots, knot_count, figures);
        if (state == DONE) fill_cells(&m, gray, height, width, theta, sums, counts, all);
    }
    give_back(&taken);
    return state;
}

/* Whether a fit was not given up, has at least 8 px a side, and is not far from where it began. */
static bool is_near(const double *theta, const double *center, double size, double step) {
    bool is_finite = isfinite(step);
    for (int k = 0; k < LIT; k++) is_finite = is_finite && isfinite(theta[k]);
    double side = sqrt(fabs(theta[2] * theta[5] - theta[3] * theta[4])), x = theta[0] - center[0], y = theta[1] - center[1];
    return is_finite && theta[8] > 0 && side >= 8 && sqrt(x * x + y * y) <= 0.35 * side && 0.5 < side / size && side / size < 2;
}

/* Measure each alignment, as `measure_alignment`; what is none has 0 pixels. */
EXPORT status measure_each(const uint8_t *gray, int64_t height, int64_t width, const double *xy, int64_t n, const double *sides,
                           const double *lines, int64_t line_count, const int64_t *index, int64_t rows, int64_t intervals,
                           const double *base, int64_t base_count, double extent, const double *knots, int64_t knot_count,
                           const double *theta, const double *fits, double *figures, double *sums, double *counts, double *all) {
    status state = DONE;
    for (int64_t k = 0; k < n && state == DONE; k++) {
        const double *found = theta + LIT * k, *fit = fits + 6 * k, *center = xy + 2 * k;
        figures[8 * k] = 0;
        if (!is_near(found, center, sides[k], fit[1])) continue;
        state = measure_alignment(gray, height, width, found, center, sides[k], lines, line_count, index, rows, intervals, base,
                                  base_count, extent, knots, knot_count, fit[3], figures + 8 * k, sums + CELLS * CELLS * k,
                                  counts + CELLS * CELLS * k, all + CELLS * CELLS * k);
    }
    return state;
}

/* ---- the image's noise ---- */

enum { BLOCK = 16, LEVELS = 2048 };

/* The median of a block's second differences (1 −2 1) ⊗ (1 −2 1), of both that lie in the middle the mean; the histogram is
   empty before and after. */
static double median_difference(const uint8_t *gray, int64_t width, uint16_t *histogram) {
    int32_t values[BLOCK * BLOCK], middle[2] = {0, 0}, below = 0, level = 0;
    for (int64_t y = 0; y < BLOCK; y++)
        for (int64_t x = 0; x < BLOCK; x++) {
            const uint8_t *a = gray + y * width + x, *b = a + width, *c = b + width;
            int32_t value = (a[0] - 2 * a[1] + a[2]) - 2 * (b[0] - 2 * b[1] + b[2]) + (c[0] - 2 * c[1] + c[2]);
            values[y * BLOCK + x] = value < 0 ? -value : value;
        }
    for (int64_t i = 0; i < BLOCK * BLOCK; i++) histogram[values[i]]++;
    for (int k = 0; k < 2; k++) { /* the values of ranks 127 and 128 */
        while (below + histogram[level] <= BLOCK * BLOCK / 2 - 1 + k) below += histogram[level++];
        middle[k] = level;
    }
    for (int64_t i = 0; i < BLOCK * BLOCK; i++) histogram[values[i]] = 0;
    return (middle[0] + middle[1]) / 2.0;
}

/* Median absolute second differences of blocks of 16 × 16 of an image, from its second row and column on, `step` blocks apart. */
EXPORT void block_medians(const uint8_t *gray, int64_t height, int64_t width, int64_t step, double *medians, int64_t down,
                          int64_t across) {
    uint16_t histogram[LEVELS] = {0};
    (void)height;
    for (int64_t y = 0; y < down; y++)
        for (int64_t x = 0; x < across; x++)
            medians[y * across + x] = median_difference(gray + BLOCK * step * (y * width + x), width, histogram);
}
