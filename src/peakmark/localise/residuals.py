"""Errors of markers that a camera sees, in multiples of their σ, as a function of its pose."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera

from peakmark.localise.distance import Values

SIGMA_PX = 0.25
"""Assumed error of a centre and, at the ends of its sides, of a shape; refined markers stay below it."""

SIGMA_LOG_SIDE = 0.08
"""Assumed relative error of a side that SURF's scale measures; set by hand."""

ALIKE_PX = 0.2
"""σ of the length by which all sides of an image's dark markers, or all of its light ones, are too long; set by hand,
see `uncertainty.CENTER_FLOOR_PX`."""

_FAR = 1e3
"""Where a point behind the camera is projected to, in focal lengths: an error too large to prefer."""


@dataclass(frozen=True)
class MarkerFits:
    """Alignments of markers: their perspective, and how far all that they say is off, see `FitSpread`."""

    perspective: NDArray[np.float64]
    """(n, 2) a side; nan where it was not measured."""
    covariance: NDArray[np.float64]
    """(n, 8, 8) of centre, affinity and perspective."""
    drawn: NDArray[np.float64]
    """(n, 8, 2) error a true perspective."""

    @property
    def measurements(self) -> int:
        """Number of errors that tell something: seven a marker, five without a perspective."""
        return int(5 * len(self.perspective) + np.isfinite(self.perspective).sum())

    def __getitem__(self, rows: NDArray[np.intp]) -> "MarkerFits":
        return MarkerFits(self.perspective[rows], self.covariance[rows], self.drawn[rows])


@dataclass(frozen=True)
class Correspondences:
    """Markers as the camera sees them, with where they are in the world."""

    xy: NDArray[np.float64]
    """(n, 2) seen centres, px."""
    centers_m: NDArray[np.float64]
    """(n, 3) true centres, world."""
    tangents_m: NDArray[np.float64]
    """(n, 3, 2) two perpendicular directions in each marker's plane, as long as its side, world."""
    affinity: NDArray[np.float64] | None = None
    """(n, 2, 2) seen shapes, px per side; None uses the centres alone."""
    side_px: NDArray[np.float64] | None = None
    """(n,) seen sides (square roots of the areas), px, where there are no shapes."""
    sigma_px: float | NDArray[np.float64] = SIGMA_PX
    """Error that the residuals of centres, of all or (n,) each, are divided by."""
    shape_sigma_px: float | NDArray[np.float64] | None = None
    """The same for shapes; None: as for centres."""
    fits: MarkerFits | None = None
    """What the alignments say beside, and how far they are off, instead of both σ."""
    alike: NDArray[np.intp] | None = None
    """(n,) groups whose sides are all too long or too short by one length, of which `ALIKE_PX` is the σ."""


class Residuals(NamedTuple):
    """Errors of markers in multiples of their σ, as a function of the camera's pose."""

    seen: Correspondences
    flat: Values
    """(n, 2) x/z and y/z of the seen rays."""
    scale: Values
    """(n, 2, 2) px per unit of `flat`."""
    weights: Values | None
    """(n, 7, 7) that bring errors of centre, shape and perspective to unit covariance; None without `fits`."""
    drawn: Values | None
    """(n, 7, 2) those errors a true perspective."""
    shared: Values
    """(r, g) orthogonal directions of all errors that markers share, as long as what is taken off along each."""

    @classmethod
    def of(cls, camera: Camera, seen: Correspondences) -> "Residuals":
        """Prepare what does not depend on the pose."""
        rays = camera.unproject(seen.xy)
        flat, scale = rays[:, :2] / rays[:, 2:], pixels_per_slope(camera, seen.xy)
        if seen.fits is None or seen.affinity is None:
            return cls(seen, flat, scale, None, None, np.zeros((0, 0)))
        slopes = _fit_slopes(seen.affinity)
        covariance = slopes @ seen.fits.covariance @ np.swapaxes(slopes, 1, 2)
        weights = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
        return cls(seen, flat, scale, weights, slopes @ seen.fits.drawn, _shared(weights, seen.alike))

    def at(self, poses: NDArray[np.float64], centers_m: NDArray[np.float64] | None = None) -> Values:
        """Return (k, r) errors for (k, 4, 4) poses: 2n of the centres, then 3n of the shapes or n of the sides.

        With `fits` they are 7n, of each marker's centre, shape and perspective. A shape A is compared with the
        projected one B by A Aᵀ − B Bᵀ, which does not depend on the marker's rotation in its plane, along the axes of
        A. `centers_m` (k, n, 3) stands in for their own centres.
        """
        seen = self.seen
        flat, slopes, perspective = projected(
            poses, seen.centers_m if centers_m is None else centers_m, seen.tangents_m
        )
        centers, shapes = np.einsum("nij,knj->kni", self.scale, self.flat - flat), self.scale @ slopes
        if self.weights is not None:
            return self._together(centers, shapes, perspective)
        parts = [(centers / _column(seen.sigma_px)).reshape(len(poses), -1)]
        if seen.affinity is not None:
            sigma = _column(seen.sigma_px if seen.shape_sigma_px is None else seen.shape_sigma_px)
            parts.append((shape_errors(seen.affinity, shapes) / sigma).reshape(len(poses), -1))
        elif seen.side_px is not None:
            areas = np.abs(np.linalg.det(shapes))
            parts.append(np.log(seen.side_px**2 / np.maximum(areas, 1e-6)) / (2 * SIGMA_LOG_SIDE))
        return np.concatenate(parts, axis=1)

    def _together(self, centers: Values, shapes: Values, perspective: Values) -> Values:
        """Return (k, 7n) errors from those of the centres, and projected shapes and perspectives."""
        seen = self.seen
        assert self.weights is not None
        assert self.drawn is not None
        assert seen.affinity is not None
        assert seen.fits is not None
        turned = np.einsum(
            "knji,knj->kni", np.linalg.solve(shapes, np.broadcast_to(seen.affinity, shapes.shape)), perspective
        )
        gaps = np.nan_to_num(seen.fits.perspective - turned)
        errors = [centers, shape_errors(seen.affinity, shapes), gaps]
        each = np.concatenate(errors, axis=2) + np.einsum("nij,knj->kni", self.drawn, turned)
        white = np.einsum("nij,knj->kni", self.weights, each).reshape(len(centers), -1)
        return np.asarray(white - (white @ self.shared) @ self.shared.T) if self.shared.size else white


