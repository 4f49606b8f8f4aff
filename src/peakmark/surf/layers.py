"""Geometry of SURF's scale space: octaves, layers, filter sides, and the boxes of the second derivatives.

Layer l of octave o filters with a square of side (9 + 6 l) 2^o, placed every 2^o px. Bay, Ess, Tuytelaars and
Van Gool, "Speeded-Up Robust Features", 2008, doi:10.1016/j.cviu.2007.09.014; rounding as OpenCV's.
"""

from dataclasses import dataclass
from typing import NamedTuple

DXY_WEIGHT = 0.81
"""Balances the box filter for Dxy against those for Dxx and Dyy, squared: 0.9²."""


class Box(NamedTuple):
    """A half-open box inside the filter square, px, and what its mean is multiplied with."""

    x0: int
    y0: int
    x1: int
    y1: int
    weight: int

    @property
    def area(self) -> int:
        """Pixels in the box."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)


@dataclass(frozen=True, slots=True)
class Layer:
    """One layer of the scale space."""

    octave: int
    """Octave, 0 is the finest."""
    index: int
    """Place in the octave, 0 … layers + 1; maxima are sought in 1 … layers."""

    @property
    def step(self) -> int:
        """Spacing of the filter positions, px: 2^octave."""
        return 1 << self.octave

    @property
    def side(self) -> int:
        """Side of the filter square, px: 9, 15, 21, … times the step; always divisible by 3."""
        return (9 + 6 * self.index) << self.octave

    @property
    def offset(self) -> int:
        """Row and column, on the layer's grid, of the filter whose corner is the image's: (side // 2) // step."""
        return 4 + 3 * self.index

    @property
    def margin(self) -> int:
        """Grid rows and columns at each border where a maximum has no neighbours in the layer above."""
        return Layer(self.octave, self.index + 1).offset + 1

    def grid_shape(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns of the layer's grid for an image of this size."""
        return height >> self.octave, width >> self.octave

    def positions(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns of filters that fit into an image of this size; zero if none does."""
        rows, columns = (1 + (length - self.side) // self.step for length in (height, width))
        return (rows, columns) if min(rows, columns) > 0 else (0, 0)


def octave_layers(octave: int, layers: int) -> list[Layer]:
    """The layers + 2 layers of one octave, from the finest."""
    return [Layer(octave, index) for index in range(layers + 2)]


def second_derivative_boxes(side: int) -> tuple[tuple[Box, ...], tuple[Box, ...], tuple[Box, ...]]:
    """Boxes of Dxx, Dyy and Dxy for a filter square of this side, scaled from the square of side 9.

    >>> [box.weight for box in second_derivative_boxes(9)[0]]
    [1, -2, 1]
    """
    at = [round(side * ninths / 9) for ninths in range(10)]
    dxx = tuple(Box(at[x], at[2], at[x + 3], at[7], weight) for x, weight in ((0, 1), (3, -2), (6, 1)))
    dyy = tuple(Box(at[2], at[y], at[7], at[y + 3], weight) for y, weight in ((0, 1), (3, -2), (6, 1)))
    corners = ((1, 1, 1), (5, 1, -1), (1, 5, -1), (5, 5, 1))
    dxy = tuple(Box(at[x], at[y], at[x + 3], at[y + 3], weight) for x, y, weight in corners)
    return dxx, dyy, dxy
