"""How an array of markers carries a number: a grid whose upper left corner is blank, one bit a marker."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from peakmark.errors import InputError
from peakmark.markers.patterns import Polarity

LARGEST = 16
"""Most rows or columns of an array."""


@dataclass(frozen=True)
class Layout:
    """A grid of markers of one size, the upper left corner blank.

    In reading order, from the most significant bit to the least, a light marker is a 1 (its Laplacian is +1 in the
    paper, Section 4.2). For the paper's 2×2 that is its order: topmost, leftmost, remaining.

    Raises
    ------
    InputError
        If a side is not in 2…16, or the pitch not in 1.05…4.
    """

    rows: int = 2
    columns: int = 2
    pitch: float = 1.5
    """Distance of neighbouring centres in sides of a marker."""
    parity: bool = False
    """Whether the last marker carries no bit but makes the number of light markers even."""

    def __post_init__(self) -> None:
        for name, value in (("rows", self.rows), ("columns", self.columns)):
            if isinstance(value, bool) or value not in range(2, LARGEST + 1):
                raise InputError(f"layout: {name}: expected a whole number in 2…{LARGEST}, got {value!r}")
        if not 1.05 <= self.pitch <= 4:
            raise InputError(f"layout: pitch: expected 1.05…4 sides, got {self.pitch!r}")

    @property
    def cells(self) -> tuple[tuple[int, int], ...]:
        """(column, row) of every marker in reading order."""
        return tuple((column, row) for row in range(self.rows) for column in range(self.columns))[1:]

    @property
    def bits(self) -> int:
        """Number of bits that the array carries."""
        return len(self.cells) - self.parity


THREE_BIT = Layout()
"""The paper's super-marker: eight codes."""


def polarities_of(code: int, layout: Layout = THREE_BIT) -> tuple[Polarity, ...]:
    """Return the polarities that print a code, in reading order.

    Raises
    ------
    InputError
        If the code is not an integer that the layout can carry.
    """
    if isinstance(code, bool) or not isinstance(code, int | np.integer) or not 0 <= code < 2**layout.bits:
        raise InputError(f"code: expected an integer in 0…{2**layout.bits - 1}, got {code!r}")
    light = [bool(int(code) >> bit & 1) for bit in reversed(range(layout.bits))]
    if layout.parity:
        light.append(sum(light) % 2 == 1)
    return tuple("light" if bit else "dark" for bit in light)


def code_of(polarities: Sequence[Polarity], layout: Layout = THREE_BIT) -> int | None:
    """Return the code of polarities in reading order, None if the parity is wrong.

    Raises
    ------
    InputError
        If there are not as many as the layout has markers.
    """
    if len(polarities) != len(layout.cells):
        raise InputError(f"polarities: expected {len(layout.cells)}, got {len(polarities)}")
    light = [polarity == "light" for polarity in polarities]
    if layout.parity and sum(light) % 2:
        return None
    return sum(bit << place for place, bit in enumerate(reversed(light[: layout.bits])))
