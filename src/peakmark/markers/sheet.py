"""Markers laid out for print: pages of boxes, discs, DoGs and text in millimetres, from the top left, y down.

`pages` lays tiles out; `sheet_files.write` turns pages into PDF, SVG or PNG. Later items cover earlier ones,
and areas are drawn over one another rather than edge to edge where they can be, so that viewers show no gaps.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.markers.array_code import polarities_of
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA, Polarity, dog_zero_crossing, surf_cells
from peakmark.markers.sheet_shapes import Box, Disc, Dog, Item, Text, text_length

PAPERS_MM = {
    "a2": (420.0, 594.0),
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
"""Width and height of upright pages, millimetres."""

MARGIN_MM = 8.0
"""Blank border of the page, for printers that cannot reach the edge."""

CROP_MM = (1.0, 4.0)
"""Crop marks begin and end at these distances from a tile's corner."""

TEXT_MM = 2.2
"""Height of the small print where there is room."""

SMALLEST_TEXT_MM = 1.2
"""Height below which small print is left out; 3.4 points."""

SCALE_BARS_MM = (50.0, 20.0)
"""Lengths on pages narrower than 140 mm: the first that fits."""

LINE_MM = 0.15
"""Width of crop marks and of the scale bar's ticks."""

_GUTTER_MM = 2 * CROP_MM[1] + 1.0
"""Least distance between tiles: the crop marks of both, and a millimetre."""

APART_STEPS = 1.5
"""Arrays hang at least this far apart, from marker to marker in steps of their lattice, on the sheet already: what is
nearer could be a marker of the same array (`peakmark.arrays.decode.QUIET_STEPS`)."""

_FOOTER_MM = 10.0
"""Room for the scale bar and the small print."""

_LINE_HEIGHT = 1.2
"""From line to line of the small print, in its heights."""

_CAPTION_GAP_MM = 0.5
"""Between a caption and the crop mark to its right."""

SMALLEST_SIDE_MM = 2.0
"""Side whose cells are 0.2 mm: five dots at 600 dpi."""


@dataclass(frozen=True)
class Print:
    """One marker as it is to be printed."""

    pattern: str
    """"surf" or "sift"."""
    side_mm: float
    """Side of the pattern without border, millimetres."""
    polarity: Polarity = "dark"
    """"dark" or "light" centre."""
    limit: Limit = "energy"
    """"energy": the paper's grey marker; "range": the binary one."""

    @property
    def name(self) -> str:
        """Such as "surf-dark" or "sift-range-light"."""
        return "-".join([self.pattern, *(["range"] if self.limit == "range" else []), self.polarity])


@dataclass(frozen=True)
class Placed:
    """A marker at its position on a tile or page."""

    marker: Print
    x_mm: float
    y_mm: float
    """Centre."""


@dataclass(frozen=True)
class Tile:
    """What is cut out together: one marker or one array, without the border around it."""

    name: str
    """Printed below the tile."""
    side_mm: float
    """Side of the square that holds it."""
    markers: tuple[Placed, ...]
    """Relative to the square's top left."""
    stated_gap_mm: float = 0.0
    """Part of the side that does not grow with the markers."""
    apart_mm: float = 0.0
    """Least distance of its outer markers' centres from those of the next tile."""


@dataclass(frozen=True)
class Page:
    """One sheet of paper."""

    width_mm: float
    height_mm: float
    scale_bar_mm: float
    """Length of the scale bar at the bottom."""
    items: tuple[Item, ...]
    """What to draw, in order."""
    markers: tuple[Placed, ...]
    """Where the markers are on the page."""


def marker_tile(marker: Print) -> Tile:
    """Return the tile of a single marker; a pattern or side that cannot be printed is an `InputError`."""
    _check_print(marker)
    half = marker.side_mm / 2
    return Tile(f"{marker.name}, side {marker.side_mm:g} mm", marker.side_mm, (Placed(marker, half, half),))


def array_tile(
    code: int, side_mm: float, gap_mm: float | None = None, limit: Limit = "energy", pattern: str = "surf"
) -> Tile:
    """Return the 3-bit array `code` of "surf" or "sift" markers, 2 × 2 with the upper left blank (Section 4.2).

    `gap_mm` of white separates the markers, half a side unless stated. What cannot be printed is an `InputError`.
    """
    gap = side_mm / 2 if gap_mm is None else gap_mm
    if not 0 <= gap < np.inf:
        raise InputError(f"gap_mm: expected a number ≥ 0, got {gap}")
    near, far = side_mm / 2, 1.5 * side_mm + gap
    prints = [Print(pattern, side_mm, polarity, limit) for polarity in polarities_of(code)]
    _check_print(prints[0])
    centers = zip(prints, ((far, near), (near, far), (far, far)), strict=True)
    markers = tuple(Placed(marker, x, y) for marker, (x, y) in centers)
    of = "" if pattern == "surf" else f" of {pattern}"
    name = f"array {code}{of}, marker side {side_mm:g} mm, gap {gap:g} mm"
    return Tile(name, 2 * side_mm + gap, markers, 0.0 if gap_mm is None else gap, APART_STEPS * (side_mm + gap))


