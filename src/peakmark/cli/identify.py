"""`peakmark identify`: markers and arrays in images, folders, films, or a camera's images."""

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, cast, get_args

from rich.console import Console
from rich.table import Table
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, print_error, resumable
from peakmark.cli.identify_files import Identified, Sought, identify_images
from peakmark.cli.options import Quiet, UnusedSeed
from peakmark.cli.sources import FailedFile, SourceImage, expanded, is_film, read_camera, read_sources
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.errors import InputError, check_choice, one_line
from peakmark.experiments.journal import Journal
from peakmark.found.rows import FoundRow
from peakmark.found.tables import write_rows, writer_of
from peakmark.markers.patterns import Polarity

_MOST_SHOWN = 40
"""Rows of the table on the terminal; the file has all."""


@examples(
    "peakmark identify photo.jpg --overlay out/drawn",
    "peakmark identify 'photos/*.jpg' film.mp4 --out out/found.csv --overlay out/drawn",
)
def identify(
    sources: Annotated[
        list[str] | None,
        Argument(metavar="SOURCE…", help="Images, folders of images, films, patterns; - for a list of them on stdin."),
    ] = None,
    out: Annotated[
        Path | None, Option(help="File for all rows: FOUND.csv, .jsonl or .parquet. [default: the terminal alone]")
    ] = None,
    overlay: Annotated[
        Path | None, Option(help="Folder for a drawing of each image, and a film of those of each film.")
    ] = None,
    polarity: Annotated[str, Option(help="dark, light or both.")] = "both",
    camera: Annotated[int | None, Option(help="Take a camera's images instead of files, by its number.")] = None,
    frames: Annotated[int | None, Option(help="So many images of --camera. [default: until Ctrl-C]")] = None,
    raw_orientation: Annotated[
        bool, Option("--raw-orientation", help="Pixels as the sensor read them out, not rotated as viewers show them.")
    ] = False,
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Find markers and arrays in images, folders, films, or a camera's images.

    Prints what is in each image, and why an image has nothing. A file of rows has one row an array or marker: file,
    frame, kind, code, polarity, x, y, side_px, probability, sigma_px and four corners (px, pixel centres at integers).
    Files that cannot be read are named and left out; the exit status is then 1. An interrupted run with --out resumes.
    """
    console = new_console(quiet)
    check_choice(polarity, (*get_args(Polarity), "both"), "--polarity")
    if out is not None:
        writer_of(out)
    named = _sources(sources, camera, frames)
    failures: list[FailedFile] = []

    def fail(one: FailedFile) -> None:
        failures.append(one)
        print_error(one.reason)

    images = read_sources(named, not raw_orientation, fail) if camera is None else read_camera(camera, frames)
    journal = None if out is None or camera is not None else _journal(out, named, polarity, raw_orientation)
    total = None if camera is not None or any(Path(one).is_dir() or is_film(Path(one)) for one in named) else len(named)
    summary = _Summary(console, is_alone=len(named) == 1 and total is not None)
    how = "the same command resumes" if journal is not None else "nothing was written; with --out it would resume"
    ended = resumable(how) if camera is None else suppress(KeyboardInterrupt)  # which is how a camera's run ends
    with ended, progress_bar(console, "identify", total) as bar:
        for each, identified in identify_images(images, cast(Sought, polarity), journal, overlay):
            summary.add(each, identified, keep_rows=out is not None)
            bar.advance()
    summary.print(len(failures))
    if out is not None:
        write_rows(out, summary.rows)
        print_path(console, out, "Rows")
    if journal is not None:
        _forget(journal)
    if overlay is not None:
        print_path(console, overlay, "Drawings")
    if failures:
        raise Exit(1)


def _sources(sources: list[str] | None, camera: int | None, frames: int | None) -> list[str]:
    if camera is None and frames is not None:
        raise InputError(f"--frames {frames}: expected together with --camera")
    if camera is None:
        return expanded(sources or [])
    if sources:
        raise InputError(f"--camera {camera}: expected a camera or SOURCE, got both")
    if not 0 <= camera < 1000 or (frames is not None and frames < 1):
        raise InputError(f"expected --camera 0 or more and --frames 1 or more, got {camera} and {frames}")
    return []


def _journal(out: Path, sources: list[str], polarity: str, raw_orientation: bool) -> Journal:
    """Open what an interrupted run left beside `out`."""
    settings = {"sources": sources, "polarity": polarity, "raw_orientation": raw_orientation}
    return Journal.open(out.with_name(f"{out.name}.unfinished"), settings)


def _forget(journal: Journal) -> None:
    journal.remove()
    with suppress(OSError):
        journal.path.parent.rmdir()


@dataclass
class _Summary:
    """What the terminal shows, and the rows for the file."""

    console: Console
    is_alone: bool
    """Whether one image is all, so that its table is worth showing."""
    rows: list[FoundRow] = field(default_factory=list)
    images: int = 0
    markers: int = 0
    codes: Counter[int | None] = field(default_factory=Counter)
    empty: int = 0
    """Images without anything."""

    def add(self, each: SourceImage, identified: Identified, keep_rows: bool) -> None:
        """Count an image, and print its line."""
        self.images += 1
        self.markers += identified.markers
        self.codes.update(identified.codes)
        self.empty += not identified.rows
        if keep_rows:
            self.rows += identified.rows
        if each.frame is None:
            self.console.print(f"{one_line(each.file)}: {_words(identified)}", soft_wrap=True, highlight=False)
        if self.is_alone and identified.rows:
            self.console.print(_table(identified.rows))

    def print(self, failed: int) -> None:
        """Print the line of all images."""
        if self.is_alone and not failed:
            return
        arrays = f"{self.codes.total()} arrays" if self.codes else "no arrays"
        named = ", ".join(
            f"{code} ×{count}" for code, count in sorted(self.codes.items(), key=_by_code) if code is not None
        )
        empty = f"; nothing in {self.empty}" if self.empty else ""
        left_out = f"; {failed} left out" if failed else ""
        of = f"{self.images} images: {self.markers} markers, {arrays}" + (f" (codes {named})" if named else "")
        self.console.print(of + empty + left_out, soft_wrap=True, highlight=False)


def _by_code(item: tuple[int | None, int]) -> int:
    return -1 if item[0] is None else item[0]


def _words(identified: Identified) -> str:
    """Return what an image holds, in words."""
    if not identified.rows:
        return f"nothing found: {identified.reason}"
    codes = [str(code) for code in identified.codes if code is not None]
    unsure = len(identified.codes) - len(codes)
    parts = [f"{identified.markers} markers"]
    parts += [f"arrays {', '.join(codes)}"] if codes else []
    parts += [f"{unsure} arrays unsure"] if unsure else []
    return "; ".join(parts)


def _table(rows: tuple[FoundRow, ...]) -> Table:
    """Return the rows of one image as the terminal shows them."""
    left_out = len(rows) - _MOST_SHOWN
    table = Table(caption=f"and {left_out} more; --out FOUND.csv has all" if left_out > 0 else None)
    for head in ("kind", "code", "polarity", "x", "y", "side px", "probability", "±px"):
        table.add_column(head, justify="left" if head in ("kind", "polarity") else "right")
    for row in rows[:_MOST_SHOWN]:
        code = f"{row.code}" if row.code is not None else (f"? {row.doubt}" if row.doubt else "")
        likely = "" if row.probability is None else f"{row.probability:.3f}"
        sigma = "" if row.sigma_px is None else f"{row.sigma_px:.3f}"
        place = (f"{row.x:.2f}", f"{row.y:.2f}", f"{row.side_px:.1f}")
        table.add_row(row.kind, code, row.polarity or "", *place, likely, sigma)
    return table
