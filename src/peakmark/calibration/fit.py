"""The fit: OpenCV's calibration to start from, then the weighted reprojection error over camera and poses.

The centres' errors are known up to a common factor (`refine` states them by size), which the fit's own residuals tell,
and with it the covariance of every parameter. Errors of one photograph are alike, for light, blur and the paper's shape
are: how far each photograph as a whole pulls at the lens tells a second factor, and the larger one counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert

from peakmark.calibration.lens import Lens, Values, lens_named
from peakmark.calibration.views import BoardView
from peakmark.errors import InputError

FEWEST_VIEWS = 3
"""Photographs below which a flat board does not tell a camera."""

WORST_MARKER = 5.0
"""Error of a marker, in its σ and the fit's factor, beyond which it is left out."""

WORST_VIEW = 3.0
"""Error of a view over that of the median view, beyond which it is left out: moved, bent, or out of focus."""


_LEAST_LEFT = 0.05
"""Of what a view tells of the lens, the share that the others tell too is taken as at least so much."""

_EXACT = 0.05
"""Whitened error below which nothing is an outlier: a twentieth of what is expected."""


@dataclass(frozen=True)
class ViewFit:
    """One photograph in the fit."""

    view: BoardView
    """With the markers that were used."""
    world_from_camera: Pose
    """(4, 4) on the board."""
    errors_px: NDArray[np.float64]
    """(n, 2) seen minus projected."""

    @property
    def rms_px(self) -> float:
        """Root mean square over x and y together."""
        return float(np.sqrt((self.errors_px**2).sum(axis=1).mean()))


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera."""

    camera: Camera
    """The camera."""
    parameters: tuple[str, ...]
    """Names of its parameters."""
    values: NDArray[np.float64]
    """(p,) their values."""
    covariance: NDArray[np.float64]
    """(p, p) of the values."""
    views: tuple[ViewFit, ...]
    """The photographs that were used."""
    dropped: tuple[tuple[str, str], ...]
    """Photographs that were not, and why."""
    markers_dropped: int
    """Markers of used photographs that fit nothing."""
    sigma_factor: float
    """Error of a centre over the expected one."""
    view_factor: float
    """The same by how far whole photographs pull at the camera; the larger of both scales the covariance."""

    @property
    def sigmas(self) -> NDArray[np.float64]:
        """(p,) standard deviations of the values."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def rms_px(self) -> float:
        """Reprojection error of all markers, root mean square over x and y together."""
        errors = np.concatenate([fit.errors_px for fit in self.views])
        return float(np.sqrt((errors**2).sum(axis=1).mean()))


def calibrate(views: Sequence[BoardView], size: tuple[int, int], lens: str = "brown5") -> Calibration:
    """Return the camera of (width, height) px that took photographs of one flat board.

    Parameters
    ----------
    views
        Three photographs or more, of different tilts; those that do not fit the others are left out.
    size
        Of the images, px.
    lens
        "pinhole", "brown4", "brown5", "brown8" or "fisheye": OpenCV's models and coefficients.

    Raises
    ------
    InputError
        If there are too few views, the lens is unknown, or they do not tell a camera.
    """
    chosen = lens_named(lens)
    if len(views) < FEWEST_VIEWS:
        raise InputError(f"expected {FEWEST_VIEWS} or more photographs that show the board, got {len(views)}")
    kept, dropped, markers_dropped = list(views), [], 0
    fit = _refined(kept, _start(kept, size, chosen), chosen)
    while True:
        worst = _worst_view(kept, fit)
        if worst is not None and len(kept) > FEWEST_VIEWS:
            index, reason = worst
            dropped.append((kept.pop(index).name, reason))
            fit = _Fit(fit.values, np.delete(fit.poses, index, axis=0), np.zeros((0, 0)), np.zeros(0))
        elif sum(map(np.count_nonzero, rejected := _outliers(kept, fit))):
            markers_dropped += int(sum(map(np.count_nonzero, rejected)))
            kept = [view.without(bad) for view, bad in zip(kept, rejected, strict=True)]
        else:
            break
        fit = _refined(kept, fit, chosen)
    return _calibration(kept, fit, chosen, size, tuple(dropped), markers_dropped)


