/* What settles a candidate key point in OpenCV's own arithmetic: response, maximum, mask and Newton step. */

#ifndef SURF_EXACT_H
#define SURF_EXACT_H

#include "peak.h"

/* Bay's weight of Dxy² in the determinant, rounded as OpenCV's; peakmark.markers.patterns.DXY_WEIGHT. */
#define DXY_WEIGHT 0.81f

typedef struct {
    float xx, yy, xy;
} derivatives;

/* A step to the maximum near the middle of a cube of responses over layer, row and column. */
typedef struct {
    bool is_ok;
    float x, y, layer;
} newton_step;

enum { RECORD = 7 }; /* x, y, scale, size, response, octave, laplacian */

derivatives exact_derivatives(const uint32_t *sums, int64_t stride, int64_t corner, int64_t side);
float determinant_of(derivatives d);
float quick_response(const uint32_t *sums, int64_t stride, int64_t corner, int64_t side);
void fill_layer(const uint32_t *sums, int64_t stride, int64_t octave, int64_t index, int64_t i, int64_t j,
                bool exactly, float values[3][3]);
float strongest_neighbour(float cube[3][3][3]);
bool mask_accepts(const uint32_t *mask_sums, int64_t stride, int64_t corner, int64_t side);
newton_step newton_offset(float cube[3][3][3]);
void write_record(float *record, int64_t octave, int64_t index, int64_t i, int64_t j, float response, float trace,
                  newton_step step);

/* Index in the sums of a filter's corner, at grid position (i, j) of a layer. */
static inline int64_t corner_of(int64_t stride, int64_t octave, int64_t index, int64_t i, int64_t j) {
    int64_t offset = 4 + 3 * index;
    return ((i - offset) * stride + j - offset) * ((int64_t)1 << octave);
}

static inline int64_t side_of(int64_t octave, int64_t index) { return (9 + 6 * index) << octave; }

#endif
