"""Which marker of a map is which: all print the same pattern, so only their arrangement on the floor can tell."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from peakmark.localise.distance import Values

MOST_HYPOTHESES = 12
"""Distinct arrangements of which the poses are refined."""

_MOST_PAIRS, _MOST_OF_ONE = 16, 3
"""Pairs of seen markers from which arrangements are guessed, and how many of them may hold the same marker, so that
one that is not on the map spoils few. Set by hand, to bound the work."""


@dataclass(frozen=True)
class Arrangement:
    """A way to lay what is seen onto the map."""

    rotation_rad: float
    """Rotation from floor to map coordinates."""
    shift_m: NDArray[np.float64]
    """(2,) translation after it."""
    count: int
    """Seen markers that then lie at one of the map."""


def arrangements(
    seen_m: NDArray[np.float64], tolerance_m: NDArray[np.float64], map_m: NDArray[np.float64]
) -> list[Arrangement]:
    """Return the rigid motions that lay most seen markers onto markers of the map, best first, no two alike.

    Seen are (n, 2) markers in any floor coordinates, each off by its (n,) tolerance at most; the map is (m, 2).
    """
    pairs = _telling_pairs(seen_m, tolerance_m)
    motions = [_motions_of_pair(seen_m, tolerance_m, map_m, i, j) for i, j in pairs]
    rotations = np.concatenate([np.empty(0), *(rotation for rotation, _ in motions)])
    shifts = np.concatenate([np.empty((0, 2)), *(shift for _, shift in motions)])
    if len(rotations) == 0:
        return []
    placed = rotated(seen_m[None], rotations[:, None]) + shifts[:, None]
    gaps, nearest = scipy.spatial.cKDTree(map_m).query(placed)
    gaps = gaps / tolerance_m
    fits = gaps < 1
    score = np.where(fits, 1 - gaps**2 / 2, 0).sum(axis=1)
    found: dict[bytes, Arrangement] = {}
    for k in np.argsort(-score, kind="stable"):
        key = np.where(fits[k], nearest[k], -1).tobytes()
        if key not in found:
            found[key] = Arrangement(float(rotations[k]), shifts[k], int(fits[k].sum()))
        if len(found) == MOST_HYPOTHESES:
            break
    return list(found.values())


def rotated(points: NDArray[np.float64], rotation_rad: NDArray[np.float64] | float) -> Values:
    """Return (..., 2) points rotated counter-clockwise by (...) angles."""
    c, s = np.cos(rotation_rad), np.sin(rotation_rad)
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _telling_pairs(seen_m: NDArray[np.float64], tolerance_m: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the pairs whose distance is long for what it may be off: they fix the rotation best."""
    first, second = np.triu_indices(len(seen_m), 1)
    worth = np.linalg.norm(seen_m[first] - seen_m[second], axis=1) / (tolerance_m[first] + tolerance_m[second])
    uses = np.zeros(len(seen_m), dtype=np.intp)
    pairs: list[tuple[int, int]] = []
    for k in np.argsort(-worth, kind="stable"):
        i, j = int(first[k]), int(second[k])
        if max(uses[i], uses[j]) < _MOST_OF_ONE and len(pairs) < _MOST_PAIRS:
            uses[[i, j]] += 1
            pairs.append((i, j))
    return pairs


def _motions_of_pair(
    seen_m: NDArray[np.float64], tolerance_m: NDArray[np.float64], map_m: NDArray[np.float64], i: int, j: int
) -> tuple[Values, Values]:
    """Return (k,) rotations and (k, 2) shifts that lay a pair onto each ordered pair of the map of like distance."""
    step = seen_m[j] - seen_m[i]
    steps = map_m[None] - map_m[:, None]
    lengths = np.linalg.norm(steps, axis=2)
    alike = np.abs(lengths - np.linalg.norm(step)) < tolerance_m[i] + tolerance_m[j]
    a, b = np.nonzero(alike & (lengths > 0))
    rotations = np.arctan2(steps[a, b, 1], steps[a, b, 0]) - np.arctan2(step[1], step[0])
    middle = (map_m[a] + map_m[b]) / 2 - rotated((seen_m[i] + seen_m[j])[None] / 2, rotations)
    return rotations, middle