def pages(
    tiles: Sequence[Tile], paper_mm: tuple[float, float], border_mm: float = 5.0, label: str = ""
) -> tuple[Page, ...]:
    """Lay tiles of equal size out on as few pages as needed, row by row, with crop marks and a scale bar.

    A white border lies around each tile, inside the crop marks; the label stands at the bottom of every page.

    Raises
    ------
    InputError
        If a tile with its border, or the label, does not fit the page, or the label is not printable Latin-1.
    """
    if not 0 <= border_mm < np.inf:
        raise InputError(f"border_mm: expected a number ≥ 0, got {border_mm}")
    label = printable(label)
    columns, rows = _capacity(tiles[0], border_mm, paper_mm)
    size = columns * rows
    groups = [tiles[first : first + size] for first in range(0, len(tiles), size)]
    return tuple(_page(group, columns, paper_mm, border_mm, label) for group in groups)


def _capacity(tile: Tile, border_mm: float, paper_mm: tuple[float, float]) -> tuple[int, int]:
    """Return how many columns and rows of tiles, with borders and gutters, fit the page."""
    cut_mm, gutter_mm = tile.side_mm + 2 * border_mm, _gutter_mm(tile, border_mm)
    room = _room_mm(paper_mm)
    columns, rows = (int(n) for n in np.floor((room + gutter_mm + 1e-9) / (cut_mm + gutter_mm)))
    if columns < 1 or rows < 1:
        width, height = paper_mm
        largest = largest_side_mm(tile, paper_mm, border_mm)
        hint = f": a side of {largest:g} mm fits" if largest >= SMALLEST_SIDE_MM else ""
        raise InputError(
            f"{tile.name}: expected at most {room.min():.4g} mm with its border on a page of "
            f"{width:g} × {height:g} mm, got {cut_mm:.4g} mm{hint}"
        )
    return columns, rows


def largest_side_mm(tile: Tile, paper_mm: tuple[float, float], border_mm: float = 5.0) -> float:
    """Return the side of a marker, in whole tenths of a millimetre, with which a tile like this one just fits a page.

    At most 0 where none fits.
    """
    room = _room_mm(paper_mm).min() - 2 * border_mm - tile.stated_gap_mm
    growing = room / (tile.side_mm - tile.stated_gap_mm)
    return float(np.floor(10 * growing * tile.markers[0].marker.side_mm + 1e-9) / 10)


def _room_mm(paper_mm: tuple[float, float]) -> NDArray[np.float64]:
    """Return width and height of what a page holds between its outermost crop marks."""
    return np.asarray(np.array(paper_mm) - 2 * MARGIN_MM - [0, _FOOTER_MM] - _GUTTER_MM)


def _gutter_mm(tile: Tile, border_mm: float) -> float:
    """Return the distance between the cut edges of neighbouring tiles."""
    return max(_GUTTER_MM, tile.apart_mm - tile.markers[0].marker.side_mm - 2 * border_mm)


def _page(tiles: Sequence[Tile], columns: int, paper_mm: tuple[float, float], border_mm: float, label: str) -> Page:
    width, height = paper_mm
    cut, gutter = tiles[0].side_mm + 2 * border_mm, _gutter_mm(tiles[0], border_mm)
    pitch = cut + gutter
    used = min(columns, len(tiles)) * pitch - gutter
    left, top = (width - used) / 2, MARGIN_MM + CROP_MM[1]
    items: list[Item] = []
    placed: list[Placed] = []
    for number, tile in enumerate(tiles):
        x, y = left + number % columns * pitch, top + number // columns * pitch
        items += [*_crop_marks(x, y, cut), *_caption(x, y + cut, cut, tile.name)]
        placed += [Placed(m.marker, x + border_mm + m.x_mm, y + border_mm + m.y_mm) for m in tile.markers]
    for place in placed:
        items += marker_items(place)
    bar = 100.0 if width >= 140 else next(bar for bar in SCALE_BARS_MM if bar <= width - 2 * MARGIN_MM)
    items += _scale_bar(bar, height - MARGIN_MM, width, label)
    return Page(width, height, bar, tuple(items), tuple(placed))


def marker_items(place: Placed) -> tuple[Item, ...]:
    """Return what draws one marker."""
    marker, x, y = place.marker, place.x_mm, place.y_mm
    if marker.pattern == "surf":
        return tuple(_surf_boxes(place))
    sigma = marker.side_mm / SIFT_SIDE_IN_SIGMA
    if marker.limit == "energy":
        return (Dog(x, y, marker.side_mm, sigma, marker.polarity),)
    center, surround = (0.0, 255.0) if marker.polarity == "dark" else (255.0, 0.0)
    square = Box(x - marker.side_mm / 2, y - marker.side_mm / 2, marker.side_mm, marker.side_mm, surround)
    return (square, Disc(x, y, dog_zero_crossing(sigma), center))


