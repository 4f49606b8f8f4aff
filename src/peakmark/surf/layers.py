"""Geometry of SURF's scale space: octaves, layers and filter sides.

Layer l of octave o filters with a square of side (9 + 6 l) 2^o, placed every 2^o px. Bay, Ess, Tuytelaars and
Van Gool, "Speeded-Up Robust Features", 2008, doi:10.1016/j.cviu.2007.09.014; rounding as OpenCV's.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Layer:
    """One layer of the scale space."""

    octave: int
    """Octave, 0 is the finest."""
    index: int
    """Number in the octave, 0 … layers + 1; maxima are sought in 1 … layers."""

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
