"""`peakmark identify`: markers and arrays in images, folders, films, or a camera's images."""

from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Annotated, Any, cast, get_args

from peaksim.camera.camera import Camera
from rich.console import Console
from typer import Argument, Exit, Option

from peakmark.cli.command import examples, resumable
from peakmark.cli.identify_files import Sought, identify_images
from peakmark.cli.identify_summary import Summary
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
from peakmark.errors import InputError, check_choice
from peakmark.experiments.journal import Journal
from peakmark.experiments.option import check_range
from peakmark.found.tables import write_rows, writer_of
from peakmark.identification.families import SOURCES
from peakmark.maps.files import load_map
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.parallel import thread_count
from peakmark.plain import to_plain
from peakmark.recording.recorder import check_recording


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
    console, sought = new_console(quiet), _sought(polarity, detector, limit)
    for path, check in ((out, writer_of), (poses, check_ending), (record, check_recording)):
        if path is not None:
            check(path)
    check_range("workers", workers, 1, 1024)
    named = _sources(sources, camera, frames)
    locator = _locator(calibration, map, scale_bar_mm, scale_calibration, poses)
    images = _images(named, camera, frames, raw_orientation, locator)
    total = None if camera is not None else image_count(named)
    settings = {"sources": named, **to_plain(sought), "raw_orientation": raw_orientation}
    settings |= {"calibration": calibration, "map": map, "scale_bar_mm": scale_bar_mm, "scaled": scale_calibration}
    target = out if out is not None else poses
    journal = None if target is None else _journal(target, settings, is_resumed=camera is None)
    summary = Summary(console, len(named) == 1 and total is not None, locator)
    skip = None if summary.is_alone else summary.fail
    count = 1 if total == 1 or camera is not None else workers or thread_count()
    bar_of = progress_bar(console, "identify", total)
    with recording_into(record, locator) as add, _ending(camera, journal), bar_of as bar:
        for each, identified in identify_images(images, sought, journal, overlay, locator, skip, count):
            summary.add(each, identified)
            add(each, identified)
            bar.advance()
    summary.print()
    if journal is not None:
        _write(console, summary, journal, out, poses)
        _forget(journal)
    for written, what in ((overlay, "Drawings"), (record, "Recording")):
        if written is not None:
            print_path(console, written, what)
    if summary.failed:
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


def _images(
    named: list[str], camera: int | None, frames: int | None, is_raw: bool, locator: Locator | None
) -> Iterator[SourceImage | FailedFile]:
    """Return the images of sources or of a camera, and in their turn what cannot be read."""
    is_upright = not is_raw and (locator is None or locator.calibration is None)
    read = None if locator is None or is_raw else locator.read
    unread: deque[FailedFile] = deque()
    images = read_sources(named, is_upright, unread.append, read) if camera is None else read_camera(camera, frames)
    return with_failures(images, unread)


def _ending(camera: int | None, journal: Journal | None) -> AbstractContextManager[None]:
    """Return what Ctrl-C does: it ends a camera's run, and interrupts others."""
    if camera is not None:
        return suppress(KeyboardInterrupt)
    return resumable(
        "the same command resumes" if journal is not None else "nothing was written; with --out it would resume"
    )


def _write(console: Console, summary: Summary, journal: Journal, out: Path | None, poses: Path | None) -> None:
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
