/* Sums in a fixed number of lanes: any register width, and any compiler, adds the same numbers in the same order. */

#ifndef LANES_H
#define LANES_H

#include <string.h>

#pragma GCC diagnostic ignored "-Wpsabi" /* lanes are passed between inlined functions only */

typedef double double4 __attribute__((vector_size(32)));
typedef float float8 __attribute__((vector_size(32)));

static inline double4 load4(const double *from) {
    double4 lanes;
    memcpy(&lanes, from, sizeof lanes);
    return lanes;
}

static inline float8 load8(const float *from) {
    float8 lanes;
    memcpy(&lanes, from, sizeof lanes);
    return lanes;
}

static inline double sum4(double4 lanes) { return (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]); }

static inline float sum8(float8 lanes) {
    return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

#endif
