/* What the kernels of peaksim.area share: columns of tables, and how faces and pixels lie in memory.

   A face's sides are vectors m, it lies where all m·d ≥ 0, see `peaksim.area.faces`; the last one is its depth w. */

#ifndef PEAKSIM_AREA_H
#define PEAKSIM_AREA_H

#include <math.h>

#include "peak.h"

/* Rows of `FaceViews.sides`. */
enum { DEPTH = 4, SIDES = 5 };
/* Columns of `Faces.table`. */
enum { START, STRIDE, PLANE, CONTRAST, EXTENT_P, EXTENT_Q, LEVEL, NORMAL = 9, MAP = 12, SLOPE = 18 };
enum { IS_SLOPED = 24, IS_QUAD, EXTENT_U, EXTENT_V, TABLE_COLUMNS };
/* How a face lies to a box of directions, or to a pixel. */
enum { OUTSIDE, TOUCHES, COVERS };
/* Owners of a pixel that are no face: only background; several faces or a face's edge; too many. */
enum { NOTHING = -1, MIXED = -2, CROWDED = -3 };
/* Columns of a list of pieces: pixel, face, number of vertices. */
enum { ROW, COLUMN, FACE, SIZE, PIECE_COLUMNS };
/* Most vertices of a polygon, and most pieces of one face in a pixel; further ones are dropped. */
enum { MAX_VERTICES = 24, MAX_PIECES = 64 };

/* Edges that are integrated together: whole registers, however wide. */
enum { LANES = 16 };

/* Grey, or red, green and blue. */
enum { MOST_CHANNELS = 3 };

/* Faces closer than this share of their depth are in one plane: the later one is visible. */
#define TIE 1e-9

typedef double Vector[3];
typedef double Line[3]; /* a + b·s + c·t over a pixel */
typedef Vector FaceSides[SIDES];
typedef double FaceRow[TABLE_COLUMNS];
typedef double Polygon[MAX_VERTICES][2];
typedef int64_t Piece[PIECE_COLUMNS];

/* Faces from one pose, or one for each row. */
typedef struct {
    const FaceSides *sides;
    int64_t poses, faces;
} Views;

/* Directions, or positions, of the corners of the pixels of a band. */
typedef struct {
    const Vector *corners;
    int64_t columns; /* one more than pixels in a row */
} Rays;

/* A number brought into a range; what is no number becomes the lower end. */
static inline double clamp(double a, double low, double high) { return a > low ? (a < high ? a : high) : low; }

static inline Rays rays_of(const double *rays, int64_t rows, int64_t columns) {
    (void)rows;
    return (Rays){(const Vector *)rays, columns};
}

static inline const FaceSides *sides_of(Views views, int64_t row, int64_t face) {
    return views.sides + (views.poses > 1 ? row : 0) * views.faces + face;
}

static inline const double *corner_of(Rays rays, int64_t y, int64_t x) { return rays.corners[y * rays.columns + x]; }

/* Add to a level, rounded once. */
static inline void add_level(float *level, double more) { *level = (float)(*level + more); }

/* Replace a face's coordinates by those of its texture. */
static inline void map_to_texels(const double *face, double *p, double *q) {
    const double *u = face + MAP, *v = u + 3, from_p = *p, from_q = *q;
    *p = u[0] + u[1] * from_p + u[2] * from_q;
    *q = v[0] + v[1] * from_p + v[2] * from_q;
}

static inline double dot(const double *m, const double *d) { return m[0] * d[0] + m[1] * d[1] + m[2] * d[2]; }

#endif
