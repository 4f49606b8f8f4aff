"""Triangles on which an image is repeated, divided so that each part shows one copy."""

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError

_SLACK = 1e-6
"""Coordinates this far beyond a copy are taken for rounding."""


def divide_at_repeats(
    corners: NDArray[np.float64], uv: NDArray[np.float64], most: int, name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
    """Return triangles whose texture coordinates are all in 0…1, and whether an image goes on beyond its border.

    Parameters
    ----------
    corners, uv
        (n, 3, 3) and (n, 3, 2) positions and texture coordinates of the corners.
    most
        Most triangles.
    name
        What errors start with.

    Raises
    ------
    SceneError
        For coordinates that are not finite, and where there would be too many triangles.
    """
    if not np.isfinite(uv).all():
        raise SceneError(f"{name}: expected finite texture coordinates, got nan or infinity")
    spans = np.ptp(_shifted(uv), axis=1).max(axis=1, initial=0)
    is_repeated = bool((_shifted(uv).max(axis=(1, 2), initial=0) > 1 + _SLACK).any())
    if spans.sum() > most:
        raise SceneError(f"{name}: expected images repeated at most {most} times, got {spans.sum():.3g}")
    both = np.concatenate([corners, _shifted(uv)], axis=2)
    for axis in (3, 4):
        both = _cut_at_integers(both, axis)
        both[:, :, 3:] = _shifted(both[:, :, 3:])
        if len(both) > most:
            raise SceneError(f"{name}: expected at most {most} faces where images are repeated, got more")
    return both[:, :, :3], np.clip(both[:, :, 3:], 0, 1), is_repeated


def _shifted(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 3, 2) coordinates moved by whole copies so that the least are in 0…1."""
    return np.asarray(uv - np.floor(uv.min(axis=1, keepdims=True) + _SLACK))


def _cut_at_integers(triangles: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Return (n, 3, k) triangles cut along 1, 2, … of one of their coordinates, the least of which is in 0…1."""
    done = []
    value = 1
    while len(triangles):
        crosses = triangles[:, :, axis].max(axis=1) > value + _SLACK
        done.append(triangles[~crosses])
        below, triangles = _cut(triangles[crosses], axis, value)
        done.append(below)
        value += 1
    return np.concatenate(done) if done else triangles


def _cut(triangles: NDArray[np.float64], axis: int, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the parts of (n, 3, k) triangles below and above a value of a coordinate; each keeps its orientation."""
    above = triangles[:, :, axis] > value
    odd = above.sum(axis=1) == 1  # one corner above two
    lone = np.argmax(np.where(odd[:, None], above, ~above), axis=1)
    a, b, c = (triangles[np.arange(len(triangles)), (lone + k) % 3] for k in range(3))
    r, s = (((value - a[:, axis]) / (end[:, axis] - a[:, axis]))[:, None] for end in (b, c))
    ab, ac = a + r * (b - a), a + s * (c - a)
    ab[:, axis] = ac[:, axis] = value
    single = np.stack([a, ab, ac], axis=1)
    pair = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    odd_pair = np.concatenate([odd, odd])
    below = np.concatenate([single[~odd], pair[odd_pair]])
    return below, np.concatenate([single[odd], pair[~odd_pair]])
