"""What `peakmark identify` prints of its images, and which of them are done."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from rich.console import Console
from rich.table import Table

from peakmark.cli.command import print_error
from peakmark.cli.identify_files import Identified, key_of
from peakmark.cli.locating import Locator
from peakmark.cli.sources import FailedFile, SourceImage
from peakmark.errors import one_line
from peakmark.experiments.journal import Journal
from peakmark.found.rows import FoundRow
from peakmark.plain import from_plain

_MOST_SHOWN = 40
"""Rows of the table on the terminal; the file has all."""


@dataclass(frozen=True)
class Done:
    """An image that is done."""

    key: str
    """Its name in the journal."""
    file: str
    frame: int | None
    """See `SourceImage`."""
    stamp: float
    """See `StampedPose`."""


@dataclass
class Summary:
    """What the terminal shows, and which images are done."""

    console: Console
    is_alone: bool
    """Whether one image is all, so that its table is worth showing."""
    locator: Locator | None
    """What poses are computed from."""
    done: list[Done] = field(default_factory=list)
    poses: int = 0
    markers: int = 0
    codes: Counter[int | None] = field(default_factory=Counter)
    empty: int = 0
    """Images without anything."""
    failed: int = 0
    """Images that were left out."""

    def add(self, each: SourceImage, identified: Identified) -> None:
        """Count an image, and print its line."""
        self._say_what_is_assumed(each)
        stamp = float(len(self.done)) if each.time_s is None else each.time_s
        self.done.append(Done(key_of(each), each.file, each.frame, stamp))
        self.poses += identified.pose is not None
        self.markers += identified.markers
        self.codes.update(identified.codes)
        self.empty += not identified.rows
        if each.frame is None:
            self._print(f"{one_line(each.file)}: {_words(identified)}")
            for line in _pose_words(identified, self.locator is not None and self.locator.calibration is None):
                self._print(f"  {line}")
        if self.is_alone and identified.rows:
            self.console.print(_table(identified.rows))

    def fail(self, one: FailedFile) -> None:
        """Count an image that is left out, and print why."""
        self.failed += 1
        print_error(one.reason)

    def finished(self, journal: Journal) -> Iterator[tuple[Done, Identified]]:
        """Yield every image that is done with what the journal holds of it."""
        return ((image, from_plain(Identified, journal.records[image.key])) for image in self.done)

    def print(self) -> None:
        """Print the line of all images."""
        if self.is_alone and not self.failed:
            return
        codes = {code: count for code, count in sorted(self.codes.items(), key=_by_code) if code is not None}
        arrays = f"{self.codes.total()} arrays" if self.codes else "no arrays"
        named = f" (codes {', '.join(f'{code} ×{count}' for code, count in codes.items())})" if codes else ""
        has_map = self.locator is not None and self.locator.marker_map is not None
        located = f", {self.poses} poses" if has_map else ""
        empty = f"; nothing in {self.empty}" if self.empty else ""
        left_out = f"; {self.failed} left out" if self.failed else ""
        self._print(f"{len(self.done)} images: {self.markers} markers, {arrays}{named}{located}{empty}{left_out}")

    def _say_what_is_assumed(self, each: SourceImage) -> None:
        if not self.done and self.locator is not None and (note := self.locator.assumption(each)):
            self._print(f"note: {note}")

    def _print(self, line: str) -> None:
        self.console.print(line, soft_wrap=True, highlight=False)


def _pose_words(identified: Identified, is_guessed: bool) -> list[str]:
    """Return where the camera was, in lines; none where nobody asked. σ does not hold what a guessed camera is off."""
    pose = identified.pose
    if pose is None:
        return [f"no pose: {identified.pose_reason}"] if identified.pose_reason else []
    x, y, z = pose.world_from_camera[:3, 3]
    sigma_mm = 1000 * float(np.linalg.norm(pose.position_sigma_m))
    on_page = "" if pose.page is None else f" over page {pose.page}"
    condition = " for that focal length" if is_guessed else ""
    line = (
        f"camera at ({x:.4f}, {y:.4f}, {z:.4f}) m{on_page}, ±{sigma_mm:.2g} mm, ±{pose.rotation_sigma_deg:.2g}°"
        f"{condition}; {pose.markers} markers fit to {pose.rms_px:.2f} px"
    )
    if pose.is_certain or pose.other is None:
        return [line]
    x, y, z = pose.other[:3, 3]
    return [line, f"or at ({x:.4f}, {y:.4f}, {z:.4f}) m, which explains the image nearly as well"]


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