def _column(sigma: float | NDArray[np.float64]) -> Values:
    return np.asarray(sigma, dtype=np.float64).reshape(-1, 1)


def _fit_slopes(affinity: NDArray[np.float64]) -> Values:
    """Return (n, 7, 8) derivatives of the errors of centre, shape and perspective by what an alignment fits."""
    slopes = np.zeros((len(affinity), 7, 8))
    slopes[:, :2, :2] = slopes[:, 5:, 6:] = np.eye(2)
    axes, lengths, along = np.linalg.svd(affinity)
    turned = np.einsum("nri,njs->nijrs", axes, along)  # of Uᵀ dA V by dA
    both = turned[:, 0, 1] * lengths[:, 1, None, None] + turned[:, 1, 0] * lengths[:, 0, None, None]
    both = both / np.linalg.norm(lengths, axis=1)[:, None, None]
    slopes[:, 2:5, 2:6] = np.stack([turned[:, 0, 0], turned[:, 1, 1], both], axis=1).reshape(-1, 3, 4)
    return slopes


def _shared(weights: Values, alike: NDArray[np.intp] | None) -> Values:
    """Return the directions, see `Residuals.shared`, that bring errors to unit covariance where markers err alike.

    With V the whitened errors of one σ of each group, 1 + V Vᵀ is their covariance.
    """
    if alike is None:
        return np.zeros((0, 0))
    longer = weights[:, :, 2:5] @ (ALIKE_PX * np.array([1.0, 1.0, 0.0]))
    errors = (longer[:, :, None] * (alike[:, None] == np.unique(alike))[:, None]).reshape(longer.size, -1)
    lengths = np.linalg.norm(errors, axis=0)
    return np.asarray(errors / lengths * np.sqrt(1 - 1 / np.sqrt(1 + lengths**2)))


def pixels_per_slope(camera: Camera, xy: NDArray[np.float64]) -> Values:
    """Return (n, 2, 2) derivatives of the pixel by the ray's x/z and y/z, by central differences."""
    ends = xy + 0.5 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[:, None]
    rays = camera.unproject(ends.reshape(-1, 2)).reshape(4, -1, 3)
    flat = rays[:, :, :2] / rays[:, :, 2:]
    return np.asarray(np.linalg.inv(np.stack([flat[0] - flat[2], flat[1] - flat[3]], axis=2)))


def refined_sigmas(affinity: NDArray[np.float64]) -> tuple[Values, Values]:
    """Return (n,) errors, px, of the centres and of the shapes of (n, 2, 2) refined markers.

    Measured on 590 markers of a ride with motion blur and noise: a centre gains from all edges of the pattern, a
    shape trades against blur, which tells most on small markers. Shapes count half, for their errors are alike in a
    frame.
    """
    side_px = np.sqrt(np.abs(np.linalg.det(affinity)))
    return 0.01 + 0.4 / side_px, 0.08 + 120 / side_px**2


def projected(poses: NDArray[np.float64], centers_m: Values, tangents_m: Values) -> tuple[Values, Values, Values]:
    """Return (k, n, 2) x/z and y/z of points, (k, n, 2, 2) their derivatives along tangents, and (k, n, 2) perspective.

    That is by which share the depth grows along each tangent. Points behind the camera are far off.
    """
    rotations = poses[:, :3, :3]
    points = (centers_m - poses[:, None, :3, 3]) @ rotations
    along = np.swapaxes(rotations, 1, 2)[:, None] @ tangents_m
    depth = np.maximum(points[:, :, 2:], 1e-3)
    flat = np.where(points[:, :, 2:] > 0, points[:, :, :2] / depth, _FAR)
    slopes = (along[:, :, :2] - flat[..., None] * along[:, :, 2:]) / depth[..., None]
    return flat, slopes, along[:, :, 2] / depth


def shape_errors(affinity: NDArray[np.float64], expected: NDArray[np.float64]) -> Values:
    """Return (k, n, 3) errors in px at the ends of the sides: along both axes of the seen shape, and between them."""
    axes, lengths, _ = np.linalg.svd(affinity)
    spans = np.swapaxes(axes, 1, 2) @ expected
    excess = -spans @ np.swapaxes(spans, 2, 3)
    excess[..., [0, 1], [0, 1]] += lengths**2
    both = excess[..., 0, 1] / np.linalg.norm(lengths, axis=1)
    return np.stack([excess[..., 0, 0] / (2 * lengths[:, 0]), excess[..., 1, 1] / (2 * lengths[:, 1]), both], axis=-1)
