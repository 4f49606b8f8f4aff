"""The camera's motion without a map: the markers seen so far, laid out on the floor, are the map of the next frame.

The floor is the plane z = 0 of a world of its own, in which the first frame stands above the origin and looks along
y. A chart holds where the tracked markers lie on it and how well that is known, as an information matrix; each frame
is a least-squares problem in its pose and the positions, and its pose is marginalised out of the chart afterwards (a
filter of the kind of Davison et al., MonoSLAM, 2007, doi:10.1109/TPAMI.2007.1049). Lengths are metric, for the
markers' side is known.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, transform

from peakmark.localise.distance import Values, unit_rays
from peakmark.localise.floor import floor_from_shapes, floor_of_pose, on_floor
from peakmark.localise.pose import STEP, level_tangents, moved
from peakmark.localise.residuals import Correspondences, Residuals, refined_sigmas

FEWEST_SHARED = 2
"""Markers of the chart that a frame must show."""

_WORST = 8.0
"""Whitened error from which a marker is not where it was laid out: another one, or a wrong track. A wide gate, for the
chart drifts."""

_FIXED = 1e8
"""Information that holds the first frame where it is: 0.1 mm and 0.1 mrad."""


class TrackedMarkers(NamedTuple):
    """One frame's tracked markers."""

    ids: NDArray[np.intp]
    """(n,) track ids."""
    xy: NDArray[np.float64]
    """(n, 2) centres, px."""
    affinity: NDArray[np.float64]
    """(n, 2, 2) shapes, px per side."""

    def rows(self, chosen: NDArray[np.bool_]) -> "TrackedMarkers":
        """Return a selection."""
        return TrackedMarkers(self.ids[chosen], self.xy[chosen], self.affinity[chosen])


@dataclass(frozen=True)
class Chart:
    """Markers laid out on the floor."""

    ids: NDArray[np.intp]
    """(k,) track ids."""
    positions_m: NDArray[np.float64]
    """(k, 2) on the plane z = 0."""
    information: NDArray[np.float64]
    """(2k, 2k) inverse covariance of the positions, row by row."""


def odometry(
    camera: Camera,
    side_m: float,
    frames: Iterable[tuple[ArrayLike, ArrayLike, ArrayLike]],
    sigma_px: float | None = None,
) -> Iterator[Pose | None]:
    """Yield `world_from_camera` of each frame in the world of the first frame that shows markers; None if lost.

    A frame is track ids (n,), centres (n, 2) px and shapes (n, 2, 2) px per side, which is `side_m` long. Centres and
    shapes are off by `sigma_px`, or by what `pose.refined_sigmas` says of each.
    """
    chart: Chart | None = None
    pose: Pose | None = None
    for ids, xy, affinity in frames:
        seen = TrackedMarkers(
            np.asarray(ids, np.intp),
            np.asarray(xy, float).reshape(-1, 2),
            np.asarray(affinity, float).reshape(-1, 2, 2),
        )
        placed = (
            start(camera, side_m, seen, sigma_px)
            if chart is None
            else advance(camera, side_m, chart, pose, seen, sigma_px)
        )
        if placed is not None:
            pose, chart = placed
        yield None if placed is None else pose


def start(
    camera: Camera, side_m: float, seen: TrackedMarkers, sigma_px: float | None = None
) -> tuple[Pose, Chart] | None:
    """Return the pose and the chart of a first frame; None if it shows fewer than `FEWEST_SHARED` markers."""
    floor = floor_from_shapes(camera, seen.xy, seen.affinity, side_m) if len(seen.ids) >= FEWEST_SHARED else None
    if floor is None:
        return None
    empty = Chart(np.empty(0, np.intp), np.empty((0, 2)), np.empty((0, 0)))
    return _solve(camera, side_m, empty, floor.floor_from_camera, seen, sigma_px, is_first=True)[:2]


def advance(
    camera: Camera,
    side_m: float,
    chart: Chart,
    before: Pose | None,
    seen: TrackedMarkers,
    sigma_px: float | None = None,
) -> tuple[Pose, Chart] | None:
    """Return the pose of one more frame and the chart after it; None if too few of the chart's markers fit.

    Markers that do not lie where the chart has them are left out. Markers of the chart that the frame does not show
    are dropped from it, once three times as many as shown are kept.
    """
    while np.isin(seen.ids, chart.ids).sum() >= FEWEST_SHARED:
        guess = _aligned(camera, side_m, chart, seen) if before is None else before
        pose, after, errors = _solve(camera, side_m, chart, guess, seen, sigma_px)
        if errors.max() <= _WORST:
            return pose, _forget(after, seen.ids)
        seen = seen.rows(np.arange(len(errors)) != np.argmax(errors))
    return None


