"""Points of a reconstruction brought to known positions: which is which, and the scale, rotation and shift between."""

from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError

_MOST = 24
"""Points of either side; triples of them are tried."""


@dataclass(frozen=True)
class Similarity:
    """x → scale · rotation x + shift, from a reconstruction to the world."""

    scale: float
    """World units a unit of the reconstruction."""
    rotation: NDArray[np.float64]
    """(3, 3)."""
    shift: NDArray[np.float64]
    """(3,) world units."""
    matches: tuple[tuple[int, int], ...]
    """Rows of the points, and of the known positions that they are."""
    errors: NDArray[np.float64]
    """(m,) distances of the matched points from their positions after this, world units."""

    def __call__(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return points (n, 3) of the reconstruction in the world."""
        return np.asarray(self.scale * np.asarray(points, dtype=np.float64) @ self.rotation.T + self.shift)


def align_points(points: ArrayLike, known: ArrayLike, within: float) -> Similarity:
    """Return what brings the most of points (n, 3) to known positions (k, 3), within so many world units.

    Nobody needs to say which point is which: every three are tried as every three of the others. A layout that looks
    the same from several sides has no single answer; then it is the one of least error. Points that are none of the
    known ones are left out.

    Raises
    ------
    InputError
        If either side has fewer than three or more than 24 points, or no three of them fit.
    """
    source, target = (np.asarray(one, dtype=np.float64).reshape(-1, 3) for one in (points, known))
    for name, one in (("points", source), ("known", target)):
        if not 3 <= len(one) <= _MOST:
            raise InputError(f"{name}: expected 3…{_MOST} positions, got {len(one)}")
    best: Similarity | None = None
    gaps = np.linalg.norm(source[:, None] - source, axis=2)
    for chosen in combinations(range(len(target)), 3):
        sides = np.linalg.norm(target[list(chosen)] - target[np.roll(chosen, 1)], axis=1)
        for trial in permutations(range(len(source)), 3):
            seen = gaps[list(trial), np.roll(trial, 1)]
            if not (seen > 0).all() or np.ptp(sides / seen) * seen.min() > 4 * within:
                continue
            fit = _refitted(source, target, list(zip(trial, chosen, strict=True)), within)
            if fit is not None and (best is None or _worth(fit) > _worth(best)):
                best = fit
    if best is None:
        raise InputError(f"points: expected three of the known positions within {within:g}, got none that fit")
    return best


def _worth(fit: Similarity) -> tuple[int, float]:
    return len(fit.matches), -float(np.linalg.norm(fit.errors))


def _refitted(
    source: NDArray[np.float64], target: NDArray[np.float64], pairs: list[tuple[int, int]], within: float
) -> Similarity | None:
    """Return the fit of all pairs that lie within, from three of them; None where not even these do."""
    fit = _fitted(source, target, pairs)
    for _ in range(2):
        gaps = np.linalg.norm(fit(source)[:, None] - target, axis=2)
        near = gaps.argmin(axis=1)
        pairs = [(i, int(k)) for i, k in enumerate(near) if gaps[i, k] < within and gaps[:, k].argmin() == i]
        if len(pairs) < 3:
            return None
        fit = _fitted(source, target, pairs)
    return fit


def _fitted(source: NDArray[np.float64], target: NDArray[np.float64], pairs: list[tuple[int, int]]) -> Similarity:
    """Return the least squares (Umeyama 1991, doi:10.1109/34.88573)."""
    a, b = (one[[pair[k] for pair in pairs]] for k, one in enumerate((source, target)))
    middle_a, middle_b = a.mean(axis=0), b.mean(axis=0)
    u, values, vt = np.linalg.svd((b - middle_b).T @ (a - middle_a))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ np.diag(signs) @ vt
    scale = float((values * signs).sum() / ((a - middle_a) ** 2).sum())
    shift = middle_b - scale * rotation @ middle_a
    errors = np.linalg.norm(scale * a @ rotation.T + shift - b, axis=1)
    return Similarity(scale, rotation, shift, tuple(pairs), errors)
