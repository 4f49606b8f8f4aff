/* Windows of an image, and the patches that they are averaged to: see peakmark/surf/window.py. */

#ifndef SURF_WINDOW_H
#define SURF_WINDOW_H

#include "memory.h"
#include "peak.h"

enum {
    PATCH_SIDE = 21,  /* of the patch, px */
    PATCH_PITCH = 24, /* distance of the patch's columns in memory: PATCH_SIDE rounded up to whole vectors */
    VECTOR = 16,      /* samples that are interpolated together */
    BLOCK = 64,       /* rows and columns of samples that are located together: they stay in the first cache */
};

/* Each pixel of an image with the one below it, as upper | lower << 8, in rows `stride` long. */
typedef struct {
    const uint16_t *pairs;
    int64_t stride, height, width;
} paired;

/* Memory that one thread uses for one window after the other. */
typedef struct {
    float *starts;     /* x, then y of the first sample of each row of the window */
    int32_t *quads;    /* indices of a block of samples in the image, later the four pixels there */
    uint16_t *window;  /* the window, rows `pitch_of(side)` apart, and two more */
    uint16_t *weights; /* units that each patch cell covers of each pixel that it may reach into */
    int32_t *rows;     /* sum of the window's rows that fall into one row of the patch */
    int32_t *columns;  /* those sums, column by column, and two more */
    int32_t *patch;    /* the patch, column by column, and one more */
} buffers;

/* Distance of the rows of a window in memory: its side rounded up to whole vectors. */
static inline int64_t pitch_of(int64_t side) { return (side + VECTOR - 1) / VECTOR * VECTOR; }

bool take_buffers(buffers *b, int64_t largest_side, memory *taken);
void sample_rotated(const paired *image, float x, float y, float angle_deg, int64_t side, buffers *b);
void sample_upright(const paired *image, float x, float y, int64_t side, buffers *b);
void average_areas(int64_t side, buffers *b);

#endif
