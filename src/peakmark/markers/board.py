"""A board for calibration: as many coded arrays as a page holds, each with a number of its own."""

from collections.abc import Iterator

from peakmark.errors import InputError
from peakmark.markers.array_code import Layout, polarities_of
from peakmark.markers.optimum import Limit
from peakmark.markers.sheet import Page, Placed, Print, Tile, pages

BOARD_LAYOUT = Layout(rows=3, columns=3, parity=True)
"""Eight markers, of which seven carry 128 codes and one the parity: half of them seen in the corner of an image, an
array still stands where the whole ones say."""

SIDE_OF_PAGE = 22.5
"""The shorter side of the page over the side of a marker, unless stated: 13 mm on A3, 9 mm on A4, in four columns and
five rows of arrays, 160 markers. A camera of 1280×960 px that sees the whole board shows a marker 28 px large."""


def board_tile(code: int, side_mm: float, limit: Limit = "energy") -> Tile:
    """Return the board's array of a code."""
    layout, pitch = BOARD_LAYOUT, BOARD_LAYOUT.pitch * side_mm
    prints = [Print("surf", side_mm, polarity, limit) for polarity in polarities_of(code, layout)]
    centers = [(side_mm / 2 + column * pitch, side_mm / 2 + row * pitch) for column, row in layout.cells]
    markers = tuple(Placed(marker, x, y) for marker, (x, y) in zip(prints, centers, strict=True))
    extent = side_mm + (layout.columns - 1) * pitch
    return Tile(f"{code}", extent, markers, apart_mm=1.5 * pitch)


def board_page(paper_mm: tuple[float, float], side_mm: float | None = None, label: str = "") -> tuple[Page, int]:
    """Return the page of a board, and how many arrays it holds: the codes 0, 1, … row by row.

    Raises
    ------
    InputError
        If the page holds none.
    """
    side = round(min(paper_mm) / SIDE_OF_PAGE, 1) if side_mm is None else side_mm
    count = max(_fitting(paper_mm, side, label), default=0)
    if count < 2:
        raise InputError(f"side_mm: expected one with which a page holds two arrays or more, got {side:g}")
    tiles = [board_tile(code, side) for code in range(count)]
    return pages(tiles, paper_mm, 0.0, label)[0], count


def _fitting(paper_mm: tuple[float, float], side_mm: float, label: str) -> Iterator[int]:
    """Yield how many arrays the first page takes of as many as there are codes."""
    tiles = [board_tile(code, side_mm) for code in range(2**BOARD_LAYOUT.bits)]
    laid_out = pages(tiles, paper_mm, 0.0, label)
    yield len(laid_out[0].markers) // len(BOARD_LAYOUT.cells)
