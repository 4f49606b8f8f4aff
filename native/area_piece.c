/* Serves peaksim/area/piece.py: the mean of a face over the pieces of pixels that `area_cut.c` lists. */

#include "area_polygon.h"
#include "area_texture.h"

/* Where a piece lies on its face. */
typedef struct {
    double u, v;  /* mean of its corners */
    double reach; /* largest distance from the first one along an axis */
} Extent;

/* Bring a piece of n corners into its face. */
static Extent clamp_piece(Polygon polygon, int64_t n, const double *face) {
    Extent extent = {0.0, 0.0, 0.0};
    for (int64_t i = 0; i < n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            polygon[i][axis] = clamp(polygon[i][axis], 0.0, face[EXTENT_P + axis]);
            extent.reach = greater(extent.reach, fabs(polygon[i][axis] - polygon[0][axis]));
        }
        extent.u += polygon[i][0] / (double)n;
        extent.v += polygon[i][1] / (double)n;
    }
    return extent;
}

/* The mean of a texture over n corners. */
static double polygon_mean(Sums sums, double contrast, const Polygon polygon, int64_t n, Extent extent) {
    const double area = area_of(polygon, n);
    if (extent.reach < POINT_TEXELS || fabs(area) < 1e-6 * extent.reach * extent.reach)
        return point_mean(sums, extent.u, extent.v);
    double total = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const double *from = polygon[i], *to = polygon[i + 1 < n ? i + 1 : 0];
        const int64_t steps = edge_steps(to[0] - from[0], to[1] - from[1], fabs(area), contrast);
        total += edge_integral(sums, from[0], from[1], to[0], to[1], steps);
    }
    return total / area;
}

/* Add the first n pieces of a band to `out`: share × light × mean of the face. */
EXPORT void add_pieces(const bool *printed, int64_t poses, int64_t faces, const double *table, const double *texels,
                       int64_t n_texels, int64_t count, double *polygons, int64_t n, const int64_t *pieces,
                       const double *shares, const double *light, int64_t lit, int64_t channels, float *out,
                       int64_t height, int64_t width) {
    (void)n_texels, (void)n, (void)lit, (void)height;
    for (int64_t k = 0; k < count; k++) {
        const int64_t *piece = pieces + PIECE_COLUMNS * k, size = piece[SIZE];
        const double *face = table + TABLE_COLUMNS * piece[FACE];
        const bool textured = printed[(poses > 1 ? piece[ROW] : 0) * faces + piece[FACE]];
        double (*polygon)[2] = ((Polygon *)polygons)[k];
        const Extent extent = clamp_piece(polygon, size, face);
        float *pixel = out + (piece[ROW] * width + piece[COLUMN]) * channels;
        double value = 0.0;
        for (int64_t channel = 0; channel < channels; channel++) {
            if (!textured)
                value = face[LEVEL + channel];
            else if (channel == 0 || face[PLANE] > 0.0)
                value = polygon_mean(sums_of(texels, face, channel), face[CONTRAST], (const double (*)[2])polygon, size,
                                     extent);
            add_level(pixel + channel, shares[k] * light[k * channels + channel] * value);
        }
    }
}
