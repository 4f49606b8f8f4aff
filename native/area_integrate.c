/* Serves peaksim/area/integrate.py: directions of the corners of pixels. */

#include "peak.h"

/* Write the directions with z = 1 of the pixel corners of a pinhole's rows, from those above row `first` on. */
EXPORT void pinhole_rays(int64_t first, double fx, double fy, double cx, double cy, double *rays, int64_t rows,
                         int64_t columns) {
    for (int64_t row = 0; row < rows; row++) {
        const double y = ((double)(first + row) - 0.5 - cy) / fy;
        for (int64_t column = 0; column < columns; column++, rays += 3) {
            rays[0] = ((double)column - 0.5 - cx) / fx;
            rays[1] = y;
            rays[2] = 1.0;
        }
    }
}
