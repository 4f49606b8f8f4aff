/* Serves peakmark/refine/posture.py. */

#include <math.h>
#include <string.h>
#include "refine_align.h"

static const double CORRELATED_SIDE = 12.0; /* px, to which block means bring a larger pattern, at least */

/* Where a pattern lies: its centre, and what turns its points into pixels from there; and how well it correlates. */
typedef struct {
    double center[2], shape[4], score;
} posture;

static const double NO_SHAPE[4] = {0};

/* To block means from the image's own pixels, and back. */
static posture in_blocks(const double *at, const surroundings *around) {
    double block = (double)around->block;
    posture own = {{(at[0] - (double)around->left - (block - 1) / 2) / block, (at[1] - (double)around->top - (block - 1) / 2) / block}, {0}, 0};
    for (int k = 0; k < 4; k++) own.shape[k] = at[2 + k] / block;
    return own;
}

static void write_posture(const posture *own, const surroundings *around, double *at) {
    double block = (double)around->block;
    at[0] = block * own->center[0] + (block - 1) / 2 + (double)around->left;
    at[1] = block * own->center[1] + (block - 1) / 2 + (double)around->top;
    for (int k = 0; k < 4; k++) at[2 + k] = block * own->shape[k];
}

enum { POSTURE_STEPS = 4 };
static const double LONGEST_SHIFT = 0.1, LONGEST_STRETCH = 0.25;

static double within(double value, double limit) { return lesser(greater(value, -limit), limit); }

/* How far the pattern lies from where it was sampled, sides: a shift, and what its points differ by; false where the
   levels have no contrast. */
static bool find_offset(const coarse *search, const float *values, const double *slopes, double *offset) {
    int64_t count = (int64_t)search->count;
    double contrast = 0;
    for (int64_t i = 0; i < count; i++) contrast += (double)values[i] * search->expected[i];
    for (int k = 0; k < 6 && contrast > 0; k++) {
        double sum = 0;
        for (int64_t i = 0; i < count; i++) sum += slopes[k * count + i] * values[i];
        offset[k] = within(sum / contrast, k < 2 ? LONGEST_SHIFT : LONGEST_STRETCH);
    }
    return contrast > 0;
}

static void move_by(posture *here, const double *offset) {
    double m[4], back[4] = {1 - offset[2], -offset[3], -offset[4], 1 - offset[5]};
    memcpy(m, here->shape, sizeof m);
    here->center[0] -= m[0] * offset[0] + m[1] * offset[1], here->center[1] -= m[2] * offset[0] + m[3] * offset[1];
    here->shape[0] = m[0] * back[0] + m[1] * back[2], here->shape[1] = m[0] * back[1] + m[1] * back[3];
    here->shape[2] = m[2] * back[0] + m[3] * back[2], here->shape[3] = m[2] * back[1] + m[3] * back[3];
}

/* Steps of inverse compositional alignment (Baker & Matthews 2004, doi:10.1023/B:VISI.0000011205.11775.fd); kept is where
   the pattern correlates best. */
static posture improved(const coarse *search, picture soft, posture here, const double *slopes) {
    posture best = here;
    float values[MOST_SAMPLES];
    double offset[6];
    best.score = -INFINITY;
    for (int step = 0; step <= POSTURE_STEPS; step++) {
        sample(search, soft, here.center, here.shape, 1, 0, values);
        here.score = search->score(search, values);
        if (here.score > best.score) best = here;
        if (!find_offset(search, values, slopes, offset)) break;
        move_by(&here, offset);
    }
    return best;
}

/* Improve where the pattern lies, and fill in how well it correlates there and the levels at the points of a view. `slopes`
   tell from levels over their contrast how far it lies off. */
EXPORT status view_candidates(const uint8_t *gray, int64_t height, int64_t width, const double *xy, int64_t n,
                              const double *sides, const double *samples, int64_t sample_count, const double *expected,
                              const double *slopes, const double *viewed, int64_t view_count, double *postures,
                              double *found, float *views) {
    coarse search, view;
    status state = set_coarse(&search, samples, expected, sample_count, NO_SHAPE, 1, true);
    if (state == DONE) state = set_coarse(&view, viewed, viewed, view_count, NO_SHAPE, 1, true);
    for (int64_t i = 0; i < n && state == DONE; i++) {
        memory taken = {.count = 0};
        surroundings around;
        float values[MOST_SAMPLES] = {0};
        state = set_surroundings(&around, gray, height, width, xy + 2 * i, sides[i], CORRELATED_SIDE, false, &taken);
        found[i] = 0;
        if (state == DONE && !is_too_small(&around)) {
            posture best = improved(&search, around.soft, in_blocks(postures + 6 * i, &around), slopes);
            sample(&view, around.soft, best.center, best.shape, 1, 0, values);
            write_posture(&best, &around, postures + 6 * i);
            found[i] = best.score;
        }
        memcpy(views + view_count * i, values, (size_t)view_count * sizeof *views);
        give_back(&taken);
    }
    return state;
}
