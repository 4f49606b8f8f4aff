"""Markers on a square lattice seen in perspective: corners of three, grown cell by cell.

A corner is a marker with its neighbours along the lattice's two axes, columns and rows, the second a quarter clockwise
from the first as for x and y in an image: printed paper is never seen mirrored.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import NDArray

Points = NDArray[np.float64]
Cell = tuple[int, int]


@dataclass(frozen=True)
class Limits:
    """What a square of markers may look like."""

    area: float
    """Factor by which its side, as the root of its area, may differ from what each marker's size tells."""
    anisotropy: float
    """Ratio of its longest to its shortest side, after undoing the shape that is known."""
    rotation_deg: float
    """Angle between its sides and those of the markers, modulo 90°."""
    plain_anisotropy: float
    """Up to this ratio one square is as plausible as another."""


BY_SIZE = Limits(area=1.35, anisotropy=2.0, rotation_deg=45.0, plain_anisotropy=1.5)
"""Where only SURF's sizes are known: squares tilted to 60° (1 / cos 60° = 2); those tilted to 48° (1 / cos 48° = 1.5)
look like any other. The area allows for the errors of a scale, and for perspective across an array."""

BY_SHAPE = Limits(area=1.2, anisotropy=1.5, rotation_deg=15.0, plain_anisotropy=1.0)
"""Where refined markers tell their shapes: what is left allows for perspective across an array and for noise."""

BY_ROUND_SHAPE = Limits(area=1.2, anisotropy=1.5, rotation_deg=45.0, plain_anisotropy=1.0)
"""Where the shapes are those of round markers, which tell tilt but no rotation."""

SIZE_RATIO = 1.5
"""Markers of one array differ less in size: perspective across a near array, and the errors of a scale."""

CELL_RADIUS = 0.3
"""A marker this near a cell's centre, in steps of the lattice, is in it."""

_NEIGHBOURS = 12
"""Nearest markers among which a corner is sought: the eight around a cell, and a few ghosts."""

_TILT_PRIOR = 0.2
"""Standard deviation of the perspective term g, per step of the lattice: 0.2 is a camera five steps away, grazing."""

_CORNER: tuple[Cell, ...] = ((0, 0), (1, 0), (0, 1))
_SIDES: tuple[Cell, ...] = ((1, 0), (0, 1), (-1, 0), (0, -1))


@dataclass(frozen=True)
class MarkerShapes:
    """Centres and shapes of detected markers."""

    xy: Points
    """(n, 2) centres, px."""
    shapes: Points
    """(n, 2, 2) px per side of the pattern, up to a rotation in the marker's plane."""
    is_measured: NDArray[np.bool_]
    """(n,) whether the shape was measured; otherwise it is a size times the identity."""
    is_round: bool = False
    """Whether some are round, so that their rotation in the plane is unknown."""

    @cached_property
    def sizes(self) -> Points:
        """(n,) root of the area, px."""
        return np.asarray(np.sqrt(np.abs(np.linalg.det(self.shapes))))

    @cached_property
    def limits(self) -> Limits:
        """How precisely squares are known."""
        if not self.is_measured.all():
            return BY_SIZE
        return BY_ROUND_SHAPE if self.is_round else BY_SHAPE


