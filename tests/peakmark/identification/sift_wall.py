"""Walls of markers for the tests of SIFT's: what is where is known."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.search.sweeps import draw_marker
from peakmark.markers.patterns import Variant

CELL_PX = 160
KINDS = [Variant(polarity, limit, "sift") for polarity in ("dark", "light") for limit in ("energy", "range")]


@cache
def wall(
    kinds: tuple[Variant, ...] = tuple(KINDS) * 2,
) -> tuple[NDArray[np.uint8], list[tuple[Variant, NDArray[np.float64], float]]]:
    """Return an image of one marker a cell, four a row, of 22…60 px and tilts to 50°, and what is where."""
    rng = np.random.default_rng(5)
    rows, truth = len(kinds) // 4, []
    levels = np.empty((CELL_PX * rows, CELL_PX * 4))
    for k, kind in enumerate(kinds):
        corner = CELL_PX * np.array([k % 4, k // 4])
        center, side = 79.5 + rng.uniform(-9, 9, 2), float(rng.uniform(22, 60))
        shown = draw_marker(
            center, side, float(rng.uniform(0, 50)), float(rng.uniform(0, 360)), kind, (CELL_PX, CELL_PX)
        )
        levels[corner[1] : corner[1] + CELL_PX, corner[0] : corner[0] + CELL_PX] = shown
        truth.append((kind, center + corner, side))
    return np.clip(np.rint(40 + 170 * levels + rng.normal(0, 1.5, levels.shape)), 0, 255).astype(np.uint8), truth
