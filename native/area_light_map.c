/* Serves peaksim/area/light_map.py: baked light on the pixels that one face fills. */

#include "area_light_map.h"

#include "area_run.h"

enum { MOST_SAMPLES = 8 };

/* Columns and rows of samples in a pixel. */
typedef struct {
    int64_t wide, high;
} Samples;

/* Samples a texel apart, or MOST_SAMPLES, in the pixels of a run of n pixels. */
static Samples count_samples(Corners corners, int64_t n, LightMap map) {
    double wide = 0.0, high = 0.0;
    for (int j = 0; j < 2; j++) {
        const int64_t k = (n - 1) * j;
        const double u = corners[1][0][k], v = corners[1][1][k];
        wide = greater(wide,
                       greater(fabs(corners[1][0][k + 1] - u) * map.across, fabs(corners[1][1][k + 1] - v) * map.down));
        high = greater(high, greater(fabs(corners[0][0][k] - u) * map.across, fabs(corners[0][1][k] - v) * map.down));
    }
    return (Samples){(int64_t)lesser(wide, MOST_SAMPLES - 1) + 1, (int64_t)lesser(high, MOST_SAMPLES - 1) + 1};
}

/* The sum of a map over the samples of pixel k of a run. */
static double sum_samples(LightMap map, Corners corners, int64_t k, Samples samples, int64_t channel) {
    double total = 0.0;
    for (int64_t j = 0; j < samples.high; j++) {
        const double t = ((double)j + 0.5) / (double)samples.high;
        for (int64_t i = 0; i < samples.wide; i++) {
            const double s = ((double)i + 0.5) / (double)samples.wide;
            const double a = (1.0 - s) * (1.0 - t), b = s * (1.0 - t), c = (1.0 - s) * t, d = s * t;
            double at[2];
            for (int axis = 0; axis < 2; axis++)
                at[axis] = a * corners[0][axis][k] + b * corners[0][axis][k + 1] + c * corners[1][axis][k] +
                           d * corners[1][axis][k + 1];
            total += map_value(map, at[0] * map.across, at[1] * map.down, channel);
        }
    }
    return total;
}

/* Multiply n pixels by the light that is given plus the mean of a map. */
static void light_run(LightMap map, Corners corners, int64_t n, const double *light, float *out) {
    const Samples samples = count_samples(corners, n, map);
    const double share = 1.0 / (double)(samples.wide * samples.high);
    for (int64_t k = 0; k < n; k++) {
        for (int64_t channel = 0; channel < map.channels; channel++) {
            const int64_t at = k * map.channels + channel;
            out[at] = (float)(out[at] * (light[at] + share * sum_samples(map, corners, k, samples, channel)));
        }
    }
}

/* Multiply all pixels of a band that have an owner by the plain light on them plus the baked one. */
EXPORT void light_owned_baked(const double *rays, int64_t rows, int64_t columns, const double *sides, int64_t poses,
                              int64_t faces, const double *planes, const double *table, const double *eyes,
                              const int64_t *maps, const float *texels, int64_t n_texels, int64_t channels,
                              const int64_t *owners, int64_t height, int64_t width, const double *light, float *out) {
    const Rays lattice = rays_of(rays, rows, columns);
    const Views views = {(const FaceSides *)sides, poses, faces};
    Corners corners;
    (void)n_texels;
    for (int64_t y = 0; y < height; y++) {
        for (int64_t x = 0, end; x < width; x = end) {
            const int64_t owner = owners[y * width + x], first = (y * width + x) * channels;
            end = run_end(owners + y * width, x, width);
            if (owner < 0) continue;
            const double *face = table + TABLE_COLUMNS * owner;
            footprints(on_face(sides_of(views, y, owner), face), lattice, y, x, end - x, corners);
            const LightMap map = map_of((const FaceMaps *)maps + owner, texels, channels, face,
                                        (const Vector *)planes + 3 * owner, eyes + (poses > 1 ? 3 * y : 0));
            light_run(map, corners, end - x, light + first, out + first);
        }
    }
}
