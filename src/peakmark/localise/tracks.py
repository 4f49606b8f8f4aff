"""Stable identities over frames: which detection is the marker that was seen before.

Seen from a driving robot all markers of a floor move together. The last frame's motion predicts this frame's positions;
what remains, mostly the camera's nodding, is a common shift, found by what it brings together; then mutually nearest
positions are paired.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

PATIENCE = 5
"""Frames for which a track that is not seen is kept."""

_ROUNDS = 3
"""Times that pairs are formed and the common motion is fitted to them."""

_ROW_SCALE_PX = 500.0
"""Unit of the rows in the polynomials of motion, so that their terms are alike in size."""

_STIFFNESS = 0.05
"""Ridge on the slopes of those polynomials: one twentieth of a marker, so that few markers tell a shift alone."""

_NEAREST_SHARE = 0.5
_SIDES = 2.0
"""A marker may miss its predicted position by this share of the distance to its nearest neighbour, and by this many
sides: farther, it would be nearer to the neighbour's, or the motion is not the predicted one."""


@dataclass(frozen=True)
class Track:
    """One marker over time."""

    id: int
    """Stays the same as long as the track lives; never given twice."""
    xy: NDArray[np.float64]
    """(2,) position in the last frame, seen or predicted, px."""
    size: float
    """Side when last seen, px."""
    hits: int = 1
    misses: int = 0
    """Frames in which it was seen, and since it was last seen."""


@dataclass(frozen=True)
class Tracks:
    """All living tracks; start with `Tracks()`."""

    tracks: tuple[Track, ...] = ()
    """In order of their ids."""
    next_id: int = 0
    """Id of the next new track."""
    flow: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    """Motion from the frame before to the last one: see `displacement`."""


def follow(before: Tracks, xy: ArrayLike, size: ArrayLike) -> tuple[Tracks, NDArray[np.intp]]:
    """Return the tracks after one more frame, and the (n,) track id of each detection.

    `xy` are the (n, 2) detected centres, px, (0, 2) where nothing was seen, and `size` their (n,) sides, px.
    """
    seen, sizes = np.asarray(xy, dtype=np.float64).reshape(-1, 2), np.asarray(size, dtype=np.float64).reshape(-1)
    positions = np.array([track.xy for track in before.tracks]).reshape(-1, 2)
    expected = positions + displacement(before.flow, positions)
    reach = np.minimum(_NEAREST_SHARE * _spacing(expected), _SIDES * np.array([track.size for track in before.tracks]))
    track_of, expected = _pair(expected, reach, seen)
    paired = track_of >= 0
    flow = _flow(positions[track_of[paired]], seen[paired] - positions[track_of[paired]], 2)
    kept = [replace(track, xy=expected[i], misses=track.misses + 1) for i, track in enumerate(before.tracks)]
    for k in np.flatnonzero(paired):
        track = before.tracks[track_of[k]]
        kept[track_of[k]] = replace(track, xy=seen[k], size=float(sizes[k]), hits=track.hits + 1, misses=0)
    fresh = np.flatnonzero(~paired)
    ids = np.array([before.tracks[t].id if t >= 0 else -1 for t in track_of], dtype=np.intp)
    ids[fresh] = before.next_id + np.arange(len(fresh))
    born = [Track(int(ids[k]), seen[k], float(sizes[k])) for k in fresh]
    alive = tuple(track for track in (*kept, *born) if track.misses <= PATIENCE)
    return Tracks(alive, before.next_id + len(fresh), flow), ids


def _pair(
    expected: NDArray[np.float64], reach: NDArray[np.float64], seen: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return (n,) index of each detection's track, −1 without one, and the expected positions, moved in common."""
    if len(expected) == 0 or len(seen) == 0:
        return np.full(len(seen), -1, dtype=np.intp), expected
    expected = expected + _common_shift(expected, reach, seen)
    for _ in range(_ROUNDS):
        track_of = _mutual(expected, reach, seen)
        fits = track_of >= 0
        moved = expected[track_of[fits]]
        expected = expected + displacement(_flow(moved, seen[fits] - moved, 1), expected)
    return _mutual(expected, reach, seen), expected


def _mutual(expected: NDArray[np.float64], reach: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return (n,) index of the position that is nearest to each detection, and it to that position; −1 out of reach."""
    gaps = np.linalg.norm(seen[:, None] - expected[None], axis=2)
    nearest, rows = gaps.argmin(axis=1), np.arange(len(seen))
    return np.where((gaps[:, nearest].argmin(axis=0) == rows) & (gaps[rows, nearest] <= reach[nearest]), nearest, -1)


def _common_shift(
    expected: NDArray[np.float64], reach: NDArray[np.float64], seen: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the (2,) shift that brings most expected positions near a detection, the best fitting one of them."""
    steps = seen[None] - expected[:, None]
    shifts = np.concatenate([np.zeros((1, 2)), steps[np.linalg.norm(steps, axis=2) <= 2 * reach[:, None]]])
    gaps = np.linalg.norm(steps[None] - shifts[:, None, None], axis=3).min(axis=2)
    worth = np.clip(1 - gaps / reach, 0, None).sum(axis=1)
    return np.asarray(shifts[int(np.argmax(worth))])


def _spacing(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n,) distances to the nearest other point; inf for a lone one."""
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    return np.asarray(gaps.min(axis=1, initial=np.inf))


def displacement(flow: NDArray[np.float64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 2) displacements, px, at (n, 2) positions: (k, 2) polynomials of the row."""
    return np.asarray(_powers(xy, len(flow)) @ flow)


def _powers(xy: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    return (xy[:, 1:] / _ROW_SCALE_PX) ** np.arange(count)


def _flow(start: NDArray[np.float64], steps: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Return the polynomials of the row, of at most this degree, that fit displacements; (0, 2) without any.

    A floor that a level camera drives over moves by the square of the distance from the horizon.
    """
    if len(start) == 0:
        return np.zeros((0, 2))
    terms = _powers(start, degree + 1)
    stiffness = _STIFFNESS * np.diag([0.0, *np.ones(degree)])
    return np.asarray(np.linalg.solve(terms.T @ terms + stiffness + 1e-9 * np.eye(degree + 1), terms.T @ steps))
