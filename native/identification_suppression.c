/* Serves peakmark/identification/suppression.py. */

#include <math.h>
#include "peak.h"

static bool suppresses(const double *better, double better_side, const double *other, double other_side, double apart,
                       bool by_larger, double like_size) {
    double larger = greater(better_side, other_side), smaller = lesser(better_side, other_side);
    if (larger > like_size * smaller) return false;
    double x = better[0] - other[0], y = better[1] - other[1];
    return !(sqrt(x * x + y * y) > apart * (by_larger ? larger : better_side));
}

/* Fill in the rows that lie outside the reach of all before them that are kept, and return how many. */
EXPORT int64_t kept_rows(const double *xy, int64_t n, const double *sides, double apart, bool by_larger,
                         double like_size, int64_t *rows) {
    int64_t count = 0;
    for (int64_t i = 0; i < n; i++) {
        bool is_kept = true;
        for (int64_t k = 0; k < count && is_kept; k++) {
            int64_t better = rows[k];
            is_kept = !suppresses(xy + 2 * better, sides[better], xy + 2 * i, sides[i], apart, by_larger, like_size);
        }
        if (is_kept) rows[count++] = i;
    }
    return count;
}
