/* Serves peaksim/area/light.py: the multiplier of linear grey levels over pixels and pieces, with shadows from meshes.

   What is baked is the mean of a map over the piece. Any other multiplier is computed at the piece's middle; where a
   mesh comes near the ray from there to the light, samples of the piece tell which share is lit. */

#include "area_light_map.h"
#include "area_polygon.h"
#include "area_rays.h"

enum { KIND, INTENSITY, VECTOR, REFERENCE = 5, SHADOWS, LIGHT_COLUMNS };
enum { AMBIENT, DIRECTIONAL, POINT };
enum { BLOCK = 32 };           /* most rows and columns of pixels that are lit together */
enum { MOST_NEAR = 16 };
enum { FEW = 16, MANY = 128 }; /* rays to a light for each triangle of a piece's fan */

#define LIFT_M 1e-5
/* Times the radius of a block's corners none of its pixels is farther from the middle, whatever the lens. */
#define CURVED 1.1

typedef double LightRow[LIGHT_COLUMNS];

/* Lights, and what casts shadows. */
typedef struct {
    const LightRow *lights;
    int64_t count;
    Solids solids;
} Lighting;

/* A polygon on a face, in the face's coordinates. */
typedef struct {
    const Vector *plane;
    const double *face;
    const double (*polygon)[2];
    int64_t n;
} FacePart;

/* For which part of a polygon a light is hidden. */
typedef enum { NOWHERE, PERHAPS, EVERYWHERE } Hidden;

/* The faces that may hide a light from a part of a polygon; of more than MOST_NEAR only their number counts. */
typedef struct {
    int64_t faces[MOST_NEAR], count;
} Near;

/* A ray to a light. */
typedef struct {
    Vector ray;
    double length, farthest; /* farthest: the ray parameter at which the light is */
} ToLight;

/* Write the world point (u, v) of a face. */
static void point_on_face(const Vector *plane, double u, double v, double *point) {
    for (int k = 0; k < 3; k++) point[k] = plane[0][k] + u * plane[1][k] + v * plane[2][k];
}

static ToLight ray_to_light(const double *light, const double *point) {
    ToLight to;
    const bool is_point = light[KIND] == POINT;
    double squares = 0.0;
    for (int k = 0; k < 3; k++) {
        to.ray[k] = light[VECTOR + k] - (is_point ? point[k] : 0.0);
        squares += to.ray[k] * to.ray[k];
    }
    to.length = sqrt(squares);
    to.farthest = is_point ? 1.0 : INFINITY;
    return to;
}

static double fraction(double a) { return a - floor(a); }

/* Whether a ray meets one of the faces near it before `farthest`. */
static bool meets_near(const Near *near, Solids solids, const double *origin, const double *ray, double farthest) {
    if (near->count > MOST_NEAR) return meets_any(solids, origin, ray, farthest);
    for (int64_t k = 0; k < near->count; k++) {
        const double t = intersect_face(solids.faces[near->faces[k]], origin, ray);
        if (0.0 < t && t < farthest) return true;
    }
    return false;
}

/* How many of some samples of the triangle (0, 0), u, v of a face, from a corner on, a light reaches past meshes. */
static int count_reached(FacePart part, const double *first, const double *u, const double *v, const double *lift,
                         const double *light, Solids solids, const Near *near, int samples) {
    int reached = 0;
    for (int sample = 0; sample < samples; sample++) {
        /* an even sequence in the square (Roberts 2018), folded into the triangle */
        double a = fraction(0.5 + 0.7548776662466927 * sample), b = fraction(0.5 + 0.5698402909980532 * sample);
        if (a + b > 1.0) {
            a = 1.0 - a;
            b = 1.0 - b;
        }
        Vector point;
        point_on_face(part.plane, first[0] + a * u[0] + b * v[0], first[1] + a * u[1] + b * v[1], point);
        for (int axis = 0; axis < 3; axis++) point[axis] += lift[axis];
        const ToLight to = ray_to_light(light, point);
        reached += !meets_near(near, solids, point, to.ray, to.farthest);
    }
    return reached;
}

/* The share of a polygon that a light reaches past the meshes. */
static double lit_share(FacePart part, const double *lift, const double *light, Solids solids, const Near *near,
                        int samples) {
    const double *first = part.polygon[0];
    double lit = 0.0, whole = 0.0;
    for (int64_t i = 1; i < part.n - 1; i++) {
        const double u[2] = {part.polygon[i][0] - first[0], part.polygon[i][1] - first[1]};
        const double v[2] = {part.polygon[i + 1][0] - first[0], part.polygon[i + 1][1] - first[1]};
        const double weight = fabs(u[0] * v[1] - v[0] * u[1]);
        const int reached = count_reached(part, first, u, v, lift, light, solids, near, samples);
        whole += weight;
        lit += weight * ((double)reached / samples);
    }
    return whole > 0.0 ? lit / whole : 1.0;
}

