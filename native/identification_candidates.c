/* Serves peakmark/identification/candidates.py, and sift_candidates.py. */

#include <math.h>
#include <string.h>
#include "lanes.h"
#include "memory.h"

enum { FIELDS = 6, SCALE = 2, SIGN = 4 }; /* of a row: x, y, scale, response, sign, quotient */

/* Rows that were kept, listed by the cell of a grid in which they lie. */
typedef struct {
    int64_t columns, rows;
    double cell;
    int64_t *first; /* of each cell, −1 where there is none */
    int64_t *next;  /* of each row */
} grid;

static int64_t cell_of(double position, double cell, int64_t count) {
    return most(0, least(count - 1, (int64_t)(greater(position, 0) / cell)));
}

static bool is_same(const double *a, const double *b, double near, double like) {
    double x = a[0] - b[0], y = a[1] - b[1], smaller = lesser(a[SCALE], b[SCALE]), larger = greater(a[SCALE], b[SCALE]);
    return a[SIGN] == b[SIGN] && larger < like * smaller && sqrt(x * x + y * y) < near * smaller;
}

static bool is_again(const grid *g, const double *found, const double *row, double near, double like) {
    double reach = near * row[SCALE];
    int64_t left = cell_of(row[0] - reach, g->cell, g->columns), right = cell_of(row[0] + reach, g->cell, g->columns);
    int64_t top = cell_of(row[1] - reach, g->cell, g->rows), bottom = cell_of(row[1] + reach, g->cell, g->rows);
    for (int64_t y = top; y <= bottom; y++)
        for (int64_t x = left; x <= right; x++)
            for (int64_t k = g->first[y * g->columns + x]; k >= 0; k = g->next[k])
                if (is_same(found + FIELDS * k, row, near, like)) return true;
    return false;
}

/* Fill in the rows, in order, that are not an earlier one found again: of its sign, nearer than `near` scales of the smaller
   and of less than `like` times its scale. Return how many. */
EXPORT status distinct_rows(const double *found, int64_t n, double near, double like, double width, double height,
                            int64_t *kept, int64_t *count) {
    memory taken = {.count = 0};
    grid g = {.cell = greater(8, sqrt(width * height / 65536))};
    g.columns = (int64_t)(width / g.cell) + 1, g.rows = (int64_t)(height / g.cell) + 1;
    g.first = take(&taken, g.columns * g.rows, sizeof *g.first), g.next = take(&taken, n, sizeof *g.next);
    bool is_ready = g.first && g.next;
    *count = 0;
    if (is_ready) memset(g.first, 0xff, (size_t)(g.columns * g.rows) * sizeof *g.first);
    for (int64_t i = 0; is_ready && i < n; i++) {
        const double *row = found + FIELDS * i;
        if (is_again(&g, found, row, near, like)) continue;
        int64_t at = cell_of(row[1], g.cell, g.rows) * g.columns + cell_of(row[0], g.cell, g.columns);
        g.next[i] = g.first[at], g.first[at] = i;
        kept[(*count)++] = i;
    }
    give_back(&taken);
    return is_ready ? DONE : OUT_OF_MEMORY;
}

/* Blurred images of one size, the next one blurred more, and what their differences are compared with. */
typedef struct {
    const float *levels;
    int64_t height, width;
} stack;

static inline float dog(const stack *s, int64_t k, int64_t at) {
    const float *lower = s->levels + k * s->height * s->width;
    return lower[s->height * s->width + at] - lower[at];
}

/* Whether no neighbour in space or scale of a difference of a sign is beyond it. */
static bool is_extreme(const stack *s, int64_t k, int64_t y, int64_t x, float sign) {
    float here = sign * dog(s, k, y * s->width + x);
    const int64_t layers[3] = {k, k - 1, k + 1};
    for (int i = 0; i < 3; i++)
        for (int64_t row = most(y - 1, 0); row <= least(y + 1, s->height - 1); row++)
            for (int64_t column = most(x - 1, 0); column <= least(x + 1, s->width - 1); column++)
                if (sign * dog(s, layers[i], row * s->width + column) > here) return false;
    return true;
}

static inline float8 dog8(const float *lower, int64_t plane, int64_t away) {
    return load8(lower + plane + away) - load8(lower + away);
}

/* Which of eight differences are beyond the least, and none of the four beside them is beyond them; false where none is. */
static inline bool may_be_extreme(const float *lower, int64_t plane, int64_t width, float8 least, int32_t *is_likely) {
    const int64_t beside[4] = {-1, 1, -width, width};
    float8 here = dog8(lower, plane, 0);
    lanes8 is_positive = here > all8(0), likely = absolute8(here) > least;
    for (int i = 0; i < 4; i++) {
        float8 other = dog8(lower, plane, beside[i]);
        likely &= (is_positive & (other <= here)) | (~is_positive & (other >= here));
    }
    uint64_t words[4];
    memcpy(words, &likely, sizeof words), memcpy(is_likely, &likely, sizeof likely);
    return (words[0] | words[1] | words[2] | words[3]) != 0;
}

/* Fill in layer, row and column, and the sign, of the extremes among the differences of neighbouring images, as far as there is
   room; count them all. */
EXPORT void dog_extremes(const float *blurs, int64_t layers, int64_t height, int64_t width, double least_size, int32_t *found,
                         int64_t room, int64_t *count) {
    const stack s = {blurs, height, width};
    const float least = (float)least_size;
    int64_t n = 0;
    for (int64_t k = 1; k < layers - 2; k++)
        for (int64_t y = 0; y < height; y++)
            for (int64_t x = 0, ahead = 0; x < width; x += ahead) {
                const float *lower = blurs + (k * height + y) * width + x;
                int32_t is_likely[8] = {1};
                bool is_inner = y > 0 && y < height - 1 && x > 0 && x + 9 <= width;
                ahead = is_inner ? 8 : 1;
                if (is_inner && !may_be_extreme(lower, height * width, width, all8(least), is_likely)) continue;
                for (int64_t i = 0; i < ahead; i++) {
                    float here = lower[height * width + i] - lower[i];
                    if (!is_likely[i] || !(fabsf(here) > least) || !is_extreme(&s, k, y, x + i, here > 0 ? 1 : -1)) continue;
                    int32_t row[4] = {(int32_t)k, (int32_t)y, (int32_t)(x + i), here > 0 ? 1 : -1};
                    if (n < room) memcpy(found + 4 * n, row, sizeof row);
                    n++;
                }
            }
    *count = n;
}
