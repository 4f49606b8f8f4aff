"""How a candidate key point is settled in OpenCV's own arithmetic, step by step: the search does the same inside C.

OpenCV rounds every box mean to single precision; the same roundings are made in the same order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

_filter_at = function(
    "void filter_at(const i4[height,stride] integral, i8 row, i8 column, i8 side, f4[3] derivatives_at, "
    "f4[2] responses)"
)
_newton_step = function("b1 newton_step_of(const f4[3,3,3] cube, f4[3] step)")
_mask_accepts = function("b1 mask_accepts_at(const i4[height,stride] mask, i8 row, i8 column, i8 side)")


class FilterResponse(NamedTuple):
    """The Hessian at one position, in single precision."""

    derivatives: NDArray[np.float32]
    """(3,) Dxx, Dyy, Dxy, grey levels."""
    determinant: np.float32
    """Dxx Dyy − 0.81 Dxy², rounded as OpenCV's."""
    quick: np.float32
    """The determinant as the search has it first: each derivative is one integer before it is rounded."""


def filter_response(integral: NDArray[np.int32], row: int, column: int, side: int) -> FilterResponse:
    """Return the Hessian under the filter of a side, px, with its top left corner at a row and column."""
    derivatives, responses = np.empty(3, np.float32), np.empty(2, np.float32)
    _filter_at(integral, row, column, side, derivatives, responses)
    return FilterResponse(derivatives, *responses)


def newton_offset(cube: NDArray[np.float32]) -> tuple[bool, NDArray[np.float32]]:
    """Return the step (dx, dy, ds) to the maximum near the middle of a (3, 3, 3) cube over layer, row and column.

    And whether it is accepted: not where it is exactly zero or longer than 1 along an axis. Cramer's rule.
    """
    step = np.empty(3, np.float32)
    return bool(_newton_step(cube, step)), step


def mask_accepts(mask_integral: NDArray[np.int32], row: int, column: int, side: int) -> bool:
    """Return whether at least half of a filter square is inside the mask: OpenCV's rule."""
    return bool(_mask_accepts(mask_integral, row, column, side))
