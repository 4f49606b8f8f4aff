/* Which instructions this processor has; compiled for any, so that it can be asked before anything else runs. */

#include "peak.h"

#if defined(__x86_64__) || defined(_M_X64)
#include <cpuid.h>

enum { SSE4_2 = 1 << 20, POPCNT = 1 << 23, OSXSAVE = 1 << 27, AVX = 1 << 28, AVX2 = 1 << 5, YMM_STATE = 6 };

static unsigned saved_by_system(void) {
    unsigned low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

/* 0: older than x86-64-v2; 1: x86-64-v2; 2: AVX2 too, and the system saves its registers. */
EXPORT int32_t cpu_level(void) {
    unsigned a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & SSE4_2) || !(c & POPCNT)) return 0;
    if (!(c & OSXSAVE) || !(c & AVX) || (saved_by_system() & YMM_STATE) != YMM_STATE) return 1;
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & AVX2) ? 2 : 1;
}
#else
EXPORT int32_t cpu_level(void) { return 1; }
#endif
