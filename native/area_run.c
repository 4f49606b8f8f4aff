/* Serves peaksim/area/run.py: runs of pixels that one face fills, each the mean of the texture over its footprint.

   Neighbouring pixels share the line integrals of their edges, so a pixel costs two edges instead of four. */

#include "area_run.h"

#include "area_texture.h"

/* Steps of horizontal and of vertical edges, and the longest side in texels, over a run. */
typedef struct {
    int64_t across, down;
    double reach;
} Steps;

/* The steps that the first, the middle and the last of n pixels need. */
static Steps run_steps(const Corners corners, int64_t n, double contrast) {
    Steps steps = {1, 1, 0.0};
    for (int j = 0; j < 3; j++) {
        const int64_t k = (n - 1) * j / 2;
        const double u = corners[1][0][k], v = corners[1][1][k];
        const double du = corners[1][0][k + 1] - u, dv = corners[1][1][k + 1] - v;
        const double eu = u - corners[0][0][k], ev = v - corners[0][1][k];
        const double area = fabs(du * ev - dv * eu);
        steps.across = most(steps.across, edge_steps(du, dv, area, contrast));
        steps.down = most(steps.down, edge_steps(eu, ev, area, contrast));
        steps.reach = greater(steps.reach, greater(greater(fabs(du), fabs(dv)), greater(fabs(eu), fabs(ev))));
    }
    return steps;
}

/* The upright edge at which the last textured run of a row ended, which the next run may begin with. */
typedef struct {
    int64_t x, owner, steps;
    double integrals[MOST_CHANNELS];
} LastEdge;

/* Write the means of n pixels to every `channels`-th of `out`; `shared` holds the integrals of the upper edges if they
   are known, and receives those of the lower ones; `last` holds that of the first upright edge if this run is joined to
   another, and receives that of the last one. */
static void integrate_run(Sums sums, const Corners corners, int64_t n, Steps steps, bool known, double *shared,
                          bool is_joined, double *last, float *out, int64_t channels) {
    const double (*above)[CHUNK + 1] = corners[0], (*below)[CHUNK + 1] = corners[1];
    double upright[CHUNK + 1], lower[CHUNK], means[CHUNK];
    /* the next row of pixels begins where this one ends; its texels are seldom in the cache */
    const int64_t ahead =
        (int64_t)(below[1][n / 2] - above[1][n / 2]) * sums.stride + (int64_t)(below[0][n / 2] - above[0][n / 2]);
    upright[0] =
        is_joined ? *last : edge_integral(sums, above[0][0], above[1][0], below[0][0], below[1][0], steps.down);
    integrate_edges(sums, (Edges){above[0] + 1, above[1] + 1, below[0] + 1, below[1] + 1}, n, steps.down, ahead,
                    upright + 1);
    integrate_edges(sums, (Edges){below[0], below[1], below[0] + 1, below[1] + 1}, n, steps.across, 0, lower);
    if (!known)
        integrate_edges(sums, (Edges){above[0], above[1], above[0] + 1, above[1] + 1}, n, steps.across, 0, shared);
    for (int64_t k = 0; k < n; k++) {
        const double area = 0.5 * ((below[0][k + 1] - above[0][k]) * (below[1][k] - above[1][k + 1]) -
                                   (below[1][k + 1] - above[1][k]) * (below[0][k] - above[0][k + 1]));
        means[k] = (shared[k] + upright[k + 1] - lower[k] - upright[k]) / area;
        shared[k] = lower[k];
    }
    *last = upright[n];
    if (steps.reach < POINT_TEXELS)
        for (int64_t k = 0; k < n; k++)
            means[k] = point_mean(sums, 0.5 * (above[0][k] + below[0][k + 1]), 0.5 * (above[1][k] + below[1][k + 1]));
    for (int64_t k = 0; k < n; k++) out[k * channels] = (float)means[k];
}

/* Write a textured run of n pixels from x on. */
static void fill_run(const double *face, int64_t owner, const double *texels, const Corners corners, int64_t x,
                     int64_t n, bool known, double *shared, int64_t width, LastEdge *last, float *out,
                     int64_t channels) {
    const Steps steps = run_steps(corners, n, face[CONTRAST]);
    const bool is_joined = last->x == x && last->owner == owner && last->steps == steps.down;
    for (int64_t channel = 0; channel < channels; channel++) {
        if (channel == 0 || face[PLANE] > 0.0)
            integrate_run(sums_of(texels, face, channel), corners, n, steps, known, shared + channel * width + x,
                          is_joined, last->integrals + channel, out + channel, channels);
        else
            for (int64_t k = 0; k < n; k++) out[k * channels + channel] = out[k * channels];
    }
    last->x = x + n;
    last->owner = owner;
    last->steps = steps.down;
}

