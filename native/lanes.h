/* Sums in a fixed number of lanes: any register width, and any compiler, adds the same numbers in the same order. */

#ifndef LANES_H
#define LANES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#pragma GCC diagnostic ignored "-Wpsabi" /* lanes are passed between inlined functions only */

typedef double double4 __attribute__((vector_size(32)));
typedef float float4 __attribute__((vector_size(16)));
typedef float float8 __attribute__((vector_size(32)));
typedef int32_t lanes8 __attribute__((vector_size(32))); /* all bits of a lane are set where a comparison holds */
typedef uint32_t bits8 __attribute__((vector_size(32)));
typedef uint16_t shorts16 __attribute__((vector_size(32)));

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

static inline lanes8 load_lanes8(const int32_t *from) {
    lanes8 lanes;
    memcpy(&lanes, from, sizeof lanes);
    return lanes;
}

static inline bits8 load_bits8(const int32_t *from) { return (bits8)load_lanes8(from); }

static inline shorts16 load_shorts16(const uint16_t *from) {
    shorts16 lanes;
    memcpy(&lanes, from, sizeof lanes);
    return lanes;
}

static inline void store8(float *to, float8 lanes) { memcpy(to, &lanes, sizeof lanes); }

static inline float8 all8(float x) { return (float8){x, x, x, x, x, x, x, x}; }

static inline float8 absolute8(float8 x) { return (float8)((lanes8)x & ((lanes8){0} + INT32_MAX)); }

/* x where it is so, else 0. */
static inline float8 only8(lanes8 is_so, float8 x) { return (float8)(is_so & (lanes8)x); }

static inline float8 choose8(lanes8 is_first, float8 first, float8 second) {
    return (float8)((is_first & (lanes8)first) | (~is_first & (lanes8)second));
}

static inline float8 root8(float8 x) {
    float roots[8];
    store8(roots, x);
    for (int k = 0; k < 8; k++) roots[k] = sqrtf(roots[k]);
    return load8(roots);
}

static inline float lesser_of(float a, float b) { return a < b ? a : b; }

static inline float greater_of(float a, float b) { return a > b ? a : b; }

static inline float least8(float8 x) {
    return lesser_of(lesser_of(lesser_of(x[0], x[4]), lesser_of(x[1], x[5])), lesser_of(lesser_of(x[2], x[6]), lesser_of(x[3], x[7])));
}

static inline float most8(float8 x) {
    return greater_of(greater_of(greater_of(x[0], x[4]), greater_of(x[1], x[5])), greater_of(greater_of(x[2], x[6]), greater_of(x[3], x[7])));
}

/* e^x of x ≤ 80, within 1e-6 of itself from −16 on; below −86 as of −86. See same_exp in elementary.h; the polynomial is the one of its
   degree that errs least on |r| ≤ ln 2 / 2. */
static inline float8 exp8(float8 x) {
    const float8 shift = all8(0x1.8p23f);
    x = choose8(x > all8(-86.0f), x, all8(-86.0f));
    float8 shifted = x * all8(1.44269504f) + shift, k = shifted - shift, r = x - k * all8(0.69314718f);
    float8 series = all8(0.00829761947f) * r + all8(0.0419156293f);
    series = series * r + all8(0.166675765f);
    series = series * r + all8(0.499988927f);
    series = series * r + all8(0.999999691f);
    series = series * r + all8(1.00000007f);
    return (float8)((lanes8)series + ((lanes8)shifted << 23));
}

static inline double sum4(double4 lanes) { return (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]); }

static inline float sum8(float8 lanes) {
    float4 half, other;
    memcpy(&half, &lanes, sizeof half), memcpy(&other, (const char *)&lanes + sizeof half, sizeof other);
    half += other;
    return (half[0] + half[2]) + (half[1] + half[3]);
}

#endif
