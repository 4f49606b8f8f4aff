/* Memory that a kernel needs for itself: taken piece by piece, given back at once. */

#ifndef MEMORY_H
#define MEMORY_H

#include <stdlib.h>
#include "peak.h"

enum { MOST_BLOCKS = 16 };

typedef struct {
    void *blocks[MOST_BLOCKS];
    int count;
} memory;

/* Room for so many items, not cleared; NULL where there is none, or too many were taken. */
static inline void *take(memory *taken, int64_t items, size_t bytes_each) {
    if (taken->count == MOST_BLOCKS) return NULL;
    void *block = malloc((size_t)most(items, 1) * bytes_each);
    if (block) taken->blocks[taken->count++] = block;
    return block;
}

static inline void give_back(memory *taken) {
    while (taken->count) free(taken->blocks[--taken->count]);
}

#endif
