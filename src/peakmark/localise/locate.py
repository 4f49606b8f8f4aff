"""Where the camera is, from the markers it sees and a map of where they lie; no marker carries an identity.

    seen markers ─▶ floor (`floor`) ─▶ arrangements (`match`) ─▶ poses (`pose`) ─▶ decision

The floor under the camera follows from the markers' sizes and shapes, so neither its height nor its tilt need be
known. Laid out on that floor, the seen markers are moved onto the map in every way that fits; each way is refined
and weighed by what it explains. The best is taken only if no other comes near: a straight, even row of markers looks
the same one marker on, and then the answer is None.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, pose_distance, rigid, rotation_about, transform

from peakmark.errors import InputError
from peakmark.localise.distance import Values, unit_rays
from peakmark.localise.floor import Floor, floor_from_areas, floor_from_shapes, on_floor
from peakmark.localise.match import Arrangement, arrangements
from peakmark.localise.pose import PoseEstimate, expected_shapes, level_tangents, refine_pose
from peakmark.localise.residuals import SIGMA_PX, Correspondences, refined_sigmas

FEWEST = 4
"""Matched markers that a pose needs where their shapes are known."""

FEWEST_WITHOUT_SHAPES = 6
"""The same where only their sizes are: four or five centres fit a wrong part of a large map by chance."""

OUTLIER_COST = 6.0
"""Log-likelihood that a seen marker costs which is not on the map; also the largest cost of a matched one: 3.5 σ."""

MISSED_COST = 3.0
"""Log-likelihood that a marker of the map costs which should be seen and is not: one in twenty is missed."""

_WORST = 6.0
"""Error of a centre, in its σ and in the median of all, beyond which a marker is left out of the final pose."""

_SURELY_SEEN_PX = 22.0
"""Side from which a marker that is well inside the image should have been found."""

_GATES = (1.5, 0.6)
"""Distances, in sides, up to which seen and expected markers are paired, before the final one of a few σ."""


@dataclass(frozen=True)
class FloorMap:
    """Markers on one level floor."""

    centers_m: NDArray[np.float64]
    """(m, 3) world, all of one height."""
    side_m: float
    """Side of the printed patterns, metres."""

    def __post_init__(self) -> None:
        centers = np.asarray(self.centers_m, dtype=np.float64)
        if centers.ndim != 2 or centers.shape[1:] != (3,) or not np.isfinite(centers).all():
            raise InputError(f"map: expected finite (m, 3) centres, got shape {centers.shape}")
        if len(centers) and np.ptp(centers[:, 2]) > 1e-3:
            raise InputError(
                f"map: expected markers on one level, got heights {centers[:, 2].min()}…{centers[:, 2].max()} m"
            )
        if not self.side_m > 0:
            raise InputError(f"map: expected a side above 0 m, got {self.side_m}")
        object.__setattr__(self, "centers_m", centers)


@dataclass(frozen=True)
class Located(PoseEstimate):
    """A pose, its rival the next arrangement, and which marker was which."""

    marker_of: NDArray[np.intp]
    """(n,) index into the map of each seen marker, −1 for those that are not on it."""

    @property
    def world_from_camera(self) -> Pose:
        """(4, 4)."""
        return self.fit.world_from_camera


def locate(
    camera: Camera,
    floor_map: FloorMap,
    xy: ArrayLike,
    affinity: ArrayLike | None = None,
    side_px: ArrayLike | None = None,
    *,
    sigma_px: float = SIGMA_PX,
    near: Pose | None = None,
    within_m: float = 0.15,
    within_deg: float = 10.0,
) -> Located | None:
    """Return the camera's pose in the map, or None where the markers do not tell it beyond doubt.

    Parameters
    ----------
    camera
        The camera.
    floor_map
        Where the markers are.
    xy
        (n, 2) seen centres, px.
    affinity
        (n, 2, 2) seen shapes, px per side; without them `side_px` serves, less precisely.
    side_px
        (n,) square roots of the image areas, px; ignored where `affinity` is given.
    sigma_px
        Error of the seen centres and shapes.
    near
        A pose expected from tracking; only poses within `within_m` and `within_deg` of it are considered, which
        settles most doubts. None considers the whole map.

    Raises
    ------
    InputError
        If neither `affinity` nor `side_px` is given, or their lengths differ from that of `xy`.
    """
    seen = _check(xy, affinity, side_px)
    if len(seen[0]) < _fewest(affinity is not None):
        return None
    near = None if near is None else rigid(near, "near")
    guesses = [near] if near is not None else _guesses(camera, floor_map, *seen)
    settled = (_settle(camera, floor_map, *seen, guess, sigma_px) for guess in guesses)
    candidates = [c for c in settled if c is not None and (near is None or _is_near(c, near, within_m, within_deg))]
    found = _decide(candidates)
    centers, shapes, _ = seen
    return found if found is None or shapes is None else _sharpened(camera, floor_map, found, centers, shapes)


def _sharpened(camera: Camera, floor_map: FloorMap, found: Located, xy: Values, affinity: Values) -> Located:
    """Return the pose with each marker weighing as much as it is known to tell, without those that do not fit then."""
    marker_of = found.marker_of.copy()
    while (marker_of >= 0).sum() >= FEWEST:
        chosen = np.flatnonzero(marker_of >= 0)
        center_sigma, shape_sigma = refined_sigmas(affinity[chosen])
        tangents = level_tangents(floor_map.side_m, len(chosen))
        markers = Correspondences(
            xy[chosen],
            floor_map.centers_m[marker_of[chosen]],
            tangents,
            affinity[chosen],
            sigma_px=center_sigma,
            shape_sigma_px=shape_sigma,
        )
        fit = refine_pose(camera, found.world_from_camera, markers)
        off = np.linalg.norm(fit.errors_px, axis=1) / center_sigma
        if off.max() <= _WORST * max(1.0, float(np.median(off))):
            return Located(replace(fit, cost=found.fit.cost), found.rival, marker_of)
        marker_of[chosen[np.argmax(off)]] = -1
    return found


def _fewest(has_shapes: bool) -> int:
    return FEWEST if has_shapes else FEWEST_WITHOUT_SHAPES


def _check(
    xy: ArrayLike, affinity: ArrayLike | None, side_px: ArrayLike | None
) -> tuple[Values, Values | None, Values]:
    centers = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    if affinity is not None:
        shapes = np.asarray(affinity, dtype=np.float64).reshape(-1, 2, 2)
        sides = np.sqrt(np.abs(np.linalg.det(shapes)))
    elif side_px is not None:
        shapes, sides = None, np.asarray(side_px, dtype=np.float64).reshape(-1)
    else:
        raise InputError("locate: expected affinity or side_px, got neither")
    if len(sides) != len(centers):
        raise InputError(f"locate: expected one shape or side a centre, got {len(sides)} for {len(centers)}")
    return centers, shapes, sides


def _guesses(camera: Camera, floor_map: FloorMap, xy: Values, affinity: Values | None, side_px: Values) -> list[Pose]:
    """Return the poses of all arrangements of three markers or more."""
    if affinity is not None:
        floor, doubt = floor_from_shapes(camera, xy, affinity, floor_map.side_m), 0.04
    else:
        floor, doubt = floor_from_areas(camera, xy, side_px, floor_map.side_m), 0.15
    if floor is None:
        return []
    seen = on_floor(floor, unit_rays(camera, xy))
    usable = np.isfinite(seen).all(axis=1)
    tolerance = doubt * np.linalg.norm(seen[usable], axis=1) + 0.25 * floor_map.side_m
    found = arrangements(seen[usable], tolerance, floor_map.centers_m[:, :2])
    return [
        _pose_of(floor, arrangement, float(floor_map.centers_m[0, 2]))
        for arrangement in found
        if arrangement.count >= 3
    ]


def _pose_of(floor: Floor, arrangement: Arrangement, level_m: float) -> Pose:
    rotation = rotation_about("z", float(np.degrees(arrangement.rotation_rad)))
    return compose(rotation, [*arrangement.shift_m, level_m]) @ floor.floor_from_camera


def _settle(
    camera: Camera,
    floor_map: FloorMap,
    xy: Values,
    affinity: Values | None,
    side_px: Values,
    guess: Pose,
    sigma_px: float,
) -> Located | None:
    """Pair and refine by turns, with ever tighter gates; None if too few markers agree in the end.

    The cost includes markers that are not on the map, and those that were missed.
    """
    final_px = sigma_px * np.sqrt(2 * OUTLIER_COST)
    pose = guess
    for gate in (*(np.maximum(sides * side_px, final_px) for sides in _GATES), np.full(len(xy), final_px)):
        marker_of = _paired(camera, floor_map, pose, xy, gate)
        chosen = marker_of >= 0
        if chosen.sum() < _fewest(affinity is not None):
            return None
        centers = floor_map.centers_m[marker_of[chosen]]
        markers = Correspondences(
            xy[chosen],
            centers,
            level_tangents(floor_map.side_m, len(centers)),
            None if affinity is None else affinity[chosen],
            side_px[chosen],
            sigma_px,
        )
        fit = refine_pose(camera, pose, markers)
        pose = fit.world_from_camera
    outliers = len(xy) - chosen.sum()
    missed = _surely_seen(camera, floor_map, pose)
    missed[marker_of[chosen]] = False
    cost = fit.cost + OUTLIER_COST * outliers + MISSED_COST * missed.sum()
    return Located(replace(fit, cost=float(cost)), None, marker_of)


def _paired(camera: Camera, floor_map: FloorMap, pose: Pose, xy: Values, gate_px: Values) -> NDArray[np.intp]:
    """Return (n,) indices of the mutually nearest markers of the map within the gates, −1 without one."""
    expected = camera.project(transform(invert(pose), floor_map.centers_m))
    gaps = np.nan_to_num(np.linalg.norm(xy[:, None] - expected[None], axis=2), nan=np.inf)
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(xy))
    mutual = gaps[:, nearest].argmin(axis=0) == rows
    return np.where(mutual & (gaps[rows, nearest] <= gate_px), nearest, -1)


def _surely_seen(camera: Camera, floor_map: FloorMap, pose: Pose) -> NDArray[np.bool_]:
    """Return (m,) whether each marker of the map is large and well inside the image from a pose."""
    centers = floor_map.centers_m
    xy, shapes = expected_shapes(camera, pose, centers, level_tangents(floor_map.side_m, len(centers)))
    corner = np.abs(shapes).sum(axis=2)
    with np.errstate(invalid="ignore"):
        inside = (xy > corner) & (xy < np.array([camera.width, camera.height]) - 1 - corner)
        large = np.abs(shapes[:, 0, 0] * shapes[:, 1, 1] - shapes[:, 0, 1] * shapes[:, 1, 0]) > _SURELY_SEEN_PX**2
    return np.asarray(inside.all(axis=1) & large)


def _is_near(candidate: Located, near: Pose, within_m: float, within_deg: float) -> bool:
    distance_m, angle_deg = pose_distance(near, candidate.world_from_camera)
    return distance_m <= within_m and angle_deg <= within_deg


def _decide(candidates: list[Located]) -> Located | None:
    """Return the best candidate if it explains most of what is seen and no other arrangement comes near."""
    by_arrangement = {c.marker_of.tobytes(): c for c in sorted(candidates, key=lambda c: -c.fit.cost)}
    ranked = sorted(by_arrangement.values(), key=lambda c: c.fit.cost)
    if not ranked:
        return None
    found = replace(ranked[0], rival=ranked[1].fit if len(ranked) > 1 else None)
    return found if found.is_certain and 2 * (found.marker_of >= 0).sum() > len(found.marker_of) else None