/* The lit share of a polygon from a few samples, and from many where a few do not agree. */
static double sampled_share(FacePart part, const double *lift, const double *light, Solids solids, const Near *near) {
    const double share = lit_share(part, lift, light, solids, near, FEW);
    return 0.0 < share && share < 1.0 ? lit_share(part, lift, light, solids, near, MANY) : share;
}

/* The square of a polygon's radius around a point, m². */
static double squared_radius(FacePart part, const double *middle) {
    double radius = 0.0;
    for (int64_t i = 0; i < part.n; i++) {
        Vector corner, away;
        point_on_face(part.plane, part.polygon[i][0], part.polygon[i][1], corner);
        for (int k = 0; k < 3; k++) away[k] = corner[k] - middle[k];
        radius = greater(radius, dot(away, away));
    }
    return radius;
}

/* How far a number may differ over a polygon of a radius, given how it grows with the place. */
static double spread_of(const double *slope, const double *lift, double radius) {
    double along = dot(slope, lift) / LIFT_M; /* the polygon is flat */
    return radius * sqrt(greater(dot(slope, slope) - along * along, 0.0));
}

static void cross(const double *a, const double *b, double *out) {
    for (int k = 0; k < 3; k++) out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* Which of parallel rays from a polygon, lifted, meet a face: see `intersect_face`. */
static Hidden meeting(const double *face, const double *middle, const double *lift, double radius, const double *ray) {
    const double *u = face + U, *v = face + V, doubt = 1e-6;
    Vector across, down, normal, away;
    cross(ray, v, across), cross(u, ray, down), cross(u, v, normal);
    const double det = dot(u, across), size = fabs(det);
    if (size <= doubt * sqrt(dot(normal, normal) * dot(ray, ray))) return PERHAPS;
    for (int k = 0; k < 3; k++) away[k] = middle[k] + lift[k] - face[k];
    const double a = dot(away, across) / det, b = dot(away, down) / det, t = dot(away, normal) / det;
    const double wide_a = spread_of(across, lift, radius) / size + doubt;
    const double wide_b = spread_of(down, lift, radius) / size + doubt, wide_t = spread_of(normal, lift, radius) / size;
    const bool is_quad = face[QUAD] != 0.0;
    /* how far the polygon's middle is inside of each side; triangles have one side less */
    const double sides[4] = {a, b, is_quad ? 1.0 - a : 1.0 - a - b, is_quad ? 1.0 - b : 1.0 - a - b};
    const double widths[4] = {wide_a, wide_b, is_quad ? wide_a : wide_a + wide_b, is_quad ? wide_b : wide_a + wide_b};
    bool all = t - wide_t > doubt;
    if (t + wide_t <= 0.0) return NOWHERE;
    for (int k = 0; k < 4; k++) {
        if (sides[k] + widths[k] <= 0.0) return NOWHERE;
        all &= sides[k] - widths[k] > 0.0;
    }
    return all ? EVERYWHERE : PERHAPS;
}

/* For which part of a polygon with a middle and a radius meshes hide a light; writes which faces may. */
static Hidden hidden_of(Solids solids, const double *middle, const double *lift, double radius, ToLight to,
                        Near *near) {
    Stack stack = stack_of(solids.count);
    const bool is_parallel = to.farthest == INFINITY;
    near->count = 0;
    while (stack.top > 0) {
        const int64_t node = stack.nodes[--stack.top], first = solids.links[node][0], n = solids.links[node][1];
        if (!meets_box(solids.boxes[node], middle, to.ray, radius + 2.0 * LIFT_M, to.farthest)) continue;
        if (n == 0) push_children(&stack, first);
        for (int64_t face = first; face < first + n; face++) {
            const Hidden by = is_parallel ? meeting(solids.faces[face], middle, lift, radius, to.ray) : PERHAPS;
            if (by == EVERYWHERE) return by;
            if (by == NOWHERE) continue;
            if (near->count < MOST_NEAR) near->faces[near->count] = face;
            near->count++;
        }
    }
    return near->count > 0 ? PERHAPS : NOWHERE;
}

/* The strength of a light on a face that it strikes, without distance. */
static double strength_of(const double *light, const double *lift, ToLight to) {
    return light[INTENSITY] * greater(dot(lift, to.ray) / (LIFT_M * to.length), 0.0);
}

/* What one light, not an ambient one, adds to the multiplier of a polygon with a middle and a radius. */
static double light_of(FacePart part, const double *middle, double radius, const double *lift, const double *light,
                       Solids solids) {
    const ToLight to = ray_to_light(light, middle);
    double strength = strength_of(light, lift, to);
    if (light[KIND] == POINT) {
        const double falloff = light[REFERENCE] / to.length;
        strength *= falloff * falloff;
    }
    if (strength > 0.0 && light[SHADOWS] > 0.0) {
        Near near;
        const Hidden hidden = hidden_of(solids, middle, lift, radius, to, &near);
        if (hidden == EVERYWHERE) return 0.0;
        if (hidden == PERHAPS) strength *= sampled_share(part, lift, light, solids, &near);
    }
    return strength;
}

/* Write a polygon's middle, and the lift of its side that an eye sees; return its radius. */
static double take_middle(FacePart part, const double *eye, double *middle, double *lift) {
    double u = 0.0, v = 0.0, facing = 0.0;
    for (int64_t i = 0; i < part.n; i++) {
        u += part.polygon[i][0] / (double)part.n;
        v += part.polygon[i][1] / (double)part.n;
    }
    point_on_face(part.plane, u, v, middle);
    for (int axis = 0; axis < 3; axis++) facing += part.face[NORMAL + axis] * (eye[axis] - middle[axis]);
    for (int axis = 0; axis < 3; axis++) lift[axis] = part.face[NORMAL + axis] * (facing >= 0.0 ? LIFT_M : -LIFT_M);
    return sqrt(squared_radius(part, middle));
}

/* Write the multiplier of all pixels of a block on one face, if it is the same; false where a light is a point, or
   something hides a part of one. */
static bool take_even_light(FacePart block, const double *eye, Lighting lighting, double *even) {
    Vector middle, lift;
    const double radius = CURVED * take_middle(block, eye, middle, lift);
    *even = 0.0;
    for (int64_t k = 0; k < lighting.count; k++) {
        const double *light = lighting.lights[k];
        if (light[KIND] == POINT) return false;
        const ToLight to = ray_to_light(light, middle);
        const double strength = light[KIND] == AMBIENT ? light[INTENSITY] : strength_of(light, lift, to);
        if (light[KIND] != AMBIENT && strength > 0.0 && light[SHADOWS] > 0.0) {
            Near near;
            const Hidden hidden = hidden_of(lighting.solids, middle, lift, radius, to, &near);
            if (hidden == PERHAPS) return false;
            if (hidden == EVERYWHERE) continue;
        }
        *even += strength;
    }
    return true;
}

/* The mean multiplier over a polygon that an eye sees. */
static double mean_light(FacePart part, const double *eye, Lighting lighting) {
    Vector middle, lift;
    double total = 0.0;
    const double radius = take_middle(part, eye, middle, lift);
    for (int64_t k = 0; k < lighting.count; k++) {
        const double *light = lighting.lights[k];
        total +=
            light[KIND] == AMBIENT ? light[INTENSITY] : light_of(part, middle, radius, lift, light, lighting.solids);
    }
    return total;
}

/* The mean of a map over the middle of a polygon and the points halfway from there to its corners. */
static double baked_mean(FacePart part, LightMap map, int64_t channel) {
    double u = 0.0, v = 0.0;
    for (int64_t i = 0; i < part.n; i++) {
        u += part.polygon[i][0] * map.across / (double)part.n;
        v += part.polygon[i][1] * map.down / (double)part.n;
    }
    double total = map_value(map, u, v, channel);
    for (int64_t i = 0; i < part.n; i++)
        total += map_value(map, 0.5 * (u + part.polygon[i][0] * map.across), 0.5 * (v + part.polygon[i][1] * map.down),
                           channel);
    return total / (double)(part.n + 1);
}

/* Write the light on the first `count` pieces of a band. */
EXPORT void light_pieces(const double *planes, int64_t faces, const double *table, const double *eyes, int64_t poses,
                         const double *lights, int64_t n_lights, const double *boxes, int64_t nodes,
                         const int64_t *links, const double *solids, int64_t n_solids, const int64_t *maps,
                         int64_t mapped, const float *texels, int64_t n_texels, int64_t channels, int64_t count,
                         const double *polygons, int64_t n, const int64_t *pieces, double *light, int64_t lit) {
    const Lighting lighting = {(const LightRow *)lights,
                               n_lights,
                               {(const Box *)boxes, (const Link *)links, (const SolidFace *)solids, n_solids}};
    (void)faces, (void)nodes, (void)n_texels, (void)n, (void)lit;
    for (int64_t k = 0; k < count; k++) {
        const int64_t *piece = pieces + PIECE_COLUMNS * k, face = piece[FACE];
        const double *eye = eyes + (poses > 1 ? 3 * piece[ROW] : 0), *row = table + TABLE_COLUMNS * face;
        const Vector *plane = (const Vector *)planes + 3 * face;
        const FacePart part = {plane, row, ((const Polygon *)polygons)[k], piece[SIZE]};
        const double plain = mean_light(part, eye, lighting);
        for (int64_t channel = 0; channel < channels; channel++) {
            double *sum = light + k * channels + channel;
            *sum = plain;
            if (mapped) {
                const LightMap map = map_of((const FaceMaps *)maps + face, texels, channels, row, plane, eye);
                *sum += baked_mean(part, map, channel);
            }
        }
    }
}

/* Pixels of a band that one face may fill: from row y, column x on, so many. */
typedef struct {
    int64_t y, x, rows, columns;
} Block;

/* A band, and what is lit in it. */
typedef struct {
    Rays rays;
    Views views;
    const Vector *planes;
    const FaceRow *table;
    const Vector *eyes;
    Lighting lighting;
    const int64_t *owners;
    int64_t width, channels;
    double *light;
} LitBand;

/* Write the corners of a block in a face's coordinates. */
static void block_on_face(const FaceSides *sides, Rays rays, Block block, double (*polygon)[2]) {
    for (int corner = 0; corner < 4; corner++) {
        const int64_t x = (corner + 1) / 2 % 2 ? block.x + block.columns : block.x;
        const double *ray = corner_of(rays, block.y + corner / 2 * block.rows, x), w = dot((*sides)[DEPTH], ray);
        for (int axis = 0; axis < 2; axis++) polygon[corner][axis] = dot((*sides)[axis], ray) / w;
    }
}

/* Whether all pixels of a block have the owner of its first one. */
static bool has_one_owner(const LitBand *band, Block block) {
    const int64_t *first = band->owners + block.y * band->width + block.x;
    for (int64_t y = 0; y < block.rows; y++)
        for (int64_t x = 0; x < block.columns; x++)
            if (first[y * band->width + x] != *first) return false;
    return true;
}

static void write_even(const LitBand *band, Block block, double mean) {
    for (int64_t y = block.y; y < block.y + block.rows; y++) {
        double *row = band->light + (y * band->width + block.x) * band->channels;
        for (int64_t k = 0; k < block.columns * band->channels; k++) row[k] = mean;
    }
}

/* Write the light on a block of one owner; false where it is uneven, and the block is no pixel. */
static bool light_block(const LitBand *band, Block block) {
    const int64_t face = band->owners[block.y * band->width + block.x];
    if (face < 0) return true;
    const double *eye = band->eyes[band->views.poses > 1 ? block.y : 0];
    double polygon[4][2], mean;
    const FacePart part = {band->planes + 3 * face, band->table[face], (const double (*)[2])polygon, 4};
    block_on_face(sides_of(band->views, block.y, face), band->rays, block, polygon);
    if (block.rows == 1 && block.columns == 1)
        mean = mean_light(part, eye, band->lighting);
    else if (!take_even_light(part, eye, band->lighting, &mean))
        return false;
    write_even(band, block, mean);
    return true;
}

/* Write the light on a block; parts of one that has several owners or uneven light are lit alone, down to pixels. */
static void light_parts(const LitBand *band, Block block) {
    const bool has_one_pose = block.rows == 1 || band->views.poses == 1;
    if (has_one_pose && has_one_owner(band, block) && light_block(band, block)) return;
    const int64_t rows = most(has_one_pose ? block.rows / 2 : 1, 1);
    const int64_t columns = most(has_one_pose ? block.columns / 2 : block.columns, 1);
    for (int64_t y = 0; y < block.rows; y += rows)
        for (int64_t x = 0; x < block.columns; x += columns)
            light_parts(band, (Block){block.y + y, block.x + x, least(rows, block.rows - y),
                                      least(columns, block.columns - x)});
}

/* Write the plain light on all pixels of a band that have an owner; see `light_pieces`. */
EXPORT void light_owned(const double *rays, int64_t rows, int64_t columns, const double *sides, int64_t poses,
                        int64_t faces, const double *planes, const double *table, const double *eyes,
                        const double *lights, int64_t n_lights, const double *boxes, int64_t nodes,
                        const int64_t *links, const double *solids, int64_t n_solids, const int64_t *owners,
                        int64_t height, int64_t width, double *light, int64_t channels) {
    const Lighting lighting = {(const LightRow *)lights,
                               n_lights,
                               {(const Box *)boxes, (const Link *)links, (const SolidFace *)solids, n_solids}};
    const LitBand band = {rays_of(rays, rows, columns),
                          {(const FaceSides *)sides, poses, faces},
                          (const Vector *)planes,
                          (const FaceRow *)table,
                          (const Vector *)eyes,
                          lighting,
                          owners,
                          width,
                          channels,
                          light};
    (void)nodes;
    for (int64_t y = 0; y < height; y += BLOCK)
        for (int64_t x = 0; x < width; x += BLOCK)
            light_parts(&band, (Block){y, x, least(BLOCK, height - y), least(BLOCK, width - x)});
}
