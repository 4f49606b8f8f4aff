"""Round patterns: what of them is compared, the shapes of a coarse search, and where a circle's centre is seen."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from peakmark.markers.profile import DISC_RADIUS
from peakmark.refine.align import shape_grid

Values = NDArray[np.float64]

ROUND_SPAN, ROUND_EXTENT = 0.6, 0.75
"""Share of a round marker's side that is its unit in alignments, for it is level outside, and how far from its centre,
in units, it is compared: as far as it reaches however it is turned."""

GUESSED_FOCAL = 1.5
"""Factor, one σ, by which the longer side of an image is off as its focal length: phones have 0.7…1 of it."""

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
        turned = stretch @ np.array([[c, s], [-s, c]])
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


@dataclass(frozen=True)
class CircleViews:
    """The two poses of each of some circles that a known camera sees as ellipses; which it is shows nowhere."""

    centers: Values
    """(n, 2, 2) px where the centre is seen by either."""
    normals: Values
    """(n, 2, 3) of the circle's plane, camera frame, towards the camera."""

    @property
    def middle(self) -> Values:
        """(n, 2) px halfway between the two centres."""
        return np.asarray(self.centers.mean(axis=1))

    @property
    def aside(self) -> Values:
        """(n, 2) px from the middle to one of them; the other lies opposite."""
        return np.asarray((self.centers[:, 0] - self.centers[:, 1]) / 2)


def circle_views(xy: Values, affine: Values, camera_matrix: Values) -> CircleViews:
    """Return the poses of circles whose images are ellipses: `xy` (n, 2) + `affine` (n, 2, 2) u of the unit circle u.

    A circle of known camera has two poses (Chen et al. 2004, doi:10.1007/978-3-540-24672-5_36); its centre is seen at
    the pole of its plane's vanishing line. Seen squarely they are one.
    """
    ellipse = np.zeros((len(xy), 3, 3))
    ellipse[:, :2, :2], ellipse[:, :2, 2], ellipse[:, 2, 2] = affine, xy, 1.0
    to_circle = np.linalg.inv(ellipse) @ camera_matrix
    conic = to_circle.transpose(0, 2, 1) @ np.diag([1.0, 1.0, -1.0]) @ to_circle
    values, axes = np.linalg.eigh(conic)  # rising: one negative, two positive
    low, middle, high = values.T
    along = np.sqrt(np.maximum(high - middle, 0.0) / (high - low))[:, None] * axes[:, :, 2]
    across = np.sqrt(np.maximum(middle - low, 0.0) / (high - low))[:, None] * axes[:, :, 0]
    normals = np.stack([across + along, across - along], axis=1)
    points = np.linalg.solve(conic[:, None], normals[..., None])[..., 0] @ camera_matrix.T
    facing = np.sign(np.einsum("nki,ij,nj->nk", normals, np.linalg.inv(camera_matrix).T, ellipse[:, :, 2]))
    return CircleViews(points[..., :2] / points[..., 2:], normals * -facing[..., None])


def circle_centers(xy: Values, affine: Values, camera_matrix: Values) -> Values:
    """Return (2, 2) px where the centre of a circle may be seen whose image is an ellipse; the likelier is not known.

    The ellipse is `xy` + `affine` u of the unit circle u; any multiple of the affinity gives an ellipse that is nearly
    that of a concentric circle, so give that of the circle itself. See `circle_views`.
    """
    return np.asarray(circle_views(np.asarray(xy)[None], np.asarray(affine)[None], camera_matrix).centers[0])


@dataclass(frozen=True)
class DiscCenters:
    """Where the centres of printed discs may be seen."""

    xy: Values
    """(n, 2) px, the mean of all places."""
    aside: Values
    """(n, 2) px from there to one of the two places; the other lies opposite."""
    covariance: Values
    """(n, 2, 2) px², of the places."""
    normals: Values
    """(n, 2, 3) see `CircleViews`; the first belongs to `xy` + `aside`."""


def disc_centers(xy: Values, affine: Values, shape: tuple[int, ...], focal_px: float | None = None) -> DiscCenters:
    """Return the places of discs seen as ellipses at `xy` (n, 2) with affinities (n, 2, 2) px per side.

    In an image of a shape, whose middle the axis meets. Without a focal length it is about the longer side, and the
    places are those of three focal lengths (Gauss and Hermite's, of its logarithm) with their weights.
    """
    guess = float(max(shape) if focal_px is None else focal_px)
    factors = GUESSED_FOCAL ** (np.sqrt(3.0) * np.array([0.0, -1.0, 1.0])) if focal_px is None else np.ones(1)
    weights = np.array([4.0, 1.0, 1.0]) / 6 if focal_px is None else np.ones(1)
    middle = [(shape[1] - 1) / 2, (shape[0] - 1) / 2]
    matrices = [np.array([[f, 0, middle[0]], [0, f, middle[1]], [0, 0, 1]]) for f in guess * factors]
    views = [circle_views(xy, affine * DISC_RADIUS, matrix) for matrix in matrices]
    mean = np.einsum("f,fni->ni", weights, np.array([view.middle for view in views]))
    away = np.array([view.centers for view in views]) - mean[:, None]
    covariance = np.einsum("f,fnki,fnkj->nij", weights / 2, away, away)
    return DiscCenters(mean, views[0].aside, covariance, views[0].normals)