/* Write a run of n pixels of one level for each channel, or of the background's. */
static void fill_plain(const double *face, const double *background, int64_t owner, int64_t n, float *out,
                       int64_t channels) {
    for (int64_t k = 0; k < n; k++)
        for (int64_t channel = 0; channel < channels; channel++)
            out[k * channels + channel] = (float)(owner >= 0         ? face[LEVEL + channel]
                                                  : owner == NOTHING ? background[k * channels + channel]
                                                                     : 0.0);
}

/* Write a run of n pixels of a face whose levels are linear in its coordinates: those at the middle of each. */
static void fill_sloped(const FaceSides *sides, const double *face, Rays rays, int64_t y, int64_t x, int64_t n,
                        float *out, int64_t channels) {
    for (int64_t k = 0; k < n; k++) {
        Vector ray = {0.0, 0.0, 0.0};
        for (int corner = 0; corner < 4; corner++) {
            const double *to = corner_of(rays, y + corner / 2, x + k + corner % 2);
            for (int axis = 0; axis < 3; axis++) ray[axis] += to[axis];
        }
        const double w = dot((*sides)[DEPTH], ray), p = dot((*sides)[0], ray) / w, q = dot((*sides)[1], ray) / w;
        for (int64_t channel = 0; channel < channels; channel++) {
            const double *slope = face + SLOPE + 2 * channel;
            out[k * channels + channel] = (float)(face[LEVEL + channel] + slope[0] * p + slope[1] * q);
        }
    }
}

/* Where a run from x on ends whose pixels have one owner and whose upper edges are all known, or none. */
static int64_t known_end(const int64_t *owners, const int64_t *previous, int64_t x, int64_t end) {
    const bool known = previous[x] == owners[x];
    int64_t k = x + 1;
    while (k < end && (previous[k] == owners[x]) == known) ++k;
    return k;
}

/* Write a run of pixels from x on in row y, of one owner; return whether `shared` holds its lower edges. */
static bool write_run(Views views, Rays rays, const bool *printed, const FaceRow *table, const double *texels,
                      const double *background, int64_t owner, int64_t y, int64_t x, int64_t n, bool known,
                      double *shared, LastEdge *last, float *pixels, int64_t channels) {
    if (owner < 0 || !printed[(views.poses > 1 ? y : 0) * views.faces + owner]) {
        if (owner >= 0 && table[owner][IS_SLOPED] > 0.0)
            fill_sloped(sides_of(views, y, owner), table[owner], rays, y, x, n, pixels, channels);
        else
            fill_plain(owner >= 0 ? table[owner] : 0, background, owner, n, pixels, channels);
        return false;
    }
    Corners corners;
    footprints(on_texture(sides_of(views, y, owner), table[owner]), rays, y, x, n, corners);
    fill_run(table[owner], owner, texels, corners, x, n, known, shared, rays.columns - 1, last, pixels, channels);
    return true;
}

/* Write all pixels of a band that have an owner; the others become 0.

   Memory: `shared`, and `previous`, initially −1: whose lower edges `shared` holds. */
EXPORT void fill_owned(const double *rays, int64_t rows, int64_t columns, const double *sides, int64_t poses,
                       int64_t faces, const bool *printed, const double *table, const double *texels, int64_t n_texels,
                       const int64_t *owners, int64_t height, int64_t width, const double *background, int64_t channels,
                       double *shared, int64_t *previous, float *out) {
    const Rays corners = rays_of(rays, rows, columns);
    const Views views = {(const FaceSides *)sides, poses, faces};
    (void)n_texels;
    for (int64_t y = 0; y < height; y++) {
        const int64_t *row = owners + y * width;
        LastEdge last = {-1, NOTHING, 0, {0.0}};
        for (int64_t x = 0, end; x < width; x = end) {
            const bool known = poses == 1 && previous[x] == row[x];
            end = run_end(row, x, width);
            if (poses == 1) end = known_end(row, previous, x, end);
            const int64_t first = (y * width + x) * channels;
            const bool shares = write_run(views, corners, printed, (const FaceRow *)table, texels, background + first,
                                          row[x], y, x, end - x, known, shared, &last, out + first, channels);
            for (int64_t k = x; k < end; k++) previous[k] = shares ? row[x] : -1;
        }
    }
}
