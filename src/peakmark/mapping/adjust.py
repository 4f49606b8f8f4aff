"""A map from sightings: poses chained from one array to the next, then all of them adjusted together.

The world is the frame of the array that is seen most often. Lengths follow from the printed side.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, invert, transform

from peakmark.errors import InputError
from peakmark.mapping.sightings import Sighting, cell_points_m
from peakmark.maps.marker_map import MappedArray, MarkerMap
from peakmark.markers.array_code import Layout, polarities_of

Values = NDArray[np.float64]

WORST_SIGHTING = 6.0
"""Median error of a sighting's markers, over that of all, beyond which it is left out: a wrong code, or moved."""

_HUBER, _MOST_STEPS = 5.0, 60
"""Whitened error from which a marker weighs less, and steps of the adjustment."""

_STEP = 1e-6
"""Of numerical derivatives, rad and m."""

_FAR_PX = 1e4
"""Where a point behind a camera is projected to: an error too large to prefer."""


@dataclass(frozen=True)
class BuiltMap:
    """A map made of photographs."""

    marker_map: MarkerMap
    """Arrays with the σ of their markers' positions, in the frame of `origin`."""
    origin: int
    """Code of the array whose frame is the world: x right, y up the print, z out of it."""
    world_from_camera: dict[int, Pose]
    """(4, 4) by number of the photograph."""
    rms_px: float
    """Reprojection error over all markers, x and y together."""
    sightings: int
    """Used ones."""
    left_out: tuple[Sighting, ...]
    """Those that fit nothing."""
    unconnected: tuple[int, ...]
    """Codes that no photograph shows together with the others."""


@dataclass(frozen=True)
class _State:
    """Poses during the adjustment."""

    world_from_array: dict[int, Pose]
    world_from_camera: dict[int, Pose]


def build_map(sightings: Sequence[Sighting], camera: Camera, layout: Layout, side_m: float) -> BuiltMap:
    """Return where arrays are, from where they were seen.

    Raises
    ------
    InputError
        If no photograph shows two arrays.
    """
    points = cell_points_m(layout, side_m)
    origin, state = _chained(sightings, camera, points)
    if len(state.world_from_array) < 2:
        raise InputError("expected photographs that show two or more arrays at once, which connects them to one map")
    used = [s for s in sightings if s.code in state.world_from_array and s.image in state.world_from_camera]
    unconnected = tuple(sorted({s.code for s in sightings} - state.world_from_array.keys()))
    left_out: list[Sighting] = []
    while True:
        state, residuals, information = _adjusted(used, camera, points, origin, state)
        worst = _worst(used, residuals)
        if worst is None:
            break
        left_out.append(used.pop(worst))
        state = _still_seen(used, state, origin)
        used = [s for s in used if s.code in state.world_from_array]
    return _built(used, state, residuals, information, origin, points, layout, side_m, tuple(left_out), unconnected)


# --- the start ------------------------------------------------------------------------------------------------


def _chained(sightings: Sequence[Sighting], camera: Camera, points: Values) -> tuple[int, _State]:
    """Return poses of all arrays and cameras that are connected with the array seen most often."""
    if not sightings:
        raise InputError("expected photographs of arrays, found none that was read")
    origin = Counter(s.code for s in sightings).most_common(1)[0][0]
    state = _State({origin: np.eye(4)}, {})
    while True:
        placed = _place_cameras(sightings, camera, points, state) or _place_array(sightings, camera, points, state)
        if not placed:
            return origin, state


def _place_cameras(sightings: Sequence[Sighting], camera: Camera, points: Values, state: _State) -> bool:
    """Place every camera that sees a placed array, by the sighting that explains best what it sees of all of them."""
    new = {s.image for s in sightings if s.code in state.world_from_array} - state.world_from_camera.keys()
    for image in new:
        seen = [s for s in sightings if s.image == image and s.code in state.world_from_array]
        guesses = [state.world_from_array[s.code] @ pose for s in seen for pose in s.array_from_camera]
        costs = [
            sum(_cost(s, camera, points, state.world_from_array[s.code], guess) for s in seen) for guess in guesses
        ]
        state.world_from_camera[image] = guesses[int(np.argmin(costs))]
    return bool(new)


