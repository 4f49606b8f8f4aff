"""A printed sheet as paper in a scene: the result.json of `peakmark marker` says which markers lie where on which page.

Crop marks, captions and the scale bar are left white.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim import shipped
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import compose, rotation_about
from peaksim.scene import schema as schema
from peaksim.scene.build_markers import check_inside, marker_pattern
from peaksim.scene.build_quads import bend_of, quad_pose
from peaksim.scene.named_material import PLAIN, Materials, material_of
from peaksim.scene.scene import Mark, Quad
from peaksim.scene.texture import Texture
from peaksim.text_file import read_text

_LARGEST_FILE = 10_000_000  # bytes
_TEXELS = 24_000_000
"""Texels of one page at most: A4 at 480 dpi."""
_TEXELS_A_SIDE = 144
"""Texels of a marker's side, where the page has room for them: those of its pattern."""

Sheet = tuple[Texture, tuple[float, float], tuple[Mark, ...]]
"""What is printed on a page, its width and height in metres, and its marks, named m1, m2, …"""


def sheet_quads(
    tables: tuple[schema.SheetTable, ...], room: schema.RoomTable | None, folder: Path, materials: Materials = PLAIN
) -> Iterator[Quad]:
    """Yield the pages of `[[sheets]]`."""
    for i, table in enumerate(tables):
        field = f"sheets[{i}]"
        file = shipped.file_inside(folder, table.file, f"{field}.file")
        try:
            texture, size_m, marks = read_sheet(file, table.page)
        except InputError as error:
            raise SceneError(f"{field}.file: {error}") from error
        pose = quad_pose(table.normal, table.up, table.center_m, field)
        pose = pose @ compose(rotation_about("z", table.turn_deg), [0.0, 0.0, 0.0])
        named = tuple(Mark(f"{table.name}.{m.name}", m.kind, m.side_m, m.center_m) for m in marks)
        material, bend = material_of(table, materials, field), bend_of(table, size_m, field)
        yield check_inside(Quad(table.name, texture, size_m, pose, named, material, bend), room, f"{field}.center_m")


def read_sheet(path: str | Path, page: int = 1) -> Sheet:
    """Return a page of a printed sheet.

    Parameters
    ----------
    path
        The result.json that `peakmark marker` wrote, or its folder.
    page
        From 1.

    Raises
    ------
    SceneError
        One line that names the file: it is missing, none, or has no such page.
    """
    file = Path(path) / "result.json" if Path(path).is_dir() else Path(path)
    try:
        values = json.loads(read_text(file, _LARGEST_FILE))
        width_mm, height_mm = (float(side) for side in values["page_mm"])
        printed = [_printed(marker, str(file)) for marker in values["markers"] if marker["page"] == page]
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, RecursionError) as error:
        fault = " ".join(f"{type(error).__name__} {error}".split())[:100]
        raise SceneError(f"{file}: expected the result.json of a sheet of markers: {fault}") from error
    if not printed:
        raise SceneError(f"{file}: page: expected one with markers, got {page}")
    if not (0 < width_mm < 10_000 and 0 < height_mm < 10_000):
        raise SceneError(f"{file}: page_mm: expected two lengths of paper, got {values['page_mm']}")
    return _painted(printed, (width_mm, height_mm), str(file))


def _printed(marker: dict[str, Any], path: str) -> tuple[str, float, float, float]:
    """Return the kind of a marker, its side, and its centre from the top left, mm."""
    kind = "-".join([marker["pattern"], *(["range"] if marker["limit"] == "range" else []), marker["polarity"]])
    x_mm, y_mm = (float(value) for value in marker["center_mm"])
    side_mm = float(marker["side_mm"])
    if not (np.isfinite([x_mm, y_mm]).all() and 0.1 <= side_mm < 10_000):
        raise SceneError(f"{path}: markers: expected a side of 0.1 mm or more and a finite centre, got {marker}")
    return kind, side_mm, x_mm, y_mm


def _painted(printed: list[tuple[str, float, float, float]], page_mm: tuple[float, float], path: str) -> Sheet:
    """Return a page: each texel is the mean of the pattern over it, so that markers lie where they are stated to."""
    width_mm, height_mm = page_mm
    finest = min(side for _, side, _, _ in printed) / _TEXELS_A_SIDE
    texel_mm = max(finest, float(np.sqrt(width_mm * height_mm / _TEXELS)))
    size = max(1, round(width_mm / texel_mm)), max(1, round(height_mm / texel_mm))
    scale = size[0] / width_mm, size[1] / height_mm
    paper = np.full((size[1], size[0]), 255.0, np.float32)
    marks = []
    for k, (kind, side_mm, x_mm, y_mm) in enumerate(printed, start=1):
        pattern = marker_pattern(kind, f"{path}: markers[{k - 1}]").astype(np.float64)
        across, down = (
            _shares(len(pattern), (center - side_mm / 2) * per_mm, side_mm * per_mm, count)
            for center, per_mm, count in zip((x_mm, y_mm), scale, size, strict=True)
        )
        columns, rows = (np.flatnonzero(share.any(axis=1)) for share in (across, down))
        if not len(columns) or not len(rows):
            raise SceneError(
                f"{path}: markers[{k - 1}]: expected a marker on the page, got one at {x_mm:g}, {y_mm:g} mm"
            )
        box = np.ix_(rows, columns)
        white = 1 - down[rows].sum(axis=1)[:, None] * across[columns].sum(axis=1)
        paper[box] = down[rows] @ pattern @ across[columns].T + white * paper[box]
        center_m = ((x_mm - width_mm / 2) / 1000, (height_mm / 2 - y_mm) / 1000)
        marks.append(Mark(f"m{k}", kind, side_mm / 1000, center_m))
    texture = Texture.from_array(np.rint(paper).astype(np.uint8))
    return texture, (width_mm / 1000, height_mm / 1000), tuple(marks)


def _shares(cells: int, start: float, length: float, texels: int) -> NDArray[np.float64]:
    """Return (texels, cells) shares of each texel that equal cells from `start` on cover, in texels."""
    edges = start + np.arange(cells + 1) / cells * length
    ends = np.arange(texels + 1)[:, None]
    covered = np.clip(ends[1:], edges[:-1], edges[1:]) - np.clip(ends[:-1], edges[:-1], edges[1:])
    return np.asarray(covered)
