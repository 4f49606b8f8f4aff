"""Where the camera is on a map, in one call: `locate`.

::

    image ─▶ markers and arrays ─▶ guesses: arrays by their code, or the arrangement of markers without any
        ─▶ every marker of the map paired with what is seen there ─▶ pose, covariance and rival
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, transform

from peakmark.arrays.decode import MarkerArray, decode_arrays
from peakmark.errors import InputError
from peakmark.found.found import Found, find
from peakmark.found.tables import frame_of
from peakmark.identification.detection import Detection
from peakmark.localise.from_arrays import pose_from_arrays, rotated_to
from peakmark.localise.locate import FEWEST, FloorMap
from peakmark.localise.locate import locate as locate_on_floor
from peakmark.localise.pose import STEP, PoseEstimate, PoseFit, estimate_pose, expected_shapes, moved
from peakmark.localise.residuals import Correspondences, MarkerFits, Residuals
from peakmark.localise.uncertainty import marker_fits
from peakmark.maps.marker_map import MarkerMap
from peakmark.maps.pose_columns import pose_columns
from peakmark.markers.patterns import Polarity

_GATES = (0.6, 0.25)
"""Distances, in sides, up to which seen and expected markers are paired, one after the other."""

_SAME_SIDE = 1.5
"""Ratio of a seen and an expected side up to which markers are paired: a guess is not that far off in distance."""

_WORST = 6.0
"""Error of a centre, in its σ and in the median of all, beyond which a marker is left out."""

_LEAST_ERROR = 0.1
"""Of a centre, px, that is left in, however well the others fit."""

_EXPECTED = 8.0
"""So many residuals the markers' stated σ count as, against those of the image, in a pose's covariance."""

_SAME_PLANE = 1e-3
"""Distance, metres, and change of the normal up to which markers lie in one plane."""


@dataclass(frozen=True)
class Location:
    """Where the camera is, how sure that is, and what else it could be."""

    estimate: PoseEstimate
    """The pose, and the other one that a flat target may leave."""
    covariance: NDArray[np.float64]
    """(6, 6) of a small step in the camera's frame: rotation vector, rad, then translation, m."""
    marker_of: NDArray[np.intp]
    """(n,) index into the map of each detection; −1 for those that are not on it."""
    rms_px: float
    """Reprojection error of the centres, root mean square over both axes' sum."""
    page: int | None = None
    """The sheet of paper whose frame the pose is in, for maps of several sheets."""

    @property
    def world_from_camera(self) -> Pose:
        """(4, 4)."""
        return self.estimate.fit.world_from_camera

    @property
    def other(self) -> Pose | None:
        """(4, 4) the second solution; None without one."""
        return None if self.estimate.rival is None else self.estimate.rival.world_from_camera

    @property
    def is_certain(self) -> bool:
        """Whether no other pose explains what is seen nearly as well."""
        return self.estimate.is_certain

    @property
    def markers(self) -> int:
        """Number of markers of the map that were seen."""
        return int((self.marker_of >= 0).sum())

    def to_dataframe(self) -> Any:
        """Return one row of a `pandas.DataFrame`, with the columns of `peakmark identify --poses poses.csv`.

        Those are position and quaternion, σ, the second solution and the covariance's upper triangle. Without pandas an
        `InputError` says how to install it.
        """
        return frame_of([pose_columns(self)])

    @property
    def position_sigma_m(self) -> NDArray[np.float64]:
        """(3,) standard deviations of the position, world."""
        rotation = self.world_from_camera[:3, :3]
        return np.asarray(np.sqrt(np.diag(rotation @ self.covariance[3:, 3:] @ rotation.T)))

    @property
    def rotation_sigma_deg(self) -> float:
        """Standard deviation of the rotation, root of the sum over its three axes."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[:3, :3]))))


def locate(
    source: ArrayLike | Found | Iterable[Detection], camera: Camera, marker_map: MarkerMap | FloorMap
) -> Location | None:
    """Return where the camera is on a map, or None where the image does not tell; `location_or_reason` says why.

    Parameters
    ----------
    source
        An image, grey or RGB, which is searched with the camera's focal length; or what was found in it: `Found`, or
        detections.
    camera
        The camera, with the size of the image.
    marker_map
        Where the markers are: `load_map`, or a `FloorMap`.

    Raises
    ------
    InputError
        If the image is none, or not of the camera's size.
    """
    where = location_or_reason(source, camera, marker_map)
    return None if isinstance(where, str) else where


def location_or_reason(
    source: ArrayLike | Found | Iterable[Detection], camera: Camera, marker_map: MarkerMap | FloorMap
) -> Location | str:
    """Return where the camera is, or in words why that cannot be told; see `locate`."""
    on_map = _floor_as_map(marker_map) if isinstance(marker_map, FloorMap) else marker_map
    found = _found(source, camera, on_map)
    seen = Seen.of(found.markers)
    if not len(seen.rows):
        return "no marker was found"
    pieces = _likely_pieces(on_map, found.arrays)
    located = [_located(seen, found.arrays, camera, piece) for piece in pieces]
    good = [(where, piece) for where, piece in zip(located, pieces, strict=True) if isinstance(where, Location)]
    if not good:
        return next(reason for reason in located if isinstance(reason, str))
    where, piece = max(good, key=lambda each: int((each[0].marker_of >= 0).sum()))
    if on_map.pages is None:
        return _numbered(where, found, seen, np.arange(len(on_map)))
    assert piece.pages is not None
    rows = np.flatnonzero(on_map.pages == piece.pages[0])
    several = len(on_map.pieces) > 1
    return replace(_numbered(where, found, seen, rows), page=int(piece.pages[0]) if several else None)


def _likely_pieces(on_map: MarkerMap, arrays: Sequence[MarkerArray]) -> tuple[MarkerMap, ...]:
    """Return the pieces of a map that hold an array that was read; all where none does."""
    codes = {array.code for array in arrays}
    return tuple(piece for piece in on_map.pieces if codes & piece.places.keys()) or on_map.pieces


def _numbered(where: Location, found: Found, seen: "Seen", rows: NDArray[np.intp]) -> Location:
    """Return the location with indices of all detections, and into the whole map."""
    marker_of = np.full(len(found.markers), -1, dtype=np.intp)
    marker_of[seen.rows] = np.where(where.marker_of >= 0, rows[where.marker_of], -1)
    return replace(where, marker_of=marker_of)


def _floor_as_map(floor: FloorMap) -> MarkerMap:
    count = len(floor.centers_m)
    axes = np.broadcast_to(np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]), (count, 3, 2))
    return MarkerMap(floor.centers_m, axes, np.full(count, floor.side_m), (None,) * count)


def _found(source: Any, camera: Camera, marker_map: MarkerMap) -> Found:
    """Return what is in the image, its arrays read with the map's layout."""
    size = (camera.width, camera.height)
    if isinstance(source, Found):
        found = source
    elif isinstance(source, np.ndarray) or hasattr(source, "__array__"):
        found = find(source, layout=marker_map.layout, focal_px=camera.focal_px)
    else:
        markers = tuple(source)
        if not all(isinstance(marker, Detection) for marker in markers):
            raise InputError(f"locate: expected an image, Found or detections, got {type(source).__name__}")
        found = Found(markers, decode_arrays(markers, marker_map.layout, image_size=size), size)
    if found.image_size != size:
        raise InputError(
            "locate: expected an image of the camera's {}×{} px, got {}×{}".format(*size, *found.image_size)
        )
    return found