@dataclass(frozen=True)
class Lattice:
    """Markers in the cells of a lattice."""

    cells: dict[Cell, int]
    """(column, row) → index of the marker."""
    anisotropy: float
    """Longest over shortest side of the corner that it grew from, after undoing its known shape; 1 is a square."""

    @property
    def members(self) -> frozenset[int]:
        """Indices of its markers."""
        return frozenset(self.cells.values())

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the box around it."""
        cells = np.array(list(self.cells))
        columns, rows = np.ptp(cells, axis=0) + 1
        return int(columns), int(rows)

    @property
    def empty(self) -> list[Cell]:
        """Cells of the box without a marker."""
        columns, rows = self.size
        left, top = np.array(list(self.cells)).min(axis=0)
        box = [(int(left) + x, int(top) + y) for y in range(rows) for x in range(columns)]
        return [cell for cell in box if cell not in self.cells]


def corners(markers: MarkerShapes, pitch: float) -> list[Lattice]:
    """Return every corner, three markers whose sides fit markers of their size at `pitch` sides from one another."""
    near = neighbours(markers, pitch)
    triples = np.array([(i, *pair) for i, others in enumerate(near) for pair in combinations(others, 2)], dtype=np.intp)
    return _fitting(markers, pitch, triples.reshape(-1, 3))


def neighbours(markers: MarkerShapes, pitch: float) -> list[list[int]]:
    """Return for each marker the nearest ones of like size that a step of the lattice may reach."""
    count = min(_NEIGHBOURS + 1, len(markers.xy))
    gaps, nearest = scipy.spatial.cKDTree(markers.xy).query(markers.xy, count)
    longest = pitch * markers.limits.area * np.sqrt(markers.limits.anisotropy)
    longest = longest * np.linalg.norm(markers.shapes, ord=2, axis=(1, 2))
    sizes = markers.sizes
    ratio = sizes[nearest] / sizes[:, None]
    fits = (gaps <= longest[:, None]) & (np.abs(np.log(ratio)) <= np.log(SIZE_RATIO))
    fits &= nearest != np.arange(len(markers.xy))[:, None]
    return [[int(j) for j in row[good]] for row, good in zip(nearest, fits, strict=True)]


def _fitting(markers: MarkerShapes, pitch: float, triples: NDArray[np.intp]) -> list[Lattice]:
    """Return those of (t, 3) markers, the corner first, that are squares within the limits."""
    limits = markers.limits
    sides = np.swapaxes(markers.xy[triples[:, 1:]] - markers.xy[triples[:, :1]], 1, 2) / pitch
    areas = np.linalg.det(sides)
    mirrored = areas < 0
    triples = np.where(mirrored[:, None], triples[:, [0, 2, 1]], triples)
    sides = np.where(mirrored[:, None, None], sides[:, :, ::-1], sides)
    sizes = np.sqrt(np.abs(areas))[:, None] / markers.sizes[triples]
    fits = (sizes.min(axis=1) >= 1 / limits.area) & (sizes.max(axis=1) <= limits.area)
    triples, sides = triples[fits], np.linalg.solve(markers.shapes[triples[fits, 0]], sides[fits])
    longest, shortest = np.linalg.svd(sides, compute_uv=False).T
    fits = (longest <= limits.anisotropy * shortest) & (_rotation_deg(sides) <= limits.rotation_deg)
    anisotropies = longest[fits] / shortest[fits]
    kept = zip(triples[fits].tolist(), anisotropies.tolist(), strict=True)
    return [Lattice(dict(zip(_CORNER, corner, strict=True)), anisotropy) for corner, anisotropy in kept]


def _rotation_deg(sides: Points) -> Points:
    """Return (n,) how far (n, 2, 2) sides are from the pattern's own axes, modulo 90°: 0…45."""
    angle = np.degrees(np.arctan2(sides[:, 1, 0] - sides[:, 0, 1], sides[:, 0, 0] + sides[:, 1, 1]))
    return np.asarray(np.abs((angle + 45) % 90 - 45))


def lattices(markers: MarkerShapes, pitch: float) -> list[Lattice]:
    """Return every lattice that markers may lie on, the squarest first; they overlap where geometry allows several."""
    seen: set[tuple[int, ...]] = set()
    found = []
    for corner in sorted(corners(markers, pitch), key=lambda c: c.anisotropy):
        if tuple(corner.cells.values()) not in seen:
            found.append(grow(markers, corner))
            seen |= _corners_of(found[-1])
    return found


