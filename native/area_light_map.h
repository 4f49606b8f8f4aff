/* Baked light: maps of multipliers, bilinear between the centres of their texels; see peaksim.area.light_map. */

#ifndef PEAKSIM_AREA_LIGHT_MAP_H
#define PEAKSIM_AREA_LIGHT_MAP_H

#include "area.h"

enum { MAP_START, MAP_ROWS, MAP_COLUMNS, MAP_NUMBERS };

typedef int64_t FaceMaps[2][MAP_NUMBERS];

/* One map on a face, and how many of its texels a unit of the face's coordinates has. */
typedef struct {
    const float *texels;
    int64_t channels, rows, columns;
    double across, down;
} LightMap;

/* A map at (u, v) texels, clamped at the border. */
static inline double map_value(LightMap map, double u, double v, int64_t channel) {
    const double x = clamp(u - 0.5, 0.0, (double)map.columns - 1.0), y = clamp(v - 0.5, 0.0, (double)map.rows - 1.0);
    const int64_t i = (int64_t)x, j = (int64_t)y;
    const double f = x - (double)i, g = y - (double)j;
    const int64_t right = i + 1 < map.columns ? map.channels : 0;
    const int64_t below = j + 1 < map.rows ? map.columns * map.channels : 0;
    const float *here = map.texels + (j * map.columns + i) * map.channels + channel;
    const double upper = here[0] + f * (double)(here[right] - here[0]);
    const double lower = here[below] + f * (double)(here[below + right] - here[below]);
    return upper + g * (lower - upper);
}

/* Which side of a face is seen: 0 for the one that its normal points to, else 1. */
static inline int facing_side(const Vector *plane, const double *face, const double *eye) {
    double facing = 0.0;
    for (int axis = 0; axis < 3; axis++) facing += face[NORMAL + axis] * (eye[axis] - plane[0][axis]);
    return facing < 0.0;
}

/* The map of the side of a face that is seen. */
static inline LightMap map_of(const FaceMaps *table, const float *texels, int64_t channels, const double *face,
                              const Vector *plane, const double *eye) {
    const int64_t *map = (*table)[facing_side(plane, face, eye)];
    return (LightMap){texels + map[MAP_START] * channels,
                      channels,
                      map[MAP_ROWS],
                      map[MAP_COLUMNS],
                      (double)map[MAP_COLUMNS] / face[EXTENT_P],
                      (double)map[MAP_ROWS] / face[EXTENT_Q]};
}

#endif