# --- one piece ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Seen:
    """The refined ones of an image's detections."""

    rows: NDArray[np.intp]
    """(n,) which detections they are."""
    xy: NDArray[np.float64]
    """(n, 2) centres, px."""
    affinity: NDArray[np.float64]
    """(n, 2, 2) px per side."""
    fits: MarkerFits
    """Of `marker_fits`."""
    signs: NDArray[np.intp]
    """(n,) +1 for dark, −1 for light, 0 where it is not known."""

    @classmethod
    def of(cls, markers: Sequence[Detection]) -> "Seen":
        """Return the refined ones."""
        rows = [row for row, marker in enumerate(markers) if marker.affinity is not None]
        return cls(
            np.array(rows, dtype=np.intp),
            np.array([markers[row].xy for row in rows]).reshape(-1, 2),
            np.array([markers[row].affinity for row in rows]).reshape(-1, 2, 2),
            marker_fits([markers[row] for row in rows]),
            signs_of([markers[row].polarity for row in rows]),
        )

    @property
    def sides_px(self) -> NDArray[np.float64]:
        """(n,) square roots of the areas."""
        return np.asarray(np.sqrt(np.abs(np.linalg.det(self.affinity))))


def signs_of(polarities: Sequence[Polarity | None]) -> NDArray[np.intp]:
    """Return (n,) +1 for dark, −1 for light, 0 where it is not known."""
    return np.array([0 if each is None else 1 if each == "dark" else -1 for each in polarities], dtype=np.intp)


