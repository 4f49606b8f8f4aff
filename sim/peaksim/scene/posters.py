"""`[[posters]]` → quads: markers composed texel by texel, so that images and truth agree to the last digit."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, rotation_about
from peaksim.scene import schema as schema
from peaksim.scene.build_markers import check_inside, marker_pattern
from peaksim.scene.build_quads import bend_of, quad_pose
from peaksim.scene.material import PRINT, Material
from peaksim.scene.named_material import PLAIN, Materials, material_of
from peaksim.scene.scene import Mark, Quad
from peaksim.scene.texture import MAX_TEXELS, Texture

_BLANK = "."


def poster_quads(
    tables: tuple[schema.PosterTable, ...],
    room: schema.RoomTable | None,
    materials: Materials = PLAIN,
    folder: Path | None = None,
) -> Iterator[Quad]:
    """Yield the posters; copies of one poster share its texture. `folder` has the patterns that are files."""
    for i, table in enumerate(tables):
        for quad in poster_copies(table, f"posters[{i}]", material_of(table, materials, f"posters[{i}]"), folder):
            yield check_inside(quad, room, f"posters[{i}].center_m")


def poster_copies(
    table: schema.PosterTable, field: str, material: Material = PRINT, folder: Path | None = None
) -> Iterator[Quad]:
    """Yield a poster once, or its copies from the top left, row by row, numbered from 01."""
    texture, size_m, marks = print_poster(table, field, folder)
    bend = bend_of(table, size_m, field)
    middle = quad_pose(table.normal, table.up, table.center_m, field)
    across, down = table.copies
    step_m = table.step_m or size_m
    for k in range(across * down):
        number = f"{k + 1:02d}" if across * down > 1 else ""
        x, y = (k % across - (across - 1) / 2) * step_m[0], ((down - 1) / 2 - k // across) * step_m[1]
        pose = middle @ compose(rotation_about("z", table.turn_deg), [x, y, 0.0])
        named = tuple(Mark(f"{table.name}{number}.{m.name}", m.kind, m.side_m, m.center_m) for m in marks)
        yield Quad(table.name + number, texture, size_m, pose, named, material, bend)


def print_poster(
    table: schema.PosterTable, field: str, folder: Path | None = None
) -> tuple[Texture, tuple[float, float], tuple[Mark, ...]]:
    """Return a poster's texture, its size in metres and its marks, named r0c0 … by row and column.

    Texels are those of the marker patterns; paper size and positions are rounded to whole texels.
    """
    patterns = {letter: marker_pattern(kind, f"{field}.kinds.{letter}", folder) for letter, kind in table.kinds.items()}
    sides = {len(pattern) for pattern in patterns.values()}
    if len(sides) != 1:
        raise SceneError(f"{field}.kinds: expected patterns of one size, got {sorted(sides)} texels")
    side = sides.pop()
    texel_m = table.side_m / side
    width, height = (max(1, round(length / texel_m)) for length in table.paper_m)
    if width * height > MAX_TEXELS:
        raise SceneError(f"{field}.paper_m: expected at most {MAX_TEXELS} texels, got {width}×{height}")
    colors = {pattern.shape[2:] for pattern in patterns.values()} - {()}
    paper = np.full((height, width, *(colors.pop() if colors else ())), round(table.level), np.uint8)
    marks = []
    for row, column, letter in _printed(table):
        left, top = _top_left(table, row, column, (width, height), side)
        pattern = patterns[letter]
        paper[top : top + side, left : left + side] = pattern if pattern.ndim == paper.ndim else pattern[..., None]
        center_m = ((left + side / 2 - width / 2) * texel_m, (height / 2 - top - side / 2) * texel_m)
        marks.append(Mark(f"r{row}c{column}", table.kinds[letter], table.side_m, center_m))
    return Texture.from_array(paper), (width * texel_m, height * texel_m), tuple(marks)


def _printed(table: schema.PosterTable) -> Iterator[tuple[int, int, str]]:
    for row, letters in enumerate(table.rows):
        for column, letter in enumerate(letters):
            if letter != _BLANK:
                yield row, column, letter


def _top_left(table: schema.PosterTable, row: int, column: int, paper: tuple[int, int], side: int) -> tuple[int, int]:
    """Return the first column and row of texels of a marker of the grid, which is centred on the paper."""
    pitch = table.pitch_m / table.side_m * side
    counts = (len(table.rows[0]), len(table.rows))
    first = [(paper[k] - side - (counts[k] - 1) * pitch) / 2 for k in (0, 1)]
    left, top = round(first[0] + column * pitch), round(first[1] + row * pitch)
    return int(np.clip(left, 0, paper[0] - side)), int(np.clip(top, 0, paper[1] - side))
