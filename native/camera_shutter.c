/* Serves peaksim/camera/shutter.py: points in the frames of cameras. */

#include "peak.h"

/* Write world points in the frame of the one pose world_from_camera, or of as many. */
EXPORT void points_in_camera(const double *points, int64_t n, const double *poses, int64_t n_poses, double *out) {
    for (int64_t k = 0; k < n; k++) {
        const double *pose = poses + (n_poses > 1 ? 16 * k : 0), *point = points + 3 * k;
        const double x = point[0] - pose[3], y = point[1] - pose[7], z = point[2] - pose[11];
        for (int axis = 0; axis < 3; axis++)
            out[3 * k + axis] = x * pose[axis] + y * pose[4 + axis] + z * pose[8 + axis];
    }
}