def _place_array(sightings: Sequence[Sighting], camera: Camera, points: Values, state: _State) -> bool:
    """Place the array that most of the placed cameras see, by the sighting that explains best what they all see."""
    counts = Counter(
        s.code for s in sightings if s.image in state.world_from_camera and s.code not in state.world_from_array
    )
    if not counts:
        return False
    code = counts.most_common(1)[0][0]
    seen = [s for s in sightings if s.code == code and s.image in state.world_from_camera]
    guesses = [state.world_from_camera[s.image] @ invert(pose) for s in seen for pose in s.array_from_camera]
    costs = [sum(_cost(s, camera, points, guess, state.world_from_camera[s.image]) for s in seen) for guess in guesses]
    state.world_from_array[code] = guesses[int(np.argmin(costs))]
    # cameras that saw the new array may be placed better now
    for image in {s.image for s in seen}:
        del state.world_from_camera[image]
    _place_cameras(sightings, camera, points, state)
    return True


def _cost(sighting: Sighting, camera: Camera, points: Values, world_from_array: Pose, world_from_camera: Pose) -> float:
    """Return the error of a sighting, px, bounded, so that one wrong code does not decide."""
    xy = camera.project(transform(invert(world_from_camera) @ world_from_array, points))
    return float(min(np.nan_to_num(np.abs(xy - sighting.xy), nan=_FAR_PX).mean(), 50.0))


# --- the adjustment -------------------------------------------------------------------------------------------


def _adjusted(
    used: Sequence[Sighting], camera: Camera, points: Values, origin: int, state: _State
) -> tuple[_State, Values, Values]:
    """Return the state of least error near one, the (s, k, 2) whitened residuals, and the information of the arrays."""
    codes = sorted(code for code in state.world_from_array if code != origin)
    images = sorted(state.world_from_camera)
    arrays = np.array([state.world_from_array[code] for code in (origin, *codes)])
    cameras = np.array([state.world_from_camera[image] for image in images])
    of_array = np.array([0 if s.code == origin else 1 + codes.index(s.code) for s in used])
    of_camera = np.array([images.index(s.image) for s in used])
    xy, sigma = np.array([s.xy for s in used]), np.array([s.sigma_px for s in used])[:, :, None]

    def split(x: Values) -> tuple[Values, Values]:
        steps = x.reshape(-1, 6)
        return np.concatenate([np.zeros((1, 6)), steps[: len(codes)]]), steps[len(codes) :]

    def residuals(array_steps: Values, camera_steps: Values) -> Values:
        a, c = _moved(arrays, array_steps)[of_array], _moved(cameras, camera_steps)[of_camera]
        world = points @ np.swapaxes(a[:, :3, :3], 1, 2) + a[:, None, :3, 3]
        local = (world - c[:, None, :3, 3]) @ c[:, :3, :3]
        seen = camera.project(local.reshape(-1, 3)).reshape(xy.shape)
        return np.asarray((np.nan_to_num(seen, nan=_FAR_PX) - xy) / sigma)

    def slopes(x: Values) -> Values:
        of = split(x)
        base, rows = residuals(*of), np.zeros((len(used), xy[0].size, len(x)))
        each = np.arange(len(used))
        for axis in range(6):
            for part, owner, offset in ((0, of_array, -6), (1, of_camera, 6 * len(codes))):
                moved = [steps.copy() for steps in of]
                moved[part][:, axis] += _STEP
                slope = ((residuals(*moved) - base) / _STEP).reshape(len(used), -1)
                has_column = (owner > 0) if part == 0 else np.ones(len(used), bool)
                rows[each[has_column], :, (offset + 6 * owner + axis)[has_column]] = slope[has_column]
        return rows.reshape(-1, len(x))

    x = _least_squares(lambda x: residuals(*split(x)).ravel(), slopes, np.zeros(6 * (len(codes) + len(images))))
    array_steps, camera_steps = split(x)
    jacobian = slopes(x)
    after = _State(
        dict(zip((origin, *codes), _moved(arrays, array_steps), strict=True)),
        dict(zip(images, _moved(cameras, camera_steps), strict=True)),
    )
    return after, residuals(array_steps, camera_steps), jacobian.T @ jacobian