@dataclass(frozen=True)
class _Fit:
    """Values of a fit."""

    values: Values
    """(p,) of the lens."""
    poses: Values
    """(v, 6) camera_from_world: rotation vector, m."""
    slopes: Values
    """(r, p + 6v) derivatives of the whitened residuals."""
    residuals: Values
    """(r,) whitened, view by view, x and y by turns."""


def _start(views: Sequence[BoardView], size: tuple[int, int], lens: Lens) -> _Fit:
    """Return OpenCV's calibration."""
    points = [view.points_m.astype(np.float64).reshape(-1, 1, 3) for view in views]
    seen = [view.xy.astype(np.float64).reshape(-1, 1, 2) for view in views]
    focal = 0.4 * size[0] if lens.model == "fisheye" else 0.9 * size[0]
    matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    try:
        if lens.model == "fisheye":
            flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
            flags |= cv2.fisheye.CALIB_USE_INTRINSIC_GUESS
            _, matrix, k, r, t = cv2.fisheye.calibrate(points, seen, size, matrix, np.zeros(4), flags=flags)
        else:
            single = [each.astype(np.float32) for each in points], [each.astype(np.float32) for each in seen]
            _, matrix, k, r, t = cv2.calibrateCamera(*single, size, matrix, np.zeros(8), flags=_flags(lens))
    except cv2.error as error:
        raise InputError(f"the photographs do not tell a {lens.name} camera: {' '.join(str(error).split())}") from error
    focals = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
    values = np.array([*focals, *k.ravel()[: len(lens.terms)]])
    poses = np.array([np.concatenate([a.ravel(), b.ravel()]) for a, b in zip(r, t, strict=True)])
    return _Fit(values, poses, np.zeros((0, 0)), np.zeros(0))


def _flags(lens: Lens) -> int:
    """Return OpenCV's flags that keep at 0 what the lens does not have."""
    flags = cv2.CALIB_USE_INTRINSIC_GUESS
    fixed = {"k1": cv2.CALIB_FIX_K1, "k2": cv2.CALIB_FIX_K2, "k3": cv2.CALIB_FIX_K3, "p1": cv2.CALIB_ZERO_TANGENT_DIST}
    for term, flag in fixed.items():
        flags |= 0 if term in lens.terms else flag
    return int(flags | (cv2.CALIB_RATIONAL_MODEL if "k4" in lens.terms else 0))


def _refined(views: Sequence[BoardView], start: _Fit, lens: Lens) -> _Fit:
    """Return the fit of least whitened error near a start (SciPy's trust region, exact derivatives)."""
    count = len(start.values)
    scale = np.concatenate([np.abs(start.values[:4]), np.full(count - 4, 0.1), np.ones(start.poses.size)])

    def unpacked(x: Values) -> tuple[Values, Values]:
        return x[:count], x[count:].reshape(-1, 6)

    def errors(x: Values) -> Values:
        values, poses = unpacked(x)
        return np.concatenate(
            [
                ((lens.project(values, pose, view.points_m)[0] - view.xy) / view.sigma_px[:, None]).ravel()
                for view, pose in zip(views, poses, strict=True)
            ]
        )

    def slopes(x: Values) -> Values:
        values, poses = unpacked(x)
        rows = np.zeros((2 * sum(len(view.xy) for view in views), len(x)))
        first = 0
        for number, (view, pose) in enumerate(zip(views, poses, strict=True)):
            _, by_lens, by_pose = lens.project(values, pose, view.points_m)
            part = slice(first, first := first + 2 * len(view.xy))
            weight = np.repeat(1 / view.sigma_px, 2)[:, None]
            rows[part, :count] = by_lens.reshape(-1, count) * weight
            rows[part, count + 6 * number : count + 6 * number + 6] = by_pose.reshape(-1, 6) * weight
        return rows

    x = np.concatenate([start.values, start.poses.ravel()])
    fit = scipy.optimize.least_squares(
        errors, x, slopes, x_scale=scale, xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=200
    )
    values, poses = unpacked(fit.x)
    return _Fit(values, poses, fit.jac, fit.fun)


