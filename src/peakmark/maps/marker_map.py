"""Where markers and arrays are in the world: on walls, floors, boxes, or on a printed sheet."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.localise.from_arrays import Place
from peakmark.markers.array_code import THREE_BIT, Layout
from peakmark.markers.patterns import Polarity

LARGEST_SIDE_M, FARTHEST_M = 5.0, 1000.0
"""Of a map in metres; larger numbers are of another unit."""


@dataclass(frozen=True)
class MappedArray:
    """An array on a map."""

    code: int
    """The number that it carries."""
    rows: tuple[int, ...]
    """Its markers, as indices into the map, in reading order from the blank corner."""


@dataclass(frozen=True, eq=False)
class MarkerMap:
    """Printed markers with their positions; those of arrays carry a number, the others none."""

    centers_m: NDArray[np.float64]
    """(m, 3) world."""
    axes: NDArray[np.float64]
    """(m, 3, 2) unit vectors along the pattern's x (right) and y (down), world."""
    sides_m: NDArray[np.float64]
    """(m,) sides of the printed patterns."""
    polarities: tuple[Polarity | None, ...]
    """Of each; None where it is not known."""
    arrays: tuple[MappedArray, ...] = ()
    """Those of them that form arrays."""
    layout: Layout = THREE_BIT
    """Of its arrays."""
    pages: NDArray[np.intp] | None = None
    """(m,) sheet of paper that each is on, from 1: sheets lie anywhere to one another. None: all are one piece."""
    sigma_m: NDArray[np.float64] | None = None
    """(m, 3) standard deviations of the centres where they were measured; None where they are taken as exact."""

    def __post_init__(self) -> None:
        count = len(self.centers_m)
        shapes = (self.centers_m.shape, self.axes.shape, self.sides_m.shape, (len(self.polarities),))
        expected = ((count, 3), (count, 3, 2), (count,), (count,))
        if not count or shapes != expected:
            raise InputError(
                f"map: expected markers with one centre, frame, side and polarity each, got shapes {shapes}"
            )
        if not (np.isfinite(self.centers_m).all() and np.isfinite(self.axes).all() and (self.sides_m > 0).all()):
            raise InputError("map: expected finite positions and sides above 0 m")
        if self.sides_m.max() > LARGEST_SIDE_M or np.abs(self.centers_m).max() > FARTHEST_M:
            raise InputError(
                f"map: expected metres, sides of at most {LARGEST_SIDE_M:g} and positions within {FARTHEST_M:g}, got a "
                f"side of {self.sides_m.max():g} at {np.abs(self.centers_m).max():g}; is it in millimetres?"
            )

    def __len__(self) -> int:
        return len(self.centers_m)

    @property
    def pieces(self) -> tuple["MarkerMap", ...]:
        """Its sheets of paper, or itself."""
        if self.pages is None:
            return (self,)
        return tuple(self[np.flatnonzero(self.pages == page)] for page in np.unique(self.pages))

    @property
    def places(self) -> dict[int, Place]:
        """Code → where its array is; a code that is there twice is left out."""
        codes = [array.code for array in self.arrays]
        return {array.code: self.place(array) for array in self.arrays if codes.count(array.code) == 1}

    def place(self, array: MappedArray) -> Place:
        """Return where one of its arrays is."""
        rows = list(array.rows)
        return Place(self.centers_m[rows], self.axes[rows[0]], float(self.sides_m[rows[0]]))

    @property
    def tangents_m(self) -> NDArray[np.float64]:
        """(m, 3, 2) `axes`, as long as the sides."""
        return np.asarray(self.axes * self.sides_m[:, None, None])

    def __getitem__(self, rows: NDArray[np.intp]) -> "MarkerMap":
        """Return some of its markers, and the arrays that are whole among them."""
        new = {int(old): index for index, old in enumerate(rows)}
        arrays = [each for each in self.arrays if all(row in new for row in each.rows)]
        return MarkerMap(
            self.centers_m[rows],
            self.axes[rows],
            self.sides_m[rows],
            tuple(self.polarities[int(row)] for row in rows),
            tuple(MappedArray(each.code, tuple(new[row] for row in each.rows)) for each in arrays),
            self.layout,
            None if self.pages is None else self.pages[rows],
            None if self.sigma_m is None else self.sigma_m[rows],
        )

    def scaled(self, factor: float) -> "MarkerMap":
        """Return the map of prints that came out larger or smaller than they were meant, by a factor of 0.5…2.

        Raises
        ------
        InputError
            If the factor is another.
        """
        if not 0.5 <= factor <= 2:
            raise InputError(f"map: expected a scale of 0.5…2, got {factor:g}")
        return MarkerMap(
            self.centers_m * factor,
            self.axes,
            self.sides_m * factor,
            self.polarities,
            self.arrays,
            self.layout,
            self.pages,
            None if self.sigma_m is None else self.sigma_m * factor,
        )


def joined_layout(pitches: Sequence[float]) -> Layout:
    """Return the layout of arrays with these pitches, in sides; the default one without any.

    Raises
    ------
    InputError
        If they differ by more than the rounding of a file.
    """
    if not len(pitches):
        return THREE_BIT
    if np.ptp(pitches) > 0.02 * np.mean(pitches):
        raise InputError(f"map: expected arrays of one pitch, got {min(pitches):.3g} to {max(pitches):.3g} sides")
    pitch = float(np.mean(pitches))
    return THREE_BIT if abs(pitch - THREE_BIT.pitch) < 0.02 else Layout(pitch=pitch)
