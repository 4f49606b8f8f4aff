/* Serves peakmark/identification/trees.py. */

#include "peak.h"

/* Sums over the trees of the leaf that each row of evidence comes to; nan goes right. */
EXPORT void tree_sums(const int64_t *columns, int64_t n, const double *thresholds, const int64_t *left,
                      const int64_t *roots, int64_t trees, double baseline, const double *evidence, int64_t rows,
                      int64_t fields, double *sums) {
    (void)n;
    for (int64_t i = 0; i < rows; i++) {
        sums[i] = 0;
        for (int64_t t = 0; t < trees; t++) {
            int64_t node = roots[t];
            while (columns[node] >= 0) node = left[node] + !(evidence[i * fields + columns[node]] <= thresholds[node]);
            sums[i] += thresholds[node];
        }
        sums[i] += baseline;
    }
}
