"""One frame through every reader: what was found, what was made up, how long it took, and where the camera was."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, compose, invert, pose_distance

from peakmark.experiments.comparison.boards import Print, TruePrint
from peakmark.experiments.comparison.frames import Shot
from peakmark.experiments.comparison.prints import ARRAY_SIDE, SIDE_M, polarity_of_code
from peakmark.experiments.comparison.readers import READERS, Read, Reader, Reading, Seen
from peakmark.experiments.images.outcome import BESIDE, WITHIN, WITHIN_PX
from peakmark.found.found import Found
from peakmark.localise.pose import moved
from peakmark.maps.locate import locate
from peakmark.maps.marker_map import MappedArray, MarkerMap
from peakmark.markers.array_code import polarities_of

LIKE = {
    "marker": ("array", "binary marker"),
    "binary marker": ("array", "marker"),
    "SIFT marker": ("disc",),
    "disc": ("SIFT marker",),
}
"""Designs that are made of the same markers: a marker that is seen there is not counted against its reader. A code
that is read where no array hangs is."""

CHI2_95 = 12.591587243743977
"""Of six degrees of freedom, 95 %."""


@dataclass(frozen=True)
class PoseOutcome:
    """Where a reader's prints say that the camera was."""

    position: float
    """Error over the camera's distance from the board's middle."""
    rotation_deg: float
    is_inside: bool | None
    """Whether the truth is in the 95 % ellipsoid of the stated covariance; None where none is stated."""


@dataclass(frozen=True)
class ReaderOutcome:
    """What one reader made of one frame."""

    reader: str
    errors_px: tuple[float | None, ...]
    """Of the prints of its design, in their order: distance of what was read there; None where nothing right was."""
    false: int
    """Answers where no print of its design is, or with another number than the print's."""
    cpu_s: float
    pose: PoseOutcome | None
    """None where its prints do not tell, or the design has no numbers."""


@dataclass(frozen=True)
class FrameOutcome:
    """One frame's result."""

    prints: tuple[TruePrint, ...]
    """All that are in it."""
    readers: tuple[ReaderOutcome, ...]


_OPEN: dict[str, Read] = {}


def measure(shot: Shot, readers: Sequence[Reader] = READERS) -> FrameOutcome:
    """Return what readers make of a frame."""
    return FrameOutcome(shot.truth, tuple(_outcome(reader, shot) for reader in readers))


def _outcome(reader: Reader, shot: Shot) -> ReaderOutcome:
    if reader.name not in _OPEN:
        _OPEN[reader.name] = reader.open()
    start = process_time()
    reading = _OPEN[reader.name](shot.gray)
    cpu_s = process_time() - start + reading.before_s
    own = [one for one in shot.truth if one.design == reader.design and one.is_whole]
    pose = pose_of(reader, reading, shot)
    false = false_answers(reader, reading.seen, shot.truth)
    return ReaderOutcome(reader.name, tuple(_error_px(one, reading.seen) for one in own), false, cpu_s, pose)


def _error_px(one: TruePrint, seen: Sequence[Seen]) -> float | None:
    gaps = [float(np.linalg.norm(each.xy - one.xy)) for each in seen if each.id in (None, one.code)]
    return min(gaps) if gaps and min(gaps) < max(WITHIN * one.side_px, WITHIN_PX) else None


def false_answers(reader: Reader, seen: Sequence[Seen], truth: Sequence[TruePrint]) -> int:
    """Return how many answers are neither a print of the reader's design with its number, nor on one that is like it.

    Where a print is not whole, whatever is read is right. Readers without numbers answer rightly wherever something
    looks alike: theirs count where there is no print at all.
    """
    if not reader.has_id and truth:
        return 0
    false = 0
    for each in seen:
        near = [one for one in truth if np.linalg.norm(each.xy - one.xy) < BESIDE * one.side_px]
        false += not any(
            one.design in LIKE.get(reader.design, ())
            or (one.design == reader.design and (not one.is_whole or each.id in (None, one.code)))
            for one in near
        )
    return false


# --- the camera's pose --------------------------------------------------------------------------------------