def _corners_of(lattice: Lattice) -> set[tuple[int, ...]]:
    """Return origin, along and down of all corners of a lattice, in its four orientations."""
    cells = lattice.cells
    return {
        (cells[x, y], cells[x + dx, y + dy], cells[x - dy, y + dx])
        for x, y in cells
        for dx, dy in _SIDES
        if (x + dx, y + dy) in cells and (x - dy, y + dx) in cells
    }


def grow(markers: MarkerShapes, lattice: Lattice) -> Lattice:
    """Return a lattice with every marker that continues it."""
    while new := _next_cells(markers, lattice):
        lattice = Lattice({**lattice.cells, **new}, lattice.anisotropy)
    return lattice


def _next_cells(markers: MarkerShapes, lattice: Lattice) -> dict[Cell, int]:
    """Return the markers in free cells beside those of a lattice."""
    around = {(x + dx, y + dy) for x, y in lattice.cells for dx, dy in _SIDES} - lattice.cells.keys()
    centers, inside = expected(markers, lattice, np.array(sorted(around), dtype=np.float64))
    position = positions(markers, lattice)
    size = np.median(markers.sizes[list(lattice.members)])
    alike = np.abs(np.log(markers.sizes / size)) <= np.log(SIZE_RATIO)
    new: dict[Cell, int] = {}
    for cell, within in zip(sorted(around), inside & np.isfinite(centers).all(axis=1), strict=True):
        gaps = np.where(alike, np.linalg.norm(position - cell, axis=1), np.inf)
        nearest = int(np.argmin(gaps))
        if within and gaps[nearest] <= CELL_RADIUS and nearest not in lattice.members:
            new[cell] = nearest
    return new


def expected(markers: MarkerShapes, lattice: Lattice, cells: Points) -> tuple[Points, NDArray[np.bool_]]:
    """Return (k, 2) px where cells (k, 2) are seen, and whether they lie on this side of the horizon."""
    center, shape, tilt = _fit(markers, lattice)
    depth = 1 + cells @ tilt
    return center + cells @ shape.T / np.where(depth > 0, depth, np.nan)[:, None], depth > 0


def positions(markers: MarkerShapes, lattice: Lattice) -> Points:
    """Return (n, 2) columns and rows, as fractions, where all markers would lie in the plane of a lattice."""
    center, shape, tilt = _fit(markers, lattice)
    d = markers.xy - center
    matrices = shape - d[:, :, None] * tilt
    flat = np.abs(np.linalg.det(matrices)) < 1e-9
    matrices[flat] = np.eye(2)
    result = np.linalg.solve(matrices, d[:, :, None])[:, :, 0]
    result[flat | (1 + result @ tilt <= 0)] = np.inf
    return np.asarray(result)


def _fit(markers: MarkerShapes, lattice: Lattice) -> tuple[Points, Points, Points]:
    """Return c, A, g of x = c + A u / (1 + g·u), cells u → px x, by linear least squares.

    A prior of `_TILT_PRIOR` per step holds g at 0 where few or collinear markers do not tell it.
    """
    u = np.array(list(lattice.cells), dtype=np.float64)
    x = markers.xy[list(lattice.cells.values())]
    origin = x[0]
    x = x - origin
    step = float(np.sqrt(np.abs(x).max() ** 2 / max(1.0, np.abs(u - u[0]).max() ** 2)))
    rows = np.zeros((2 * len(u) + 2, 8))
    for axis in (0, 1):
        part = rows[axis * len(u) : (axis + 1) * len(u)]
        part[:, 3 * axis] = 1
        part[:, 3 * axis + 1 : 3 * axis + 3] = u
        part[:, 6:] = -x[:, axis, None] * u
    rows[-2:, 6:] = np.eye(2) * CELL_RADIUS / 10 * step / _TILT_PRIOR
    values = np.concatenate([x.T.ravel(), [0.0, 0.0]])
    fit = np.linalg.lstsq(rows, values, rcond=None)[0]
    return fit[[0, 3]] + origin, fit[[1, 2, 4, 5]].reshape(2, 2), fit[6:]