def _least_squares(errors: Callable[[Values], Values], slopes: Callable[[Values], Values], x: Values) -> Values:
    """Return where Huber's cost is least near a start, by Levenberg and Marquardt on the normal equations.

    SciPy's solvers decompose the Jacobian itself, which takes a hundred times as long for some hundred poses.
    """
    damping, residual = 1e-4, errors(x)
    cost = _huber_cost(residual)
    for _ in range(_MOST_STEPS):
        jacobian, weights = slopes(x), np.minimum(1.0, _HUBER / np.maximum(np.abs(residual), 1e-12))
        normal, gradient = jacobian.T @ (weights[:, None] * jacobian), jacobian.T @ (weights * residual)
        while damping < 1e8:
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), -gradient)
            tried = errors(x + step)
            if _huber_cost(tried) < cost:
                break
            damping *= 10
        else:
            return x
        gain, cost = 1 - _huber_cost(tried) / cost, _huber_cost(tried)
        x, residual, damping = x + step, tried, damping / 10
        if gain < 1e-9 or cost < 1e-12:
            return x
    return x


def _huber_cost(residual: Values) -> float:
    size = np.abs(residual)
    return float(np.where(size < _HUBER, size**2 / 2, _HUBER * (size - _HUBER / 2)).sum())


def _moved(poses: Values, steps: Values) -> Values:
    """Return (n, 4, 4) poses after (n, 6) steps in their own frames."""
    moves = np.tile(np.eye(4), (len(poses), 1, 1))
    moves[:, :3, :3] = scipy.spatial.transform.Rotation.from_rotvec(steps[:, :3]).as_matrix()
    moves[:, :3, 3] = steps[:, 3:]
    return np.asarray(poses @ moves)


def _worst(used: Sequence[Sighting], residuals: Values) -> int | None:
    """Return the sighting that fits worst, if far too badly; None where all fit, or too few are left to tell."""
    errors = np.median(np.linalg.norm(residuals, axis=2), axis=1)
    worst = int(np.argmax(errors))
    is_far = errors[worst] > WORST_SIGHTING * max(1.0, float(np.median(errors)))
    return worst if is_far and len(used) > 2 else None


def _still_seen(used: Sequence[Sighting], state: _State, origin: int) -> _State:
    """Return the state without arrays and cameras that no sighting shows any more."""
    codes, images = {s.code for s in used} | {origin}, {s.image for s in used}
    return _State(
        {code: pose for code, pose in state.world_from_array.items() if code in codes},
        {image: pose for image, pose in state.world_from_camera.items() if image in images},
    )


def _built(
    used: Sequence[Sighting],
    state: _State,
    residuals: Values,
    information: Values,
    origin: int,
    points: Values,
    layout: Layout,
    side_m: float,
    left_out: tuple[Sighting, ...],
    unconnected: tuple[int, ...],
) -> BuiltMap:
    codes = [origin, *sorted(code for code in state.world_from_array if code != origin)]
    factor2 = float((residuals**2).sum()) / max(1, residuals.size - len(information))
    covariance = np.asarray(factor2 * np.linalg.inv(information), dtype=np.float64)
    centers, axes, sigmas = [], [], []
    for number, code in enumerate(codes):
        pose = state.world_from_array[code]
        centers.append(transform(pose, points))
        axes.append(np.broadcast_to(pose[:3, :2] * [1, -1], (len(points), 3, 2)))
        block = slice(6 * number - 6, 6 * number)
        sigmas.append(_point_sigmas(pose, points, covariance[block, block]) if number else np.zeros((len(points), 3)))
    marker_map = MarkerMap(
        np.concatenate(centers),
        np.concatenate(axes),
        np.full(len(codes) * len(points), side_m),
        tuple(polarity for code in codes for polarity in polarities_of(code, layout)),
        tuple(MappedArray(code, tuple(range(n * len(points), (n + 1) * len(points)))) for n, code in enumerate(codes)),
        layout,
        sigma_m=np.concatenate(sigmas),
    )
    sigma = np.array([s.sigma_px for s in used])[:, :, None]
    rms_px = float(np.sqrt(((residuals * sigma) ** 2).sum(axis=2).mean()))
    return BuiltMap(marker_map, origin, dict(state.world_from_camera), rms_px, len(used), left_out, unconnected)


def _point_sigmas(pose: Pose, points: Values, covariance: Values) -> Values:
    """Return (k, 3) σ in the world of points of an array whose pose has a (6, 6) covariance in its own frame."""
    sigmas = []
    for point in points:
        x, y, z = point
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        by_step = pose[:3, :3] @ np.concatenate([-cross, np.eye(3)], axis=1)
        sigmas.append(np.sqrt(np.diag(by_step @ covariance @ by_step.T)))
    return np.array(sigmas)
