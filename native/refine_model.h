/* What a camera shows of a known pattern: see peakmark/refine/model.py, and lit.py for tone and light. */

#ifndef REFINE_MODEL_H
#define REFINE_MODEL_H

#include "lanes.h"
#include "memory.h"
#include "peak.h"

enum {
    PLAIN = 11,      /* parameters of a pattern in even light */
    LIT = 18,        /* and those of one in any light */
    MOST_LINES = 32, /* of a pattern, or radii of a round one */
    TILE = 64,       /* pixels that are compared at a time */
};

/* Sums over radii of changes of slope, and of those times the radius, of levels and of their derivatives. */
typedef struct {
    float slope, level, tone_slope, tone;
} ramps;

/* A pattern and how it is seen; `prepare` fills the levels in for given parameters. A round one has the levels at its
   lines, which are radii, and is linear in between: its levels and index are (1, n). */
typedef struct {
    int64_t parameters;   /* PLAIN or LIT */
    bool is_round;
    const double *lines;  /* (n,) rising, sides */
    int64_t line_count;
    double extent;        /* half the side of what is compared, sides */
    const int64_t *index; /* (n + 1, n + 1) which printed level a cell has; LIT only */
    const double *base;   /* (base_count,) the printed levels; LIT only */
    int64_t base_count;
    double anchor[3];     /* x, y and side, px, of the planes of light; LIT only */
    double cut;           /* residuals of this many grey levels count a quarter; 0 where all count alike */
    bool is_soft;         /* blur is so wide, half a square pixel and more, that a pixel's box counts as its Gaussian */
    bool is_quick;        /* what a box and a Gaussian make of an edge may be off by 0.002 of its height */
    const double *levels; /* (n + 1, n + 1); PLAIN only */
    float own_lines[MOST_LINES];                       /* the lines in single precision */
    float shown[(MOST_LINES + 1) * (MOST_LINES + 1)]; /* the levels, under the tone exponent */
    float tones[(MOST_LINES + 1) * (MOST_LINES + 1)]; /* and their derivatives by its logarithm; LIT only */
    float bends[MOST_LINES], tone_bends[MOST_LINES];  /* changes of slope at the radii, of both; round only */
    ramps before[MOST_LINES + 1];                     /* the sums of those at lower radii; round only */
} model;

/* Whether levels (rows, intervals) belong to so many lines, and there is room for them; tells round patterns. */
static inline bool set_grid(model *m, int64_t rows, int64_t intervals) {
    int64_t n = m->line_count;
    m->is_round = rows == 1 && intervals == n;
    return n >= 1 && n <= MOST_LINES && m->base_count <= MOST_LINES && (m->is_round || (rows == intervals && intervals == n + 1));
}

/* An image of grey levels. */
typedef struct {
    const float *levels;
    int64_t height, width;
} picture;

/* Pixels to compare: (count, 2) x and y, and the grey levels there. */
typedef struct {
    const int32_t *xy;
    const float *levels;
    int64_t count;
} pixels;

/* Where a pixel looks: u, v, w = 1 + g·u and ∂u/∂x, ∂u/∂y, ∂v/∂x, ∂v/∂y; w = 0 beyond the horizon. */
typedef struct {
    double u, v, w, ux, uy, vx, vy;
} pattern_view;

static inline pattern_view pattern_point(const double *theta, double x, double y) {
    double dx = x - theta[0], dy = y - theta[1];
    double b11 = theta[2] - dx * theta[6], b12 = theta[3] - dx * theta[7];
    double b21 = theta[4] - dy * theta[6], b22 = theta[5] - dy * theta[7];
    double determinant = b11 * b22 - b12 * b21;
    bool is_before = determinant > 0; /* without a branch, so that loops over pixels use wide registers */
    double u = (b22 * dx - b12 * dy) / determinant, v = (b11 * dy - b21 * dx) / determinant;
    double w = is_before ? 1 + theta[6] * u + theta[7] * v : 0, scale = is_before ? w / determinant : 0;
    return (pattern_view){is_before ? u : 0, is_before ? v : 0, w, scale * b22, -scale * b12, -scale * b21, scale * b11};
}

static const float8 STEPS = {0, 1, 2, 3, 4, 5, 6, 7};

/* Where pixels look, as `pattern_point`, of eight of them: from the pattern's centre, px. */
typedef struct {
    float8 u, v, w, ux, uy, vx, vy;
} eight_views;

static inline eight_views view8(const double *theta, float8 x, float8 y) {
    float8 g1 = all8((float)theta[6]), g2 = all8((float)theta[7]);
    float8 b11 = all8((float)theta[2]) - x * g1, b12 = all8((float)theta[3]) - x * g2;
    float8 b21 = all8((float)theta[4]) - y * g1, b22 = all8((float)theta[5]) - y * g2;
    float8 determinant = b11 * b22 - b12 * b21, inverse = all8(1) / determinant;
    lanes8 is_before = determinant > all8(0);
    float8 u = only8(is_before, (b22 * x - b12 * y) * inverse), v = only8(is_before, (b11 * y - b21 * x) * inverse);
    float8 w = only8(is_before, all8(1) + g1 * u + g2 * v), scale = only8(is_before, w * inverse), back = all8(0) - scale;
    return (eight_views){u, v, w, scale * b22, back * b12, back * b21, scale * b11};
}

/* Normal equations of a fit: Σ w, Σ w r², J w r and J w Jᵀ over the pixels; the weights w are 1 but for a `cut`. */
typedef struct {
    double weight, squares;
    double slope[LIT];
    double hessian[LIT * LIT];
} equations;

/* Derivatives by each parameter, and behind them the residuals, of the pixels of a tile; single precision is 1e-5 grey
   levels here. */
typedef float tile_rows[LIT + 1][TILE];

void prepare(model *m, const double *theta);
int64_t compare_tile(const model *m, const double *theta, const int32_t *xy, const float *levels, int64_t count, tile_rows rows);
void compare_all(model *m, const double *theta, const pixels *chosen, double *r, double *jacobian);
void add_up(model *m, const double *theta, const pixels *chosen, const bool *used, equations *sums);
int64_t choose_pixels(const model *m, const double *theta, int64_t height, int64_t width, int64_t wanted, int32_t *xy,
                      bool *near);
int64_t pixels_around(const model *m, const double *theta, int64_t height, int64_t width);

#endif
