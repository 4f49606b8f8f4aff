"""Maps from files: a printed sheet's result.json, a scene, or a TOML file of arrays and markers in metres.

A sheet lies in the plane z = 0: the middle of the page is the origin, x points right, y up the page, z out of it.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.pose import transform
from peaksim.scene.build_quads import quad_pose
from peaksim.scene.file import find_scene, load_scene
from peaksim.scene.scene import Scene
from peaksim.scene.schema import NotNegative, Point3, Positive, StrictTable
from peaksim.text_file import read_text
from peaksim.toml_file import parse_toml, validate
from peaksim.whole_file import write_whole
from pydantic import Field

from peakmark.errors import InputError
from peakmark.maps.marker_map import MappedArray, MarkerMap, joined_layout
from peakmark.markers.array_code import THREE_BIT, Layout, code_of, polarities_of
from peakmark.markers.patterns import Polarity
from peakmark.score.arrays import printed_arrays
from peakmark.score.wanted import polarity_of

_LARGEST_FILE = 10_000_000  # bytes
_RIGHT_DOWN = np.array([1.0, -1.0])  # x right and y up of a quad → x right and y down of a pattern


class LayoutTable(StrictTable):
    """`[layout]`: of all arrays; without it they are the 3-bit ones."""

    rows: Annotated[int, Field(ge=2, le=16)] = 2
    columns: Annotated[int, Field(ge=2, le=16)] = 2
    parity: bool = False


class ArrayTable(StrictTable):
    """`[[arrays]]`: an array of SURF markers; `center_m` is the middle of its grid, the blank corner included."""

    code: Annotated[int, Field(ge=0)]
    side_m: Positive
    pitch_m: Positive | None = None
    center_m: Point3
    normal: Point3
    up: Point3 = (0.0, 0.0, 1.0)
    sigma_m: NotNegative | None = None


class MapMarkerTable(StrictTable):
    """`[[markers]]`: a marker that belongs to no array."""

    polarity: Polarity
    side_m: Positive
    center_m: Point3
    normal: Point3 = (0.0, 0.0, 1.0)
    up: Point3 = (0.0, 1.0, 0.0)
    sigma_m: NotNegative | None = None


class MapTable(StrictTable):
    """The whole file."""

    layout: LayoutTable = LayoutTable()
    arrays: tuple[ArrayTable, ...] = ()
    markers: tuple[MapMarkerTable, ...] = ()


def load_map(path: str | Path, scale_bar_mm: float | None = None) -> MarkerMap:
    """Return the map in a sheet's result.json, a scene (a file or the name of a shipped one), or a TOML file.

    `scale_bar_mm` is what the scale bar of a printed sheet measures, where the printer did not keep the size.

    Raises
    ------
    InputError
        One line that names the file, the field, what was expected and what came.
    """
    file = find_scene(path)
    if file.is_dir():
        file = file / "result.json"
    try:
        if file.suffix.lower() == ".json":
            return _sheet_map(json.loads(read_text(file, _LARGEST_FILE)), scale_bar_mm)
        if scale_bar_mm is not None:
            raise InputError(f"--scale-bar-mm {scale_bar_mm:g}: expected with a sheet's result.json alone")
        content = parse_toml(file)
        return scene_map(load_scene(path).scene) if "camera" in content else _toml_map(content, str(file))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError) and str(file) in str(error):
            raise
        fault = error if isinstance(error, InputError) else f"expected the result.json of a sheet: {error!r:.100}"
        raise InputError(f"{file}: {fault}") from error


# --- sheets ---------------------------------------------------------------------------------------------------


def _sheet_map(values: dict[str, Any], scale_bar_mm: float | None) -> MarkerMap:
    """Return the map of what `peakmark marker` printed."""
    markers = values.get("markers")
    if not markers:
        raise InputError("expected the result.json of `peakmark marker`, got one without markers")
    page_mm, stated = np.array(values["page_mm"], dtype=np.float64), float(values["scale_bar_mm"])
    xy_mm = np.array([marker["center_mm"] for marker in markers], dtype=np.float64)
    sides = np.array([marker["side_mm"] for marker in markers], dtype=np.float64) / 1000
    pages = np.array([marker["page"] for marker in markers], dtype=np.intp)
    polarities: tuple[Polarity, ...] = tuple(marker["polarity"] for marker in markers)
    layout: Layout
    if "layout" in values:
        layout = Layout(**values["layout"])
        arrays = board_arrays(polarities, layout)
    else:
        arrays, layout = sheet_arrays(xy_mm / 1000, sides, polarities, pages)
    centers = np.column_stack([(xy_mm - page_mm / 2) * _RIGHT_DOWN / 1000, np.zeros(len(markers))])
    axes = np.broadcast_to(np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]), (len(markers), 3, 2))
    printed = MarkerMap(centers, axes, sides, polarities, arrays, layout, pages)
    if scale_bar_mm is None:
        return printed
    if not stated / 2 <= scale_bar_mm <= 2 * stated:
        expected = f"what the sheet's bar of {stated:g} mm measures, {stated / 2:g}…{2 * stated:g} mm"
        raise InputError(f"--scale-bar-mm {scale_bar_mm:g}: expected {expected}")
    return printed.scaled(scale_bar_mm / stated)


def board_arrays(polarities: Sequence[Polarity], layout: Layout) -> tuple[MappedArray, ...]:
    """Return the arrays of a board, which lists their markers one array after the other."""
    size = len(layout.cells)
    arrays = []
    for first in range(0, len(polarities), size):
        code = code_of(polarities[first : first + size], layout)
        if code is None:
            raise InputError(f"markers {first} to {first + size}: expected an array with an even parity")
        arrays.append(MappedArray(code, tuple(range(first, first + size))))
    return tuple(arrays)


def sheet_arrays(
    xy_m: NDArray[np.float64], sides_m: NDArray[np.float64], polarities: Sequence[Polarity], pages: NDArray[np.intp]
) -> tuple[tuple[MappedArray, ...], Layout]:
    """Return the arrays among (m, 2) centres, x right and y down, and their layout: any three that form a corner.

    A sheet lists the markers of an array one after the other in reading order.
    """
    arrays, pitches = [], []
    for first in range(0, len(xy_m) - 2, 3):
        rows = [first, first + 1, first + 2]
        (top, left, corner), side = xy_m[rows], sides_m[first]
        right, down = corner - left, corner - top
        is_corner = abs(right[1]) + abs(down[0]) + abs(right[0] - down[1]) < 1e-3 * side and right[0] > 0
        if len(set(pages[rows])) == 1 and np.ptp(sides_m[rows]) == 0 and is_corner and right[0] <= 4 * side:
            code = code_of([polarities[row] for row in rows], THREE_BIT)
            assert code is not None
            arrays.append(MappedArray(code, tuple(rows)))
            pitches.append(float(right[0] / side))
    return tuple(arrays), joined_layout(pitches)


# --- scenes ---------------------------------------------------------------------------------------------------


def scene_map(scene: Scene) -> MarkerMap:
    """Return the map of the SURF markers that are printed in a scene; none at all is an `InputError`."""
    marks = [(quad, mark) for quad in scene.quads for mark in quad.marks if mark.kind.startswith("surf")]
    if not marks:
        raise InputError("expected a scene with SURF markers, got none")
    row_of = {mark.name: row for row, (_, mark) in enumerate(marks)}
    centers = [quad.points_m([mark.center_m])[0] for quad, mark in marks]
    axes = [quad.rotation_at(mark.center_m)[:, :2] * _RIGHT_DOWN for quad, mark in marks]
    arrays = printed_arrays(scene)
    return MarkerMap(
        np.array(centers),
        np.array(axes),
        np.array([mark.side_m for _, mark in marks]),
        tuple(polarity_of(mark.kind) for _, mark in marks),
        tuple(MappedArray(each.code, tuple(row_of[name] for name in each.marks)) for each in arrays),
    )


# --- TOML -----------------------------------------------------------------------------------------------------


def _toml_map(content: dict[str, Any], name: str) -> MarkerMap:
    table = validate(MapTable, content, name)
    if not table.arrays and not table.markers:
        raise InputError("expected [[arrays]] or [[markers]], got none")
    pitch = joined_layout([(each.pitch_m or 1.5 * each.side_m) / each.side_m for each in table.arrays]).pitch
    layout = Layout(table.layout.rows, table.layout.columns, pitch, table.layout.parity)
    size, middle = len(layout.cells), (np.array([layout.columns, layout.rows]) - 1) / 2
    poses: list[NDArray[np.float64]] = []
    centers: list[NDArray[np.float64]] = []
    sides: list[float] = []
    polarities: list[Polarity] = []
    arrays: list[MappedArray] = []
    sigmas: list[float | None] = []
    for i, array in enumerate(table.arrays):
        pose = quad_pose(array.normal, array.up, array.center_m, f"arrays[{i}]")
        step = array.pitch_m or 1.5 * array.side_m
        arrays.append(MappedArray(array.code, tuple(range(len(centers), len(centers) + size))))
        on_paper = (np.array(layout.cells) - middle) * _RIGHT_DOWN * step
        centers += list(transform(pose, np.column_stack([on_paper, np.zeros(size)])))
        polarities += _polarities(array.code, layout, f"arrays[{i}]")
        poses += [pose] * size
        sides += [array.side_m] * size
        sigmas += [array.sigma_m] * size
    for i, marker in enumerate(table.markers):
        poses.append(quad_pose(marker.normal, marker.up, marker.center_m, f"markers[{i}]"))
        centers.append(np.array(marker.center_m))
        polarities.append(marker.polarity)
        sides.append(marker.side_m)
        sigmas.append(marker.sigma_m)
    is_measured = any(sigma is not None for sigma in sigmas)
    return MarkerMap(
        np.array(centers),
        np.array([pose[:3, :2] * _RIGHT_DOWN for pose in poses]),
        np.array(sides),
        tuple(polarities),
        tuple(arrays),
        layout,
        sigma_m=np.array([[sigma or 0.0] * 3 for sigma in sigmas], dtype=np.float64) if is_measured else None,
    )


def _polarities(code: int, layout: Layout, field: str) -> tuple[Polarity, ...]:
    try:
        return polarities_of(code, layout)
    except InputError as error:
        raise InputError(f"{field}.{error}") from error


def save_map(marker_map: MarkerMap, path: str | Path) -> None:
    """Write a map as the TOML file that `load_map` reads; one of several sheets of paper is an `InputError`."""
    if marker_map.pages is not None and len(np.unique(marker_map.pages)) > 1:
        raise InputError(f"{path}: expected a map of one piece, got one of several sheets")
    write_whole(Path(path), map_text(marker_map))


def map_text(marker_map: MarkerMap) -> str:
    """Return what `save_map` writes."""
    lines = ["# peakmark map: metres, right-handed; the normal points out of the paper, up along the print"]
    layout, inside = marker_map.layout, {row for array in marker_map.arrays for row in array.rows}
    if (layout.rows, layout.columns, layout.parity) != (2, 2, False):
        lines += ["", "[layout]", f"rows = {layout.rows}", f"columns = {layout.columns}"]
        lines.append(f"parity = {str(layout.parity).lower()}")
    for array in marker_map.arrays:
        side = float(marker_map.sides_m[array.rows[0]])
        centers, cells = marker_map.centers_m[list(array.rows)], np.array(layout.cells, dtype=np.float64)
        # least squares over all markers: a scene's texels round where each of them is
        grid = np.column_stack([cells, np.ones(len(cells))])
        along, down, corner = np.linalg.lstsq(grid, centers, rcond=None)[0]
        middle = corner + (layout.columns - 1) / 2 * along + (layout.rows - 1) / 2 * down
        pitch = float(np.linalg.norm(along) + np.linalg.norm(down)) / 2
        lines += ["", "[[arrays]]", f"code = {array.code}", f"side_m = {side!r}", f"pitch_m = {pitch:.9g}"]
        lines += _frame_lines(marker_map, array.rows, middle)
    for row in range(len(marker_map)):
        if row not in inside:
            side, polarity = float(marker_map.sides_m[row]), marker_map.polarities[row]
            lines += ["", "[[markers]]", f'polarity = "{polarity}"', f"side_m = {side!r}"]
            lines += _frame_lines(marker_map, (row,), marker_map.centers_m[row])
    return "\n".join(lines) + "\n"


def _frame_lines(marker_map: MarkerMap, rows: tuple[int, ...], center_m: NDArray[np.float64]) -> list[str]:
    right, down = marker_map.axes[rows[0]].T
    vectors = {"center_m": center_m, "normal": np.cross(right, -down), "up": -down}
    lines = [f"{name} = [{', '.join(f'{value:.9g}' for value in vector + 0.0)}]" for name, vector in vectors.items()]
    if marker_map.sigma_m is not None:
        lines.append(f"sigma_m = {float(np.sqrt((marker_map.sigma_m[list(rows)] ** 2).mean())):.3g}")
    return lines
