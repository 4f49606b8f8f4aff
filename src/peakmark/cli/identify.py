"""`peakmark identify`: markers and arrays in images, folders, films, or a camera's images."""

from collections import Counter, deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, cast, get_args

import numpy as np
from peaksim.camera.camera import Camera
from rich.console import Console
from rich.table import Table
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, print_error, resumable
from peakmark.cli.identify_files import Identified, Sought, identify_images, key_of
from peakmark.cli.locating import Locator, StampedPose, are_in_order, check_ending, write_poses
from peakmark.cli.options import Quiet, UnusedSeed
from peakmark.cli.recording import recording_into
from peakmark.cli.sources import (
    FailedFile,
    SourceImage,
    expanded,
    image_count,
    read_camera,
    read_sources,
    with_failures,
)
from peakmark.cli.terminal import new_console, print_path, progress_bar
from peakmark.errors import InputError, check_choice, one_line
from peakmark.experiments.journal import Journal
from peakmark.experiments.option import check_range
from peakmark.found.rows import FoundRow
from peakmark.found.tables import write_rows, writer_of
from peakmark.identification.families import SOURCES
from peakmark.maps.files import load_map
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.parallel import thread_count
from peakmark.plain import from_plain, to_plain
from peakmark.recording.recorder import check_recording

_MOST_SHOWN = 40
"""Rows of the table on the terminal; the file has all."""


