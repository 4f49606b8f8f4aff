/* Small dense systems: Gaussian elimination with partial pivoting. */

#ifndef LINEAR_H
#define LINEAR_H

#include <math.h>
#include "peak.h"

/* Solve a x = b for the columns of b (n, m), which becomes x; a (n, n) is overwritten. False where a is singular. */
static inline bool solve(double *a, int64_t n, double *b, int64_t m) {
    for (int64_t k = 0; k < n; k++) {
        int64_t pivot = k;
        for (int64_t i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k])) pivot = i;
        if (!(fabs(a[pivot * n + k]) > 0.0)) return false;
        for (int64_t j = 0; pivot != k && j < n; j++) {
            double swapped = a[k * n + j];
            a[k * n + j] = a[pivot * n + j], a[pivot * n + j] = swapped;
        }
        for (int64_t j = 0; pivot != k && j < m; j++) {
            double swapped = b[k * m + j];
            b[k * m + j] = b[pivot * m + j], b[pivot * m + j] = swapped;
        }
        for (int64_t i = k + 1; i < n; i++) {
            double share = a[i * n + k] / a[k * n + k];
            for (int64_t j = k; j < n; j++) a[i * n + j] -= share * a[k * n + j];
            for (int64_t j = 0; j < m; j++) b[i * m + j] -= share * b[k * m + j];
        }
    }
    for (int64_t i = n - 1; i >= 0; i--)
        for (int64_t j = 0; j < m; j++) {
            double rest = b[i * m + j];
            for (int64_t k = i + 1; k < n; k++) rest -= a[i * n + k] * b[k * m + j];
            b[i * m + j] = rest / a[i * n + i];
        }
    return true;
}

#endif
