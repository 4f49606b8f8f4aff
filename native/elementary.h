/* exp, log, pow and trigonometry in plain double arithmetic: the same bits on every processor and with every compiler.

   Within about one unit in the last place (tests/peaksim/test_elementary.py), without branches where loops over them
   should use wide registers. Polynomials of log, sin, cos and atan: FreeBSD's msun (Sun Microsystems, 1993), which may
   be used freely with this notice. */

#ifndef ELEMENTARY_H
#define ELEMENTARY_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define PI 3.14159265358979323846

static inline uint64_t bits_of(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double of_bits(uint64_t bits) {
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* e^x = 2^k e^r with |r| ≤ ln 2 / 2; x is clamped to −708…709, so that nothing over- or underflows; nan stays nan. */
static inline double same_exp(double x) {
    const double shift = 0x1.8p52; /* added, it leaves x rounded to an integer in the lowest bits */
    x = x < -708.0 ? -708.0 : x;
    x = x > 709.0 ? 709.0 : x;
    double shifted = x * 1.44269504088896338700 + shift;
    double k = shifted - shift;
    double r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    double series = 1.0 / 6227020800.0;
    series = series * r + 1.0 / 479001600.0;
    series = series * r + 1.0 / 39916800.0;
    series = series * r + 1.0 / 3628800.0;
    series = series * r + 1.0 / 362880.0;
    series = series * r + 1.0 / 40320.0;
    series = series * r + 1.0 / 5040.0;
    series = series * r + 1.0 / 720.0;
    series = series * r + 1.0 / 120.0;
    series = series * r + 1.0 / 24.0;
    series = series * r + 1.0 / 6.0;
    series = series * r + 0.5;
    double value = 1.0 + (r + r * r * series);
    return value * of_bits((bits_of(shifted) << 52) + (UINT64_C(1023) << 52));
}

/* The natural logarithm of a positive normal number; others give nonsense, but no fault. */
static inline double same_log(double x) {
    uint64_t from = bits_of(x) - bits_of(0.70710678118654752440) + (UINT64_C(1023) << 52);
    double k = (double)((int64_t)(from >> 52) - 1023);
    double f = of_bits((from & UINT64_C(0xfffffffffffff)) + bits_of(0.70710678118654752440)) - 1.0;
    double s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
    double even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    double odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    return s * (half + even + odd) + k * 1.90821492927058770002e-10 - half + f + k * 6.93147180369123816490e-01;
}

/* x^y of a positive x; the error grows with |y log x|. */
static inline double same_pow(double x, double y) { return same_exp(y * same_log(x)); }

static inline double sine_near_zero(double x) {
    double z = x * x;
    double series = 8.33333333332248946124e-03 +
                    z * (-1.98412698298579493134e-04 +
                         z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    return x + z * x * (-1.66666666666666324348e-01 + z * series);
}

static inline double cosine_near_zero(double x) {
    double z = x * x, half = 0.5 * z, w = 1.0 - half;
    double series = 4.16666666666666019037e-02 +
                    z * (-1.38888888888741095749e-03 +
                         z * (2.48015872894767294178e-05 +
                              z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
    return w + (((1.0 - w) - half) + z * z * series);
}

/* Sine and cosine of an angle of at most 10⁶, rad. */
static inline void same_sincos(double x, double *sine, double *cosine) {
    double k = rint(x * 6.36619772367581382433e-01);
    double r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) - k * 2.02226624871116645580e-21;
    double s = sine_near_zero(r), c = cosine_near_zero(r);
    int64_t quarter = (int64_t)k;
    double a = quarter & 1 ? c : s, b = quarter & 1 ? s : c;
    *sine = quarter & 2 ? -a : a;
    *cosine = (quarter + 1) & 2 ? -b : b;
}

static inline double same_sin(double x) {
    double sine, cosine;
    same_sincos(x, &sine, &cosine);
    return sine;
}

static inline double same_cos(double x) {
    double sine, cosine;
    same_sincos(x, &sine, &cosine);
    return cosine;
}

static inline double same_tan(double x) {
    double sine, cosine;
    same_sincos(x, &sine, &cosine);
    return sine / cosine;
}

static inline double atan_series(double x) {
    double z = x * x, w = z * z;
    double odd = z * (3.33333333333329318027e-01 + w * (1.42857142725034663711e-01 + w * (9.09088713343650656196e-02 + w * (6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
    double even = w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
    return x * (odd + even);
}

static inline double same_atan(double x) {
    double size = fabs(x), value;
    if (size < 0.4375) {
        value = size - atan_series(size);
    } else if (size < 0.6875) {
        double t = (2.0 * size - 1.0) / (2.0 + size);
        value = 4.63647609000806093515e-01 - ((atan_series(t) - 2.26987774529616870924e-17) - t);
    } else if (size < 1.1875) {
        double t = (size - 1.0) / (size + 1.0);
        value = 7.85398163397448278999e-01 - ((atan_series(t) - 3.06161699786838301793e-17) - t);
    } else if (size < 2.4375) {
        double t = (size - 1.5) / (1.0 + 1.5 * size);
        value = 9.82793723247329054082e-01 - ((atan_series(t) - 1.39033110312309984516e-17) - t);
    } else {
        double t = -1.0 / size;
        value = 1.57079632679489655800e+00 - ((atan_series(t) - 6.12323399573676603587e-17) - t);
    }
    return x < 0.0 ? -value : value;
}

/* The direction of (x, y), −π…π rad; 0 of (0, 0). */
static inline double same_atan2(double y, double x) {
    if (x == 0.0) return y > 0.0 ? PI / 2 : y < 0.0 ? -PI / 2 : 0.0;
    double value = same_atan(y / x);
    return x > 0.0 ? value : y < 0.0 ? value - PI : value + PI;
}

#endif
