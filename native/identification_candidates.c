/* Serves peakmark/identification/candidates.py. */

#include <math.h>
#include <string.h>
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
