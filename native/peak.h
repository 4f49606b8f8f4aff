/* What every kernel shares: the types of the border with Python, and what is seen from there.

   A kernel is declared in the Python module that it serves, see sim/peaksim/native.py: an array is a pointer and,
   behind it, those of its lengths that no earlier array has named; a test compares both sides. Arrays are contiguous
   and never overlap; sizes and types were checked by Python, and are trusted here. */

#ifndef PEAK_H
#define PEAK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* What a kernel returns that may fail: Python raises MemoryError or ValueError. */
typedef int32_t status;
enum { DONE = 0, OUT_OF_MEMORY = 1, TOO_LARGE = 2 };

static inline int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
static inline int64_t most(int64_t a, int64_t b) { return a > b ? a : b; }
/* With a nan the second: as Python's min(a, b) and max(a, b), written (a, b), never are; mind the order. */
static inline double lesser(double a, double b) { return a < b ? a : b; }
static inline double greater(double a, double b) { return a > b ? a : b; }

#endif