def _per_view(views: Sequence[BoardView], fit: _Fit) -> list[Values]:
    """Return the (n, 2) whitened residuals of each view."""
    ends = np.cumsum([2 * len(view.xy) for view in views])[:-1]
    return [part.reshape(-1, 2) for part in np.split(fit.residuals, ends)]


def _worst_view(views: Sequence[BoardView], fit: _Fit) -> tuple[int, str] | None:
    """Return the view that fits much worse than the others, and the words for it; None without one."""
    rms = np.array([np.sqrt(np.median((part**2).sum(axis=1))) for part in _per_view(views, fit)])
    worst, middle = int(np.argmax(rms)), max(float(np.median(rms)), _EXACT)
    if rms[worst] <= WORST_VIEW * middle:
        return None
    return worst, f"fits {rms[worst] / middle:.1f} times worse than the others: moved, bent, or out of focus"


def _outliers(views: Sequence[BoardView], fit: _Fit) -> list[NDArray[np.bool_]]:
    """Return for each view which markers fit nothing."""
    parts = _per_view(views, fit)
    typical = max(np.median(np.abs(np.concatenate(parts))) / 0.6745, _EXACT)  # σ of a normal distribution
    found = [(np.abs(part) > WORST_MARKER * typical).any(axis=1) for part in parts]
    return [bad if (~bad).sum() >= 4 else np.zeros_like(bad) for bad in found]


def _calibration(
    views: Sequence[BoardView],
    fit: _Fit,
    lens: Lens,
    size: tuple[int, int],
    dropped: tuple[tuple[str, str], ...],
    markers_dropped: int,
) -> Calibration:
    unscaled = lens_covariance(fit.slopes, len(fit.values))
    spare = len(fit.residuals) - fit.slopes.shape[1]
    if spare < 1:
        raise InputError("expected more markers than unknowns; take more photographs of the board")
    factor = float(np.sqrt((fit.residuals**2).sum() / spare))
    by_views = factor_by_views(fit.residuals, fit.slopes, [2 * len(view.xy) for view in views], unscaled)
    covariance = np.asarray(max(factor, by_views) ** 2 * unscaled, dtype=np.float64)
    errors = [-part * view.sigma_px[:, None] for part, view in zip(_per_view(views, fit), views, strict=True)]
    poses = [invert(compose(cv2.Rodrigues(pose[:3])[0], pose[3:])) for pose in fit.poses]
    fits = tuple(ViewFit(view, pose, each) for view, pose, each in zip(views, poses, errors, strict=True))
    camera = lens.camera(size, fit.values)
    return Calibration(
        camera, lens.parameters, fit.values, covariance, fits, dropped, markers_dropped, factor, by_views
    )


def lens_covariance(slopes: Values, count: int) -> Values:
    """Return the (count, count) covariance of the first parameters, from derivatives of residuals of unit variance."""
    return np.asarray(np.linalg.inv(slopes.T @ slopes)[:count, :count])


def factor_by_views(residuals: Values, slopes: Values, sizes: Sequence[int], unscaled: Values) -> float:
    """Return by how much a fit's σ must grow because the errors of one view are alike; 1 on average where they are not.

    Each view pulls at the p parameters of the lens, with its own pose free, by some multiple of what independent errors
    would; the mean square over views and parameters counts, corrected for what a view draws the fit towards itself
    (Bell and McCaffrey's CR2, Survey Methodology 28, 2002). `sizes` are the residuals of each view, `unscaled` is
    `lens_covariance`.
    """
    count = len(unscaled)
    spread, axes = np.linalg.eigh(unscaled)
    root = axes * np.sqrt(np.maximum(spread, 0.0)) @ axes.T
    squares, first = 0.0, 0
    for number, size in enumerate(sizes):
        rows = slice(first, first := first + size)
        by_lens, by_pose = slopes[rows, :count], slopes[rows, count + 6 * number : count + 6 * number + 6]
        free = by_lens - by_pose @ np.linalg.lstsq(by_pose, by_lens, rcond=None)[0]
        share, directions = np.linalg.eigh(root @ free.T @ free @ root)
        pull = directions.T @ root @ free.T @ residuals[rows]
        squares += float((pull**2 / np.maximum(1 - share, _LEAST_LEFT)).sum())
    return float(np.sqrt(squares / count))
