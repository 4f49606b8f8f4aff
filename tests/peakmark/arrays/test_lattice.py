"""Lattices on grids that are seen in perspective: every cell is found, and positions and cells are inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.geometry.pose import invert, transform

from peakmark.arrays.lattice import Lattice, MarkerShapes, expected, lattices, positions
from peakmark.markers.array_code import Layout
from tests.peakmark.arrays.arrays_scene import CAMERA, SIDE_M, detections, facing_wall, printed_array

LAYOUT = Layout(3, 4, pitch=1.5)
views = {"tilt": st.floats(0, 40), "direction": st.floats(0, 360), "roll": st.floats(0, 360)}


def markers_of(tilt: float, direction: float, roll: float, measured: bool) -> MarkerShapes:
    """Return a block of 3 rows and 4 columns, without its upper left marker, from 1.5 m."""
    found, shapes = detections(printed_array(0, layout=LAYOUT), facing_wall(1.5, tilt, direction, roll))
    sizes = np.array([d.size for d in found])[:, None, None] * np.eye(2)
    return MarkerShapes(np.array([d.xy for d in found]), shapes if measured else sizes, np.full(len(found), measured))


def aligned(lattice: Lattice) -> set[tuple[tuple[int, int], int]]:
    """Return cells from the box's corner on, and their markers."""
    left, top = np.array(list(lattice.cells)).min(axis=0)
    return {((x - left, y - top), marker) for (x, y), marker in lattice.cells.items()}


def quarters(cells: set[tuple[tuple[int, int], int]], size: tuple[int, int]) -> list[set[tuple[tuple[int, int], int]]]:
    """Return the cells in four orientations."""
    columns, rows = size
    found = []
    for _ in range(4):
        found.append(cells)
        cells = {((rows - 1 - y, x), marker) for (x, y), marker in cells}
        columns, rows = rows, columns
    return found


@pytest.mark.parametrize("measured", [False, True])
@given(**views)
def test_the_squarest_lattice_is_the_printed_one(measured: bool, tilt: float, direction: float, roll: float) -> None:
    best = lattices(markers_of(tilt, direction, roll, measured), LAYOUT.pitch)[0]
    printed = {(cell, index) for index, cell in enumerate(LAYOUT.cells)}
    assert aligned(best) in quarters(printed, (LAYOUT.columns, LAYOUT.rows))
    assert len(best.empty) == 1
    assert sorted(best.size) == [3, 4]
    assert best.anisotropy >= 1


@given(**views)
def test_cells_are_where_they_are_expected_and_positions_lead_back(tilt: float, direction: float, roll: float) -> None:
    markers = markers_of(tilt, direction, roll, True)
    lattice = lattices(markers, LAYOUT.pitch)[0]
    cells = np.array(list(lattice.cells), dtype=np.float64)
    xy, in_front = expected(markers, lattice, cells)
    assert in_front.all()
    step_px = markers.sizes.mean() * LAYOUT.pitch
    assert np.abs(xy - markers.xy[list(lattice.cells.values())]).max() < 0.03 * step_px
    assert np.allclose(positions(markers, lattice)[list(lattice.cells.values())], cells, atol=0.03)
    (corner,), _ = expected(markers, lattice, np.array(lattice.empty, dtype=np.float64))
    blank = np.array([[-1.5, 1.0, 0.0]]) * SIDE_M * LAYOUT.pitch
    seen = CAMERA.project(transform(invert(facing_wall(1.5, tilt, direction, roll)), blank))
    assert np.abs(corner - seen).max() < 0.06 * step_px
