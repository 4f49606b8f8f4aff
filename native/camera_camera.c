/* Serves peaksim/camera/camera.py: the brown lens, as OpenCV's calib3d has it, and its inverse. */

#include <math.h>

#include "peak.h"

/* Steps of Newton's method, and the last step at which they end, in tan of the angle; 5·10⁻¹⁰ px at f = 500 px. */
enum { NEWTON_STEPS = 50 };
#define CONVERGED 1e-12
/* How far an undistorted point may miss its own image. */
#define MISSED 1e-9

/* OpenCV's 14 coefficients; the last two are in the sensor's tilt, a homography. */
typedef struct {
    double k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4;
} Lens;

/* A normalised point's image through a lens, and the derivative of that. */
typedef struct {
    double x, y, xx, xy, yx, yy;
} Distorted;

static Lens lens_of(const double *terms) {
    return (Lens){terms[0], terms[1], terms[2], terms[3], terms[4],  terms[5],
                  terms[6], terms[7], terms[8], terms[9], terms[10], terms[11]};
}

static Distorted distort(Lens lens, double x, double y) {
    const double r2 = x * x + y * y;
    const double top = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
    const double bottom = 1 + r2 * (lens.k4 + r2 * (lens.k5 + r2 * lens.k6));
    const double radial = top / bottom;
    const double slope =
        (lens.k1 + r2 * (2 * lens.k2 + 3 * r2 * lens.k3) - radial * (lens.k4 + r2 * (2 * lens.k5 + 3 * r2 * lens.k6))) /
        bottom;
    const double cross = 2 * x * y * slope + 2 * lens.p1 * x + 2 * lens.p2 * y;
    const double prism_x = 2 * (lens.s1 + 2 * r2 * lens.s2), prism_y = 2 * (lens.s3 + 2 * r2 * lens.s4);
    return (Distorted){
        .x = x * radial + (2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x)) + r2 * (lens.s1 + r2 * lens.s2),
        .y = y * radial + (lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y) + r2 * (lens.s3 + r2 * lens.s4),
        .xx = radial + 2 * x * x * slope + 2 * lens.p1 * y + 6 * lens.p2 * x + prism_x * x,
        .xy = cross + prism_x * y,
        .yx = cross + prism_y * x,
        .yy = radial + 2 * y * y * slope + 6 * lens.p1 * y + 2 * lens.p2 * x + prism_y * y,
    };
}

static double determinant(Distorted at) { return at.xx * at.yy - at.xy * at.yx; }

/* Whether a lens maps around a point without a fold, which tangential terms and prisms can make. */
static bool keeps_sides(Distorted at) { return determinant(at) > 0 && at.xx + at.yy > 0; }

/* Map a point by a 3×3 homography; nan on and beyond its horizon. */
static void map_by(const double *homography, double *point) {
    const double *h = homography, x = point[0], y = point[1];
    const double w = h[6] * x + h[7] * y + h[8];
    point[0] = w > 0 ? (h[0] * x + h[1] * y + h[2]) / w : NAN;
    point[1] = w > 0 ? (h[3] * x + h[4] * y + h[5]) / w : NAN;
}

/* Write normalised points' images, nan from the radius on at which the lens folds back. */
EXPORT void distort_brown(const double *flat, int64_t n, const double *terms, const double *tilt, double fold_radius,
                          double *out) {
    const Lens lens = lens_of(terms);
    for (int64_t k = 0; k < 2 * n; k += 2) {
        const double x = flat[k], y = flat[k + 1];
        const Distorted at = distort(lens, x, y);
        const bool is_seen = sqrt(x * x + y * y) < fold_radius && keeps_sides(at);
        out[k] = is_seen ? at.x : NAN;
        out[k + 1] = is_seen ? at.y : NAN;
        if (tilt) map_by(tilt, out + k);
    }
}

/* Whether a lens shows a normalised point at an image. */
static bool is_inverse(Lens lens, const double *point, const double *image, double fold_radius) {
    const Distorted at = distort(lens, point[0], point[1]);
    return fabs(at.x - image[0]) < MISSED && fabs(at.y - image[1]) < MISSED && keeps_sides(at) &&
           sqrt(point[0] * point[0] + point[1] * point[1]) < fold_radius;
}

/* Find the normalised point of an image by Newton's method from there, or from within the fold; nan if there is none. */
static void undistort(Lens lens, const double *image, double fold_radius, double *point) {
    const double radius = sqrt(image[0] * image[0] + image[1] * image[1]);
    const double inward = radius >= fold_radius ? 0.9 * fold_radius / radius : 1.0;
    point[0] = image[0] * inward;
    point[1] = image[1] * inward;
    for (int k = 0; k < NEWTON_STEPS; k++) {
        const Distorted at = distort(lens, point[0], point[1]);
        const double dx = image[0] - at.x, dy = image[1] - at.y, whole = determinant(at);
        const double step_x = (dx * at.yy - dy * at.xy) / whole, step_y = (dy * at.xx - dx * at.yx) / whole;
        point[0] += step_x;
        point[1] += step_y;
        if (!(fabs(step_x) > CONVERGED || fabs(step_y) > CONVERGED)) break;
    }
    if (!is_inverse(lens, point, image, fold_radius)) point[0] = point[1] = NAN;
}

/* Write the normalised points of images; `tilt` is from the tilted sensor to the plane across the optical axis. */
EXPORT void undistort_brown(const double *images, int64_t n, const double *terms, const double *tilt,
                            double fold_radius, double *out) {
    const Lens lens = lens_of(terms);
    for (int64_t k = 0; k < 2 * n; k += 2) {
        double image[2] = {images[k], images[k + 1]};
        if (tilt) map_by(tilt, image);
        undistort(lens, image, fold_radius, out + k);
    }
}