def _solve(
    camera: Camera,
    side_m: float,
    chart: Chart,
    guess: Pose,
    seen: TrackedMarkers,
    sigma_px: float | None,
    is_first: bool = False,
) -> tuple[Pose, Chart, Values]:
    """Return the frame's pose, the chart with its markers, and the (n,) whitened errors of their centres."""
    prior = _with_new(camera, chart, guess, seen)
    rows = np.searchsorted(prior.ids, seen.ids)
    count = prior.positions_m.size
    root = _root(prior.information)
    residuals = _residuals(camera, side_m, seen, sigma_px)
    gauge = np.sqrt(_FIXED) * np.concatenate([guess[:3, :3][2:], guess[:3, :3][:2]])

    def errors(x: Values) -> Values:
        poses = np.stack([moved(guess, step) for step in x[:, :6]])
        positions = prior.positions_m + x[:, 6:].reshape(len(x), -1, 2)
        centers = np.concatenate([positions[:, rows], np.zeros((len(x), len(rows), 1))], axis=2)
        held = [x[:, :3] @ gauge[:1].T, x[:, 3:6] @ gauge[1:].T] if is_first else []
        return np.concatenate([residuals.at(poses, centers), x[:, 6:] @ root.T, *held], axis=1)

    def slopes(x: Values) -> Values:
        values = errors(x + np.concatenate([np.zeros((1, len(x))), STEP * np.eye(len(x))]))
        return np.asarray((values[1:] - values[0]).T / STEP)

    fit = scipy.optimize.least_squares(
        lambda x: errors(x[None])[0], np.zeros(6 + count), slopes, xtol=1e-7, ftol=1e-7, gtol=1e-7
    )
    positions = prior.positions_m + fit.x[6:].reshape(-1, 2)
    information = _marginal(fit.jac.T @ fit.jac, np.arange(6 + count) >= 6)
    off = np.linalg.norm(fit.fun[: 2 * len(rows)].reshape(-1, 2), axis=1)
    return moved(guess, fit.x[:6]), Chart(prior.ids, positions, information), off


def _residuals(camera: Camera, side_m: float, seen: TrackedMarkers, sigma_px: float | None) -> Residuals:
    center, shape = refined_sigmas(seen.affinity) if sigma_px is None else (sigma_px, sigma_px)
    centers, tangents = np.zeros((len(seen.ids), 3)), level_tangents(side_m, len(seen.ids))
    markers = Correspondences(seen.xy, centers, tangents, seen.affinity, sigma_px=center, shape_sigma_px=shape)
    return Residuals.of(camera, markers)


def _with_new(camera: Camera, chart: Chart, guess: Pose, seen: TrackedMarkers) -> Chart:
    """Return the chart, sorted by id, with a frame's new markers where they seem to lie, of which nothing is known."""
    new = ~np.isin(seen.ids, chart.ids)
    floor = floor_of_pose(guess)
    own = np.nan_to_num(on_floor(floor, unit_rays(camera, seen.xy[new])))
    world = transform(guess @ invert(floor.floor_from_camera), np.column_stack([own, np.zeros(len(own))]))[:, :2]
    ids, positions = np.concatenate([chart.ids, seen.ids[new]]), np.concatenate([chart.positions_m, world])
    information = np.pad(chart.information, (0, 2 * len(own)))
    order = np.argsort(ids)
    entries = (2 * order[:, None] + [0, 1]).ravel()
    return Chart(ids[order], positions[order], information[np.ix_(entries, entries)])


def _forget(chart: Chart, seen: NDArray[np.intp]) -> Chart:
    """Return the chart without its oldest markers out of view, so that it stays three times as large as the view."""
    spare = ~np.isin(chart.ids, seen)
    excess = max(0, len(chart.ids) - 3 * max(len(seen), FEWEST_SHARED))
    kept = np.ones(len(chart.ids), dtype=bool)
    kept[np.flatnonzero(spare)[:excess]] = False
    entries = np.repeat(kept, 2)
    return Chart(chart.ids[kept], chart.positions_m[kept], _marginal(chart.information, entries))


def _marginal(information: NDArray[np.float64], kept: NDArray[np.bool_]) -> Values:
    """Return the information about the kept entries when the others are unknown (Schur complement)."""
    if kept.all():
        return information
    a, b, d = (information[np.ix_(r, c)] for r, c in ((kept, kept), (kept, ~kept), (~kept, ~kept)))
    rest = a - b @ np.linalg.pinv(d, hermitian=True) @ b.T
    return np.asarray((rest + rest.T) / 2)


def _root(information: NDArray[np.float64]) -> Values:
    """Return R with RᵀR the information, which may be singular."""
    values, vectors = np.linalg.eigh(information)
    return np.asarray(np.sqrt(np.clip(values, 0, None))[:, None] * vectors.T)


def _aligned(camera: Camera, side_m: float, chart: Chart, seen: TrackedMarkers) -> Pose:
    """Return the pose that lays a frame's own floor onto the chart (Kabsch, in the plane)."""
    known = seen.rows(np.isin(seen.ids, chart.ids))
    floor = floor_from_shapes(camera, known.xy, known.affinity, side_m)
    assert floor is not None
    own = on_floor(floor, unit_rays(camera, known.xy))
    positions = chart.positions_m[np.searchsorted(chart.ids, known.ids)]
    a, b = own - own.mean(axis=0), positions - positions.mean(axis=0)
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    shift = positions.mean(axis=0) - rotation[:2, :2] @ own.mean(axis=0)
    return np.asarray(compose(rotation, [*shift, 0.0]) @ floor.floor_from_camera)
