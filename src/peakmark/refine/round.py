"""Round patterns: what of them is compared, the shapes of a coarse search, and where a circle's centre is seen."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from peakmark.refine.align import shape_grid

Values = NDArray[np.float64]

ROUND_SPAN, ROUND_EXTENT = 0.6, 0.75
"""Share of a round marker's side that is its unit in alignments, for it is level outside, and how far from its centre,
in units, it is compared: as far as it reaches however it is turned."""

_RINGS = (0.09, 0.17, 0.25, 0.33, 0.44, 0.57, 0.7)
"""Radii of the coarse template, units."""

_BLUR = 0.05
"""Of the template, units."""


@cache
def round_shape_grid() -> Values:
    """Return the (k, 2, 2) shapes of round patterns, whose rotation shows nowhere: that which leaves a21 = 0."""
    shapes = []
    for shape in shape_grid()[:: 6 * 4]:  # of each foreshortening and direction, the first rotation and size
        stretch = shape / np.sqrt(abs(np.linalg.det(shape)))
        c, s = stretch[1, ::-1] / np.hypot(*stretch[1])
        turned = stretch @ np.array([[c, -s], [s, c]])
        shapes += [scale * turned for scale in (0.75, 0.9, 1.1, 1.33)]
    return np.array(shapes)


def round_template(radii: Values, levels: Values) -> tuple[Values, Values]:
    """Return (m, 2) points over a round pattern and its softened levels there, of mean 0."""
    angles = np.arange(8) * np.pi / 4
    rings = [radius * np.column_stack([np.cos(angles + k), np.sin(angles + k)]) for k, radius in enumerate(_RINGS)]
    samples = np.concatenate([np.zeros((1, 2)), *rings])
    line = np.linspace(-1, 1, 401)
    blur = np.exp(-(line**2) / (2 * _BLUR**2))
    shown = np.convolve(np.interp(np.abs(line), radii, levels), blur / blur.sum(), "same")
    values = np.interp(np.hypot(*samples.T), line, shown)
    return samples, values - values.mean()


def circle_centers(xy: Values, affine: Values, camera_matrix: Values) -> Values:
    """Return (2, 2) px where the centre of a circle may be seen whose image is an ellipse; the likelier is not known.

    The ellipse is `xy` + `affine` u of the unit circle u; any multiple of the affinity gives an ellipse that is nearly
    that of a concentric circle, so give that of the circle itself. A circle of known camera has two poses (Chen et al.
    2004, doi:10.1007/978-3-540-24672-5_36); its centre is seen at the pole of its plane's vanishing line. Seen squarely
    they are one.
    """
    to_circle = np.linalg.inv(np.vstack([np.column_stack([affine, xy]), [0.0, 0.0, 1.0]]))
    conic = camera_matrix.T @ to_circle.T @ np.diag([1.0, 1.0, -1.0]) @ to_circle @ camera_matrix
    values, axes = np.linalg.eigh(conic)  # rising: one negative, two positive
    low, middle, high = values
    along = np.sqrt(max(high - middle, 0.0) / (high - low))
    across = np.sqrt(max(middle - low, 0.0) / (high - low))
    normals = [along * axes[:, 2] * sign + across * axes[:, 0] for sign in (1.0, -1.0)]
    seen = [camera_matrix @ np.linalg.solve(conic, normal) for normal in normals]
    return np.array([point[:2] / point[2] for point in seen])
