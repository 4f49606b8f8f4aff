/* The steps of an alignment, in even light (refine_align.c) and in any (refine_lit.c). */

#ifndef REFINE_ALIGN_H
#define REFINE_ALIGN_H

#include "refine_model.h"

enum {
    MOST_SAMPLES = 128,  /* of a coarse search */
    MIN_PIXELS = 24,     /* fewer are not fitted */
    BLOCK_PIXELS = 600,  /* most, about, that are compared with the block means */
    PIXELS = 3000,       /* and with the image itself */
};

#define HELD 1e12       /* precision of the prior that holds a parameter */
#define SHARP 0.1       /* variance of the blur, px², from which a fit to an image that was not softened starts */
#define LEVEL_SIDE 18.0 /* side, px, to which block means bring a larger pattern, at least; above it the first fit softens twice */

/* The points of a coarse search, padded to whole lanes, and the shapes that it tries. */
typedef struct coarse {
    int64_t padded;
    double count, spread;
    float u[MOST_SAMPLES], v[MOST_SAMPLES], expected[MOST_SAMPLES], used[MOST_SAMPLES];
    const double *shapes; /* (shape_count, 2, 2) sides to multiples of the size */
    int64_t shape_count;
    int64_t group;  /* shapes of one foreshortening that follow each other; 0 where all are tried */
    bool has_plane; /* a plane is taken out of the image first, so that a ramp of light costs nothing */
    double (*score)(const struct coarse *search, const float *values); /* how well levels at the points agree */
} coarse;

/* An image around a position: its own pixels, unless they are not wanted, block means in which the pattern has about
   LEVEL_SIDE px a side, and those softened. */
typedef struct {
    picture crop, level, soft;
    int64_t left, top, block;
} surroundings;

#define BLUR_SPREAD 5.0 /* standard deviation of the prior on the blur's variance in the last fit, px² */

/* A DoG's blur, size and contrast together look alike: its last fit takes it that an image is sharp. Both set by hand;
   scripts/evaluate_centers.py tells how exact and how honest that leaves centres and sizes. */
#define SHARP_SPREAD 1.0
#define PRINT_ERROR 0.004 /* of a DoG as it is printed in 256 levels, and drawn here between radii, over black to white */

/* A Gaussian prior, and which parameters are fitted at all. */
typedef struct {
    double mean[LIT], precision[LIT];
    bool used[LIT];
} prior;

/* When a fit ends: after so many steps, or one shorter than √enough standard deviations; it has converged when one is
   shorter than √converged. It also ends, without having converged, where its steps cannot bring the noise below a goal
   above 0. */
typedef struct {
    int64_t steps;
    double converged, enough, goal;
} patience;

static inline void hold(prior *before, int k) { before->precision[k] = HELD, before->mean[k] = 0, before->used[k] = false; }

/* A round pattern looks the same however it is turned: a21 stays 0. A disc is an ellipse in any perspective: g stays 0. */
static inline void hold_turn(const model *m, prior *before) {
    if (m->is_round) hold(before, 4);
    if (m->is_round && m->line_count == 2) hold(before, 6), hold(before, 7);
}

static inline bool is_graded(const model *m) { return m->is_round && m->line_count > 2; }

/* Precision of the prior on the blur's variance in the last fit. */
static inline double blur_precision(const model *m) {
    double spread = is_graded(m) ? SHARP_SPREAD : BLUR_SPREAD;
    return 1 / (spread * spread);
}

/* What residuals are weighed by: their mean square, and what the pattern itself may be off. */
static inline double weighed_by(const model *m, double noise, double gain) {
    return noise + (is_graded(m) ? PRINT_ERROR * PRINT_ERROR * gain * gain : 0);
}

typedef struct {
    double theta[LIT];
    double noise;  /* mean square of the residuals */
    double share;  /* mean weight of the pixels, 0…1 */
    double length; /* of the last step that was taken, in standard deviations squared */
    bool converged;
} fitted;

status set_coarse(coarse *search, const double *samples, const double *expected, int64_t count, const double *shapes,
                  int64_t shape_count, bool has_plane);
status set_surroundings(surroundings *around, const uint8_t *gray, int64_t height, int64_t width, const double *center,
                        double size, double level_side, bool has_crop, memory *taken);
bool is_too_small(const surroundings *around);
picture softened_picture(picture image, memory *taken);
EXPORT void softened(const float *image, int64_t height, int64_t width, float *rows, float *result);
void sample(const coarse *search, picture image, const double *center, const double *shape, double size, float level,
            float *values);
int64_t best_shape(const coarse *search, picture image, const double *center, double size, int64_t first, int64_t count,
                   double *score);
status read_pixels(const model *m, picture image, const double *theta, int64_t wanted, memory *taken, pixels *chosen);
fitted fit(model *m, const pixels *chosen, const double *start, const prior *before, patience limits);
status fit_picture(model *m, picture image, const double *start, int64_t wanted, const prior *before, patience limits,
                   fitted *result);
status fit_softly(model *m, const surroundings *around, const double *center, double size, const coarse *search,
                  const prior *before, double sigma, double hopeless, fitted *best, double *ratio, memory *taken);
status fill_sandwich(model *m, const pixels *chosen, const double *theta, double noise, const double *precision,
                     double *covariance, memory *taken);

#endif
