"""Whether an array's blank corner is bare paper: a marker that was missed, or something in front, looks otherwise."""

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.arrays.lattice import Cell, Lattice, MarkerShapes, expected

TOLERANCE = 0.25
"""Difference from white, and spread, that bare paper may show, in the contrast of the array's own markers. Set by
hand: paper passes beside markers of any size and code, a missed marker or something in front does not (its tests)."""

SPOT = 0.2
"""The same of its one place that differs most: a disc, or the dot of a DoG, is small. In views of training rooms bare
paper differs by 0.12 at most (111 corners of arrays of SURF's, SIFT's markers and discs), a missed marker by 0.30 and
more (84 corners of full blocks)."""

_BLUR = 0.06
"""Of the image before it is sampled, in sides, so that its noise does not count."""

_CELL = np.linspace(-0.5, 0.5, 31)
"""Sampled positions along a whole cell, in steps of the lattice."""

_INNER = (np.arange(13) - 6) / 18
"""The same along the inner two thirds of a marker, in its sides: clear of what lies beside the blank corner."""


def is_blank(gray: NDArray[np.uint8], markers: MarkerShapes, lattice: Lattice, blank: Cell, pitch: float) -> bool:
    """Return whether a cell is as bright as the white in and around the lattice's markers, and even.

    `gray` (H, W) is the image in which the markers were found, `pitch` the distance of neighbours' centres in sides.
    """
    side_px = float(np.median(markers.sizes[list(lattice.members)]))
    soft = np.asarray(cv2.GaussianBlur(gray, (0, 0), max(_BLUR * side_px, 0.1)), dtype=np.uint8)
    printed = _levels(soft, markers, lattice, np.array(list(lattice.cells)), _CELL)
    black, white = np.percentile(printed, [0, 95])  # the dots of three dark DoGs are a hundredth of what is printed
    bare = _levels(soft, markers, lattice, np.array([blank]), _INNER / pitch)
    contrast = max(white - black, 1.0)
    is_even = abs(bare.mean() - white) <= TOLERANCE * contrast and bare.std() <= TOLERANCE * contrast
    return bool(is_even and np.abs(bare - white).max() <= SPOT * contrast)


def _levels(
    gray: NDArray[np.uint8],
    markers: MarkerShapes,
    lattice: Lattice,
    cells: NDArray[np.intp],
    steps: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the grey levels of the pixels nearest to a square grid of points in each of (k, 2) cells."""
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    xy, _ = expected(markers, lattice, (cells[:, None] + grid).reshape(-1, 2))
    columns, rows = np.clip(np.rint(np.nan_to_num(xy)), 0, np.array(gray.shape[::-1]) - 1).astype(np.intp).T
    return np.asarray(gray[rows, columns], dtype=np.float64)