def pose_of(reader: Reader, reading: Reading, shot: Shot) -> PoseOutcome | None:
    """Return the camera's pose from all prints of the reader's design, whose places on the board are known."""
    prints = [one for one in shot.board if one.design == reader.design]
    if shot.pose is None or not prints or not reader.has_id:
        return None
    if reading.found is not None:
        return _located(reader, reading.found, prints, shot.camera, shot.pose)
    world_from_camera = solved(reading.seen, {one.code: one for one in prints}, shot.camera)
    return None if world_from_camera is None else _judged(world_from_camera, None, shot.pose)


def _located(reader: Reader, found: Found, prints: Sequence[Print], camera: Camera, truth: Pose) -> PoseOutcome | None:
    where = locate(found, camera, map_of(reader, prints))
    return None if where is None else _judged(where.world_from_camera, where.covariance, truth)


def map_of(reader: Reader, prints: Sequence[Print]) -> MarkerMap:
    """Return the map of prints: markers by their polarity, or arrays by their codes."""
    if reader.design == "array":
        polarities = [each for one in prints for each in polarities_of(one.code)]
        arrays = tuple(MappedArray(one.code, tuple(range(3 * k, 3 * k + 3))) for k, one in enumerate(prints))
    else:
        polarities, arrays = [polarity_of_code(one.code) for one in prints], ()
    centers = np.concatenate([one.middles_m for one in prints])
    each = len(centers) // len(prints)
    axes = np.repeat([one.pose[:3, :2] * [1, -1] for one in prints], each, axis=0)
    side_m = SIDE_M * (ARRAY_SIDE if reader.design == "array" else 1.0)
    return MarkerMap(centers, axes, np.full(len(centers), side_m), tuple(polarities), arrays)


def solved(seen: Sequence[Seen], prints: Mapping[int, Print], camera: Camera) -> Pose | None:
    """Return the pose from corners, or centres where there are none: a homography by RANSAC, IPPE, least squares."""
    world, image = [], []
    for each in seen:
        one = None if each.id is None else prints.get(each.id)
        if one is not None:
            world.append(one.corners_m if each.corners_xy is not None else one.middles_m)
            image.append(each.corners_xy if each.corners_xy is not None else each.xy[None])
    points, pixels = (np.concatenate(each) if each else np.zeros((0, 2)) for each in (world, image))
    if len(points) < 4:
        return None
    cv2.setRNGSeed(0)
    _, agree = cv2.findHomography(points[:, :2], pixels, cv2.RANSAC, 3.0)
    good = np.flatnonzero(agree) if agree is not None else np.zeros(0, np.intp)
    if len(good) < 4:
        return None
    flat = (points[good], pixels[good], camera.matrix, None)
    count, turns, shifts, _ = cv2.solvePnPGeneric(*flat, flags=cv2.SOLVEPNP_IPPE)
    fits = [cv2.solvePnPRefineLM(*flat, turns[k], shifts[k]) for k in range(count)]
    turn, shift = min(fits, key=lambda fit: _reprojection(flat[:3], *fit), default=(None, None))
    return None if turn is None or shift is None else invert(compose(cv2.Rodrigues(turn)[0], shift.ravel()))


def _reprojection(seen: tuple[NDArray[np.float64], ...], turn: Any, shift: Any) -> float:
    """Return the sum of squares of (points, pixels, camera's matrix) at a pose."""
    points, pixels, matrix = seen
    expected = cv2.projectPoints(points, turn, shift, matrix, None)[0].reshape(-1, 2)
    return float(((expected - pixels) ** 2).sum())


def _judged(found: Pose, covariance: NDArray[np.float64] | None, truth: Pose) -> PoseOutcome:
    position_m, angle_deg = pose_distance(found, truth)
    inside = None if covariance is None else bool(normalised_error(found, covariance, truth) <= CHI2_95)
    return PoseOutcome(float(position_m / np.linalg.norm(truth[:3, 3])), float(angle_deg), inside)


def normalised_error(found: Pose, covariance: NDArray[np.float64], truth: Pose) -> float:
    """Return the squared error in units of the stated covariance; six on average where that is right."""
    off = invert(found) @ truth
    step = np.concatenate([cv2.Rodrigues(off[:3, :3])[0].ravel(), off[:3, 3]])
    assert np.allclose(moved(found, step), truth, atol=1e-6)
    return float(step @ np.linalg.solve(covariance, step))