@examples(
    "peakmark identify photo.jpg --calibration cam.yaml --map sheet/result.json",
    "peakmark identify 'photos/*.jpg' film.mp4 --out out/found.csv --overlay out/drawn",
)
def identify(
    sources: Annotated[
        list[str] | None,
        Argument(
            metavar="SOURCE…", help="Images, folders, films, bags (MCAP, ROS), patterns; - for a list of them on stdin."
        ),
    ] = None,
    out: Annotated[
        Path | None, Option(help="File for all rows: FOUND.csv, .jsonl or .parquet. [default: the terminal alone]")
    ] = None,
    overlay: Annotated[
        Path | None, Option(help="Folder for a drawing of each image, and a film of those of each film.")
    ] = None,
    calibration: Annotated[
        str | None,
        Option(help="The camera: a file of OpenCV, ROS, Kalibr (FILE#cam0) or COLMAP. [default: a guess, said so]"),
    ] = None,
    map: Annotated[
        str | None, Option(help="Where markers are: a sheet's result.json, a scene, or a TOML file; tells poses.")
    ] = None,
    poses: Annotated[
        Path | None, Option(help="File for poses: .tum (and all else in a CSV file beside it), .csv or .jsonl.")
    ] = None,
    record: Annotated[
        Path | None, Option(help="Recording of all that: .mcap (Foxglove, ROS 2) or .rrd (Rerun).")
    ] = None,
    scale_bar_mm: Annotated[
        float | None, Option(help="What the sheet's scale bar measures, if the printer changed its size.")
    ] = None,
    scale_calibration: Annotated[
        bool, Option("--scale-calibration", help="The images are smaller or larger copies of the calibrated ones.")
    ] = False,
    polarity: Annotated[str, Option(help="dark, light or both.")] = "both",
    detector: Annotated[
        str, Option(help="Whose markers were printed: surf, sift, surf-disc, vlfeat; several as surf,sift.")
    ] = "surf",
    limit: Annotated[
        str | None, Option(help="energy, range (what `marker --limit range` prints) or both. [default: energy]")
    ] = None,
    camera: Annotated[int | None, Option(help="Take a camera's images instead of files, by its number.")] = None,
    frames: Annotated[int | None, Option(help="So many images of --camera. [default: until Ctrl-C]")] = None,
    raw_orientation: Annotated[
        bool, Option("--raw-orientation", help="Pixels as the sensor read them out, not rotated as viewers show them.")
    ] = False,
    workers: Annotated[
        int | None, Option(help="Images at a time, each on one thread. [default: the processors]")
    ] = None,
    seed: UnusedSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Find markers and arrays in images, folders, films, bags, or a camera's images.

    Prints what is in each image, and why an image has nothing; with --map also where the camera was. A file of rows has
    one row an array or marker: file, frame, kind, code, polarity, x, y, side_px, probability, sigma_px, four corners
    (px, pixel centres at integers) and pattern, such as surf-dark or sift-range-light. Files that cannot be read are
    named and left out; the exit status is then 1. An interrupted run with --out or --poses resumes.
    """
    console = new_console(quiet)
    sought = _sought(polarity, detector, limit)
    for path, check in ((out, writer_of), (poses, check_ending), (record, check_recording)):
        if path is not None:
            check(path)
    check_range("workers", workers, 1, 1024)
    named = _sources(sources, camera, frames)
    locator = _locator(calibration, map, scale_bar_mm, scale_calibration, poses)
    failures: list[FailedFile] = []

    def fail(one: FailedFile) -> None:
        failures.append(one)
        print_error(one.reason)

    read = None if locator is None or raw_orientation else locator.read
    is_upright = not raw_orientation and calibration is None
    unread: deque[FailedFile] = deque()
    images = read_sources(named, is_upright, unread.append, read) if camera is None else read_camera(camera, frames)
    settings = {"sources": named, **to_plain(sought), "raw_orientation": raw_orientation}
    settings |= {"calibration": calibration, "map": map, "scale_bar_mm": scale_bar_mm, "scaled": scale_calibration}
    target = out if out is not None else poses
    journal = None if target is None else _journal(target, settings, is_resumed=camera is None)
    total = None if camera is not None else image_count(named)
    summary = _Summary(console, len(named) == 1 and total is not None, locator)
    how = "the same command resumes" if journal is not None else "nothing was written; with --out it would resume"
    ended = resumable(how) if camera is None else suppress(KeyboardInterrupt)  # which is how a camera's run ends
    skip = None if len(named) == 1 and total is not None else fail
    with recording_into(record, locator) as add, ended, progress_bar(console, "identify", total) as bar:
        chosen = with_failures(images, unread)
        count = 1 if total == 1 or camera is not None else workers or thread_count()
        for each, identified in identify_images(chosen, sought, journal, overlay, locator, skip, count):
            summary.add(each, identified)
            add(each, identified)
            bar.advance()
    summary.print(len(failures))
    if journal is not None:
        _write(console, summary, journal, out, poses)
        _forget(journal)
    for written, what in ((overlay, "Drawings"), (record, "Recording")):
        if written is not None:
            print_path(console, written, what)
    if failures:
        raise Exit(1)


def _sought(polarity: str, detector: str, limit: str | None) -> Sought:
    check_choice(polarity, (*get_args(Polarity), "both"), "--polarity")
    detectors = tuple(name.strip() for name in detector.split(","))
    for name in detectors:
        check_choice(name, tuple(SOURCES), "--detector")
    if limit is not None:
        check_choice(limit, (*get_args(Limit), "both"), "--limit")
    if limit == "energy" and "surf-disc" in detectors:
        raise InputError("--limit: expected range or both with --detector surf-disc, got energy")
    return Sought(cast(Any, polarity), detectors, cast(Any, limit))


def _locator(
    calibration: str | None, map: str | None, scale_bar_mm: float | None, may_scale: bool, poses: Path | None
) -> Locator | None:
    """Return what poses are computed from; None where neither a calibration nor a map is given."""
    alone = {"--poses": poses, "--scale-bar-mm": scale_bar_mm} if map is None else {}
    alone |= {"--scale-calibration": may_scale or None} if calibration is None else {}
    for name, value in alone.items():
        if value is not None:
            needed = "--calibration" if name == "--scale-calibration" else "--map"
            raise InputError(f"{name}: expected together with {needed}")
    if calibration is None and map is None:
        return None
    return Locator(
        None if calibration is None else Camera.load(calibration),
        calibration or "",
        None if map is None else load_map(map, scale_bar_mm),
        may_scale,
    )


def _write(console: Console, summary: "_Summary", journal: Journal, out: Path | None, poses: Path | None) -> None:
    """Write the files from what the journal holds, one image after the other: memory does not grow with a film."""
    if out is not None:
        write_rows(out, (row for _, identified in summary.finished(journal) for row in identified.rows))
        print_path(console, out, "Rows")
    if poses is not None:
        is_timed = are_in_order([image.stamp for image in summary.done])
        stamped = (
            StampedPose(image.file, image.frame, image.stamp if is_timed else float(number), identified.pose)
            for number, (image, identified) in enumerate(summary.finished(journal))
            if identified.pose is not None
        )
        for path in write_poses(poses, stamped):
            print_path(console, path, "Poses")


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


def _journal(target: Path, settings: dict[str, Any], is_resumed: bool) -> Journal:
    """Open what an interrupted run left beside the file that it was to write."""
    return Journal.open(target.with_name(f"{target.name}.unfinished"), settings, is_resumed)


def _forget(journal: Journal) -> None:
    journal.remove()
    with suppress(OSError):
        journal.path.parent.rmdir()


@dataclass(frozen=True)
class _Done:
    """An image that is done."""

    key: str
    """Its name in the journal."""
    file: str
    frame: int | None
    """See `SourceImage`."""
    stamp: float
    """See `StampedPose`."""


@dataclass
class _Summary:
    """What the terminal shows, and which images are done."""

    console: Console
    is_alone: bool
    """Whether one image is all, so that its table is worth showing."""
    locator: Locator | None
    """What poses are computed from."""
    done: list[_Done] = field(default_factory=list)
    poses: int = 0
    markers: int = 0
    codes: Counter[int | None] = field(default_factory=Counter)
    empty: int = 0
    """Images without anything."""

    def add(self, each: SourceImage, identified: Identified) -> None:
        """Count an image, and print its line."""
        self._say_what_is_assumed(each)
        stamp = float(len(self.done)) if each.time_s is None else each.time_s
        self.done.append(_Done(key_of(each), each.file, each.frame, stamp))
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

    def finished(self, journal: Journal) -> Iterator[tuple[_Done, Identified]]:
        """Yield every image that is done with what the journal holds of it."""
        return ((image, from_plain(Identified, journal.records[image.key])) for image in self.done)

    def print(self, failed: int) -> None:
        """Print the line of all images."""
        if self.is_alone and not failed:
            return
        codes = {code: count for code, count in sorted(self.codes.items(), key=_by_code) if code is not None}
        arrays = f"{self.codes.total()} arrays" if self.codes else "no arrays"
        named = f" (codes {', '.join(f'{code} ×{count}' for code, count in codes.items())})" if codes else ""
        has_map = self.locator is not None and self.locator.marker_map is not None
        located = f", {self.poses} poses" if has_map else ""
        empty = f"; nothing in {self.empty}" if self.empty else ""
        left_out = f"; {failed} left out" if failed else ""
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
