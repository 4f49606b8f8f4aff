/* Serves tests: each function of elementary.h over a column. */

#include "elementary.h"
#include "peak.h"

enum function { EXP, LOG, SIN, COS, TAN, ATAN };

EXPORT void elementary_values(int32_t function, const double *x, int64_t n, double *values) {
    switch (function) {
        case EXP: for (int64_t i = 0; i < n; i++) values[i] = same_exp(x[i]); break;
        case LOG: for (int64_t i = 0; i < n; i++) values[i] = same_log(x[i]); break;
        case SIN: for (int64_t i = 0; i < n; i++) values[i] = same_sin(x[i]); break;
        case COS: for (int64_t i = 0; i < n; i++) values[i] = same_cos(x[i]); break;
        case TAN: for (int64_t i = 0; i < n; i++) values[i] = same_tan(x[i]); break;
        case ATAN: for (int64_t i = 0; i < n; i++) values[i] = same_atan(x[i]); break;
    }
}

EXPORT void elementary_pairs(bool is_power, const double *x, int64_t n, const double *y, double *values) {
    for (int64_t i = 0; i < n; i++) values[i] = is_power ? same_pow(x[i], y[i]) : same_atan2(x[i], y[i]);
}