def _located(seen: Seen, arrays: Sequence[MarkerArray], camera: Camera, piece: MarkerMap) -> Location | str:
    """Return where the camera is to one rigid piece of a map."""
    sought = {id(marker) for array in arrays if array.code in piece.places for marker in array.detections}
    good: list[Location] = []
    for guess in _guesses(seen, arrays, camera, piece):
        fitted = _fitted(seen, camera, piece, guess)
        if fitted is not None:
            good.append(fitted)
            if (fitted.marker_of >= 0).sum() >= len(sought) > 0:
                break
    if good:
        return max(good, key=lambda each: (int((each.marker_of >= 0).sum()), -each.rms_px))
    codes = sorted({array.code for array in arrays if array.code is not None})
    on_map = sorted(piece.places)
    if piece.arrays and not set(codes) & set(on_map):
        got = f"arrays {', '.join(map(str, codes))}" if codes else f"no array, {len(seen.rows)} markers"
        return f"expected one of the map's arrays {', '.join(map(str, on_map))}, found {got}"
    return (
        f"the markers do not tell where they are on the map ({len(seen.rows)} seen, {len(piece)} on it): without an "
        f"array it takes {FEWEST} or more in an arrangement that is not the same one marker on, or turned"
    )


def _guesses(seen: Seen, arrays: Sequence[MarkerArray], camera: Camera, piece: MarkerMap) -> Iterator[Pose]:
    """Yield poses to start from: by all arrays, by each of them, and by markers without a code, plane by plane."""
    known = [array for array in arrays if array.code in piece.places and _is_refined(array)]
    for chosen in ([known] if known else []) + ([[each] for each in known] if len(known) > 1 else []):
        estimate = pose_from_arrays(camera, chosen, piece.places)
        if estimate is not None:
            yield from (fit.world_from_camera for fit in (estimate.fit, estimate.rival) if fit is not None)
    if not known:
        yield from _arranged(seen, camera, piece)


def _is_refined(array: MarkerArray) -> bool:
    return all(marker.affinity is not None for marker in array.detections)


def _arranged(seen: Seen, camera: Camera, piece: MarkerMap) -> Iterator[Pose]:
    """Yield poses from the arrangement of the markers of each plane of the map, which stands for a floor then."""
    for world_from_plane, rows in _planes(piece):
        for side in np.unique(piece.sides_m[rows]):
            alike = rows[piece.sides_m[rows] == side]
            if len(alike) >= FEWEST:
                centers = transform(invert(world_from_plane), piece.centers_m[alike])
                centers[:, 2] = 0.0
                where = locate_on_floor(camera, FloorMap(centers, float(side)), seen.xy, seen.affinity)
                if where is not None:
                    yield world_from_plane @ where.world_from_camera


def _planes(piece: MarkerMap) -> Iterator[tuple[Pose, NDArray[np.intp]]]:
    """Yield the planes of a map, z out of the paper, and the markers in each."""
    left = np.arange(len(piece))
    normals = np.cross(piece.axes[:, :, 0], -piece.axes[:, :, 1])
    while len(left):
        first = left[0]
        right, normal = piece.axes[first, :, 0], normals[first]
        frame = compose(np.stack([right, np.cross(normal, right), normal], axis=1), piece.centers_m[first])
        heights = (piece.centers_m[left] - piece.centers_m[first]) @ normal
        inside = (np.abs(heights) < _SAME_PLANE) & (np.abs(normals[left] - normal).max(axis=1) < _SAME_PLANE)
        yield frame, left[inside]
        left = left[~inside]


def _fitted(seen: Seen, camera: Camera, piece: MarkerMap, guess: Pose) -> Location | None:
    """Return the location near a guess: markers are paired, fitted and paired again; None where none agree."""
    wide, narrow = _GATES
    first = _estimate(seen, camera, piece, _paired(seen, camera, piece, guess, wide), guess)
    if first is None:
        return None
    pose = first.fit.world_from_camera
    marker_of = _paired(seen, camera, piece, pose, narrow)
    second = _estimate(seen, camera, piece, marker_of, pose)
    return None if second is None else _without_misfits(seen, camera, piece, marker_of, second)


def _without_misfits(
    seen: Seen, camera: Camera, piece: MarkerMap, marker_of: NDArray[np.intp], estimate: PoseEstimate
) -> Location | None:
    """Return the location of a fit after leaving out, one by one, what does not fit."""
    pose, misfit = estimate.fit.world_from_camera, _misfit(seen, marker_of, estimate.fit)
    if misfit is not None:
        fewer = np.where(np.arange(len(marker_of)) == misfit, -1, marker_of)
        again = _estimate(seen, camera, piece, fewer, pose)
        return None if again is None else _without_misfits(seen, camera, piece, fewer, again)
    covariance = pose_covariance(camera, _correspondences(seen, piece, marker_of), pose)
    rms_px = float(np.sqrt((estimate.fit.errors_px**2).sum(axis=1).mean()))
    return Location(estimate, covariance, marker_of, rms_px)


