/* Serves peaksim/area/piece.py: the mean of a face over the pieces of pixels that `area_cut.c` lists. */

#include "area_polygon.h"
#include "area_texture.h"

/* Where a piece lies on its face. */
typedef struct {
    double u, v;  /* mean of its corners */
    double reach; /* largest distance from the first one along an axis */
} Extent;

/* Bring a piece of n corners into its face, and replace its coordinates by those of the face's texture. */
static Extent map_piece(Polygon polygon, int64_t n, const double *face) {
    Extent extent = {0.0, 0.0, 0.0};
    for (int64_t i = 0; i < n; i++) {
        for (int axis = 0; axis < 2; axis++) polygon[i][axis] = clamp(polygon[i][axis], 0.0, face[EXTENT_P + axis]);
        map_to_texels(face, &polygon[i][0], &polygon[i][1]);
        for (int axis = 0; axis < 2; axis++) {
            polygon[i][axis] = clamp(polygon[i][axis], 0.0, face[EXTENT_U + axis]);
            extent.reach = greater(extent.reach, fabs(polygon[i][axis] - polygon[0][axis]));
        }
        extent.u += polygon[i][0] / (double)n;
        extent.v += polygon[i][1] / (double)n;
    }
    return extent;
}

/* The centroid of n corners. */
static Extent centroid(const Polygon polygon, int64_t n) {
    const double *first = polygon[0];
    double area = 0.0, u = 0.0, v = 0.0;
    for (int64_t i = 1; i < n - 1; i++) {
        const double u1 = polygon[i][0] - first[0], v1 = polygon[i][1] - first[1];
        const double u2 = polygon[i + 1][0] - first[0], v2 = polygon[i + 1][1] - first[1];
        const double twice = u1 * v2 - u2 * v1;
        area += twice;
        u += twice * (u1 + u2) / 3.0;
        v += twice * (v1 + v2) / 3.0;
    }
    if (area == 0.0) return (Extent){first[0], first[1], 0.0};
    return (Extent){first[0] + u / area, first[1] + v / area, 0.0};
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
        const Extent extent = textured ? map_piece(polygon, size, face) : centroid((const double (*)[2])polygon, size);
        float *pixel = out + (piece[ROW] * width + piece[COLUMN]) * channels;
        double value = 0.0;
        for (int64_t channel = 0; channel < channels; channel++) {
            if (!textured)
                value = face[LEVEL + channel] + face[SLOPE + 2 * channel] * extent.u +
                        face[SLOPE + 2 * channel + 1] * extent.v;
            else if (channel == 0 || face[PLANE] > 0.0)
                value = polygon_mean(sums_of(texels, face, channel), face[CONTRAST], (const double (*)[2])polygon, size,
                                     extent);
            add_level(pixel + channel, shares[k] * light[k * channels + channel] * value);
        }
    }
}
