"""`peakmark marker`: sheets of markers and 3-bit arrays for print."""

from dataclasses import asdict
from math import floor
from pathlib import Path
from typing import Annotated, Any, cast

from typer import Argument, Option

from peakmark.cli.command import examples
from peakmark.cli.options import UnusedSeed
from peakmark.errors import InputError
from peakmark.markers.array_code import Layout
from peakmark.markers.board import BOARD_LAYOUT, board_page
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.markers.sheet import (
    SMALLEST_SIDE_MM,
    Page,
    Print,
    Tile,
    array_tile,
    largest_side_mm,
    marker_tile,
    pages,
    paper_size,
)
from peakmark.markers.sheet_files import write
from peakmark.report.results import result_folder, write_json

SIDE_MM, ARRAY_SIDE_MM = 80.0, 60.0
"""Default sides of a marker, alone and in an array, where the page has room for them; both fit A4 with their border."""


@examples(
    "peakmark marker surf --side-mm 80", "peakmark marker array --side-mm 40 --paper a3 --format svg --out sheets"
)
def marker(
    kind: Annotated[str, Argument(help="surf, sift, array (all eight 3-bit arrays), array-0 … array-7, or board")],
    out: Annotated[Path, Option(help="directory for the sheet and result.json")] = Path("out/marker"),
    side_mm: Annotated[
        float | None, Option(help="side of one marker without border [default: 80, in arrays 60, less on small pages]")
    ] = None,
    border_mm: Annotated[float, Option(help="white border inside the crop marks")] = 5.0,
    gap_mm: Annotated[float | None, Option(help="between an array's markers; half a side if absent")] = None,
    pattern: Annotated[str, Option("--kind", help="of an array's markers: surf or sift")] = "surf",
    count: Annotated[int, Option(help="how many of each")] = 1,
    light: Annotated[bool, Option("--light", help="light centre instead of dark")] = False,
    limit: Annotated[str, Option(help="energy: the paper's grey marker; range: the binary one")] = "energy",
    format: Annotated[str, Option(help="pdf or svg (vector), png (pixels)")] = "pdf",
    dpi: Annotated[float, Option(help="dots per inch of a PNG")] = 1200.0,
    paper: Annotated[str, Option(help="a2 … a5, letter, legal, tabloid or WIDTHxHEIGHT in mm")] = "a4",
    landscape: Annotated[bool, Option("--landscape", help="turn the page")] = False,
    label: Annotated[str, Option(help="text for the small print")] = "",
    seed: UnusedSeed = 0,
    quiet: Annotated[bool, Option("--quiet", help="print nothing")] = False,
) -> None:
    """Write a print-ready sheet of markers.

    A board is a page of coded arrays, as many as it holds, for `peakmark calibrate`.
    """
    if limit not in ("energy", "range"):
        raise InputError(f"limit: expected energy or range, got {limit!r}")
    polarity: Polarity = "light" if light else "dark"
    paper_mm = paper_size(paper, landscape)
    if kind == "board":
        page, _ = board_page(paper_mm, side_mm, label)
        _write((page,), out, f"board-{page.markers[0].marker.side_mm:g}mm", format, dpi, BOARD_LAYOUT, quiet)
        return
    if side_mm is None:
        side_mm = ARRAY_SIDE_MM if kind.startswith("array") else SIDE_MM
        (tile, *_) = sheet_tiles(kind, side_mm, polarity, cast(Limit, limit), gap_mm, count, pattern)
        side_mm = min(side_mm, max(SMALLEST_SIDE_MM, floor(largest_side_mm(tile, paper_mm, border_mm))))
    tiles = sheet_tiles(kind, side_mm, polarity, cast(Limit, limit), gap_mm, count, pattern)
    laid_out = pages(tiles, paper_mm, border_mm, label)
    of = kind if pattern == "surf" else f"{kind}-{pattern}"
    name = f"{of if kind.startswith('array') else tiles[0].markers[0].marker.name}-{side_mm:g}mm"
    _write(laid_out, out, name, format, dpi, None, quiet)


def _write(
    laid_out: tuple[Page, ...], out: Path, name: str, format: str, dpi: float, layout: Layout | None, quiet: bool
) -> None:
    with result_folder(out) as folder:
        files = [path.name for path in write(laid_out, folder / name, format, dpi)]
        write_json(folder / "result.json", result(laid_out, files, layout))
    if not quiet:
        print("\n".join(str(out / file) for file in files))


def sheet_tiles(
    kind: str, side_mm: float, polarity: Polarity, limit: Limit, gap_mm: float | None, count: int, pattern: str = "surf"
) -> list[Tile]:
    """Return the tiles that the command's KIND names, each `count` times; `pattern` is of an array's markers.

    Raises
    ------
    InputError
        If the kind is unknown or `count` is not in 1…1000.
    """
    if not 1 <= count <= 1000:
        raise InputError(f"count: expected 1…1000, got {count}")
    if kind in ("surf", "sift"):
        return [marker_tile(Print(kind, side_mm, polarity, limit))] * count
    codes = {"array": range(8), **{f"array-{code}": range(code, code + 1) for code in range(8)}}
    if kind not in codes:
        raise InputError(f"kind: expected surf, sift, array or array-0 … array-7, got {kind!r}")
    if pattern not in ("surf", "sift"):
        raise InputError(f"--kind: expected surf or sift, got {pattern!r}")
    return [array_tile(code, side_mm, gap_mm, limit, pattern) for code in codes[kind] for _ in range(count)]


def result(laid_out: tuple[Page, ...], files: list[str], layout: Layout | None = None) -> dict[str, Any]:
    """Return what was printed where, as written to result.json; `layout` is that of a board's arrays."""
    return {
        "files": files,
        "page_mm": [laid_out[0].width_mm, laid_out[0].height_mm],
        "scale_bar_mm": laid_out[0].scale_bar_mm,
        "markers": [
            {"page": number, "center_mm": [printed.x_mm, printed.y_mm], **asdict(printed.marker)}
            for number, page in enumerate(laid_out, 1)
            for printed in page.markers
        ],
        **({} if layout is None else {"layout": asdict(layout)}),
    }