def _misfit(seen: Seen, marker_of: NDArray[np.intp], fit: PoseFit) -> int | None:
    """Return the detection that fits worst, if it is too far off to be of the map; None where all fit."""
    rows = np.flatnonzero(marker_of >= 0)
    if len(rows) <= FEWEST:
        return None
    errors = np.linalg.norm(fit.errors_px, axis=1)
    off = errors / np.sqrt(np.linalg.eigvalsh(seen.fits.covariance[rows, :2, :2])[:, 1])
    worst = int(np.argmax(off))
    is_far = off[worst] > _WORST * max(1.0, float(np.median(off))) and errors[worst] > _LEAST_ERROR
    return int(rows[worst]) if is_far else None


def _paired(seen: Seen, camera: Camera, piece: MarkerMap, pose: Pose, gate: float) -> NDArray[np.intp]:
    """Return (n,) indices of the mutually nearest markers of the map, within `gate` sides, that look as large."""
    expected, shapes = expected_shapes(camera, pose, piece.centers_m, piece.tangents_m)
    areas = np.linalg.det(np.nan_to_num(shapes))  # negative from behind, where the axes are seen mirrored
    gaps = np.linalg.norm(seen.xy[:, None] - expected[None], axis=2) / seen.sides_px[:, None]
    ratios = seen.sides_px[:, None] / np.sqrt(np.maximum(areas, 1e-12))
    gaps[np.maximum(ratios, 1 / ratios) > _SAME_SIDE] = np.inf
    gaps[seen.signs[:, None] * signs_of(piece.polarities) < 0] = np.inf
    gaps = np.nan_to_num(gaps, nan=np.inf)
    nearest, rows = gaps.argmin(axis=1), np.arange(len(seen.xy))
    mutual = gaps[:, nearest].argmin(axis=0) == rows
    return np.where(mutual & (gaps[rows, nearest] <= gate), nearest, -1)


def _estimate(
    seen: Seen, camera: Camera, piece: MarkerMap, marker_of: NDArray[np.intp], pose: Pose
) -> PoseEstimate | None:
    """Return the pose of paired markers, and its rival; None for fewer than two markers, or without an end."""
    if (marker_of >= 0).sum() < 2:
        return None
    markers = _correspondences(seen, piece, marker_of)
    _, shapes = expected_shapes(camera, pose, markers.centers_m, markers.tangents_m)
    xy, points = [markers.xy], [markers.centers_m]
    for k, shape in enumerate(seen.affinity[marker_of >= 0]):
        turned = rotated_to(shape, np.nan_to_num(shapes[k])[:, 0])
        for axis in (0, 1):
            for half in (-0.5, 0.5):
                xy.append(markers.xy[k : k + 1] + half * turned[:, axis])
                points.append(markers.centers_m[k : k + 1] + half * markers.tangents_m[k][:, axis])
    return estimate_pose(camera, markers, np.concatenate(xy), np.concatenate(points))


def _correspondences(seen: Seen, piece: MarkerMap, marker_of: NDArray[np.intp]) -> Correspondences:
    rows = np.flatnonzero(marker_of >= 0)
    return Correspondences(
        xy=seen.xy[rows],
        centers_m=piece.centers_m[marker_of[rows]],
        tangents_m=piece.tangents_m[marker_of[rows]],
        affinity=seen.affinity[rows],
        fits=seen.fits[rows],
        alike=seen.signs[rows],
    )


def pose_covariance(camera: Camera, markers: Correspondences, world_from_camera: Pose) -> NDArray[np.float64]:
    """Return the (6, 6) covariance of a fitted pose, see `Location`.

    The markers' own σ give it up to a factor: what the residuals say of that, with `_EXPECTED` more that are as they
    should be, counts; its expected value, for few residuals tell it badly.
    """
    residuals = Residuals.of(camera, markers)
    steps = np.concatenate([STEP * np.eye(6), -STEP * np.eye(6), np.zeros((1, 6))])
    values = residuals.at(np.stack([moved(world_from_camera, step) for step in steps]))
    slopes = (values[:6] - values[6:12]).T / (2 * STEP)
    measurements = len(slopes) if markers.fits is None else markers.fits.measurements
    spare = max(measurements - 6, 0)
    factor = (_EXPECTED + float((values[12] ** 2).sum())) / (_EXPECTED + spare - 2)
    return np.asarray(factor * np.linalg.pinv(slopes.T @ slopes))
