"""The SIFT marker along its radius: what an alignment compares with an image."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import DOG_RATIO, SIFT_SIDE_IN_SIGMA, Polarity, check_pattern, dog_zero_crossing

DISC_RADIUS = dog_zero_crossing(1 / SIFT_SIDE_IN_SIGMA)
"""Of the printed disc, sides."""

RADII, MOST_RADII = 16, 32
"""Of the DoG's profile, that it is linear between them: off by 0.003 of black to white at most, or by 0.0007. With few,
blur, size and contrast together make up for what is missing."""

_REACH, _EDGE = 0.42, 0.004
"""Radius from which the DoG counts as level, and width of the disc's edge, sides."""


@cache
def sift_profile(
    polarity: Polarity = "dark", limit: Limit = "energy", count: int = RADII
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return radii (k,), rising, sides, and the levels 0…1 there (k,), of a pattern that is linear between them.

    A DoG has `count` of them, a disc two.
    """
    check_pattern(polarity, limit)
    radii, levels = _disc_profile() if limit == "range" else _dog_profile(count)
    levels = levels if polarity == "dark" else 1 - levels
    radii.setflags(write=False)
    levels.setflags(write=False)
    return radii, levels


def _disc_profile() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return DISC_RADIUS + np.array([-0.5, 0.5]) * _EDGE, np.array([0.0, 1.0])


def _dog_profile(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the polygon with least squares from the stretched DoG, its radii denser where that bends more."""
    r = np.linspace(0, _REACH, 4001)
    sigma = 1 / SIFT_SIDE_IN_SIGMA
    outer, inner = (np.exp(-(r**2) / (2 * s**2)) / s**2 for s in (DOG_RATIO * sigma, sigma))
    level = (outer - inner - (outer - inner).min()) / np.ptp(outer - inner)
    bend = np.sqrt(np.abs(np.gradient(np.gradient(level, r), r))) + 0.5
    steps = np.concatenate([[0], np.cumsum((bend[1:] + bend[:-1]) / 2)])
    radii = np.interp(np.linspace(0, steps[-1], count), steps, r)
    tents = np.maximum(0, np.column_stack([np.interp(r, radii, unit) for unit in np.eye(count)]))
    return radii, np.clip(np.linalg.lstsq(tents, level, rcond=None)[0], 0, 1)