def _surf_boxes(place: Placed) -> Iterator[Box]:
    """Yield the SURF marker as boxes that cover one another: square, cross, inner corners, plus, centre."""
    levels = surf_cells(place.marker.polarity, place.marker.limit)
    cell = place.marker.side_mm / len(levels)
    left, top = place.x_mm - place.marker.side_mm / 2, place.y_mm - place.marker.side_mm / 2
    corners = [(r, r + 1, c, c + 1) for r in (2, 6) for c in (2, 6)]
    cross = [(0, 9, 2, 7), (2, 7, 0, 9)]
    plus = [(2, 7, 3, 6), (3, 6, 2, 7)]
    for row, row_end, column, column_end in [(0, 9, 0, 9), *cross, *corners, *plus, (3, 6, 3, 6)]:
        yield Box(
            left + column * cell,
            top + row * cell,
            (column_end - column) * cell,
            (row_end - row) * cell,
            float(levels[row, column]),
        )


def _crop_marks(x: float, y: float, cut: float) -> Iterator[Box]:
    begin, end = CROP_MM
    for edge in (0.0, cut):
        for outside in (-end, cut + begin):
            yield Box(x + edge - LINE_MM / 2, y + outside, LINE_MM, end - begin, 0.0)
            yield Box(x + outside, y + edge - LINE_MM / 2, end - begin, LINE_MM, 0.0)


def _scale_bar(length: float, bottom: float, page_width: float, label: str) -> Iterator[Item]:
    """Yield a bar whose ticks' centres are `length` apart, and the small print after it."""
    note = f"{length:g} mm between the ticks if printed at 100 %"
    text_mm, lines = _small_print("   ".join(filter(None, [note, "peakmark", label])), page_width - 2 * MARGIN_MM)
    y = bottom - len(lines) * _LINE_HEIGHT * text_mm + (_LINE_HEIGHT - 1) * text_mm - 2.0
    yield Box(MARGIN_MM, y - LINE_MM / 2, length, LINE_MM, 0.0)
    for x in (MARGIN_MM, MARGIN_MM + length):
        yield Box(x - LINE_MM / 2, y - 1.5, LINE_MM, 3.0, 0.0)
    for above, line in enumerate(reversed(lines)):
        yield Text(MARGIN_MM, bottom - above * _LINE_HEIGHT * text_mm, text_mm, line)


def _small_print(text: str, room_mm: float) -> tuple[float, list[str]]:
    """Return height and lines of the small print: on one line as large as fits, on up to three on narrow pages."""
    for height, most in ((TEXT_MM, 1), (0.8 * TEXT_MM, 1), (0.8 * TEXT_MM, 2), (SMALLEST_TEXT_MM, 3)):
        lines = _wrapped(text, room_mm / height)
        if len(lines) <= most and max(map(text_length, lines)) * height <= room_mm:
            return height, lines
    raise InputError(f"label: expected one that fits {room_mm:g} mm of small print, got {text!r}")


def _wrapped(text: str, room: float) -> list[str]:
    """Return text in lines of at most `room` heights; longer words stand alone."""
    if text_length(text) <= room:
        return [text]
    lines: list[str] = []
    for word in text.split():
        if lines and text_length(longer := f"{lines[-1]} {word}") <= room:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _caption(x: float, bottom: float, cut: float, name: str) -> Iterator[Text]:
    """Yield a tile's name between its lower crop marks: smaller where they are near, nothing where too near."""
    room = cut - CROP_MM[0] - _CAPTION_GAP_MM
    height = min(TEXT_MM, room / text_length(name))
    if height >= SMALLEST_TEXT_MM:
        yield Text(x + CROP_MM[0], bottom + CROP_MM[1] - 0.5, height, name)


def paper_size(name: str, landscape: bool = False) -> tuple[float, float]:
    """Return width and height in mm of a named paper ("a4") or of "WIDTHxHEIGHT" in mm.

    An unknown name, or a side that is not in 50…2000 mm, is an `InputError`.
    """
    if name.lower() in PAPERS_MM:
        size = PAPERS_MM[name.lower()]
    else:
        try:
            width, height = (float(side) for side in name.lower().split("x"))
        except ValueError:
            known = ", ".join(PAPERS_MM)
            raise InputError(f"paper: expected {known} or WIDTHxHEIGHT in mm, got {name!r}") from None
        size = (width, height)
    if not all(50 <= side <= 2000 for side in size):
        raise InputError(f"paper: expected sides of 50…2000 mm, got {size[0]:g} × {size[1]:g} mm")
    return size[::-1] if landscape else size


def printable(text: str) -> str:
    """Return `text` if the small print can show it: at most 80 characters of Latin-1; else raise an `InputError`."""
    if len(text) > 80 or not text.isprintable() or any(ord(character) > 255 for character in text):
        raise InputError(f"label: expected at most 80 printable Latin-1 characters, got {text[:90]!r}")
    return text


def _check_print(marker: Print) -> None:
    if marker.pattern not in ("surf", "sift"):
        raise InputError(f"marker: expected surf or sift, got {marker.pattern!r}")
    if not SMALLEST_SIDE_MM <= marker.side_mm <= 2000:
        raise InputError(f"side_mm: expected {SMALLEST_SIDE_MM:g}…2000 mm, got {marker.side_mm}")
