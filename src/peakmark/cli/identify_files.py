"""Markers and arrays of images one after the other: rows, the reason where there are none, drawings, and resuming."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from peaksim.whole_file import whole_file
from PIL import Image

from peakmark.cli.film_file import frames_per_second
from peakmark.cli.locating import Locator, PoseRecord, record_of
from peakmark.cli.sources import FailedFile, OnFailure, SourceImage
from peakmark.errors import ImageError, InputError
from peakmark.experiments.journal import Journal
from peakmark.found.absence import why_nothing
from peakmark.found.found import find
from peakmark.found.rows import FoundRow, undistorted
from peakmark.maps.locate import location_or_reason
from peakmark.markers.array_code import THREE_BIT
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.parallel import map_ahead
from peakmark.plain import from_plain, to_plain
from peakmark.recording.bag import split_topic
from peakmark.report.film import film
from peakmark.report.overlay import draw_found

OVERLAY, FILM = ".overlay.jpg", ".overlay.mp4"
"""Name endings of drawings, see `sources.OVERLAYS`, and of films of them."""

_FILM_WIDTH_PX, _JPEG_QUALITY = 1280, 90


@dataclass(frozen=True)
class Sought:
    """For which markers to look, see `peakmark.identify`."""

    polarity: Polarity | Literal["both"]
    detectors: tuple[str, ...] = ("surf",)
    limit: Limit | Literal["both"] | None = None

    def why_nothing(self, image: NDArray[Any]) -> str:
        """Return why none were found."""
        return why_nothing(image, self.detectors, self.limit)


@dataclass(frozen=True)
class Identified:
    """What was found in one image."""

    rows: tuple[FoundRow, ...]
    """Arrays first, then markers."""
    reason: str
    """Why there are none, in an image of its own; otherwise empty."""
    pose: PoseRecord | None = None
    """Where the camera was, if that was asked for and can be told."""
    pose_reason: str = ""
    """Why it cannot."""

    @property
    def markers(self) -> int:
        """Number of markers."""
        return sum(row.kind == "marker" for row in self.rows)

    @property
    def codes(self) -> tuple[int | None, ...]:
        """Of the arrays; None where one is unsure."""
        return tuple(row.code for row in self.rows if row.kind == "array")


def identify_images(
    images: Iterable[SourceImage | FailedFile],
    sought: Sought,
    journal: Journal | None = None,
    overlays: Path | None = None,
    locator: Locator | None = None,
    on_failure: OnFailure | None = None,
    workers: int = 1,
) -> Iterator[tuple[SourceImage, Identified]]:
    """Yield each image with what was found in it; what the journal has is not done again.

    `overlays` is a folder that gets a drawing of each image, and a film of the drawings of each film. With a `locator`
    positions are undistorted, too, and the camera's pose is told. Images of another size than the calibration's, and
    what could not be read, go to `on_failure` where it is given. Several `workers` are threads that work on images side
    by side; what comes, and in which order, does not depend on them.

    Raises
    ------
    InputError
        If the polarity, a detector or the limit is unknown, or a drawing cannot be written.
    """
    work = partial(_outcome, sought=sought, locator=locator, journal=journal)
    with Drawings.into(overlays) as drawings:
        for each, outcome in map_ahead(work, images, workers):
            if isinstance(each, FailedFile) or isinstance(outcome, ImageError):
                _fail(each, outcome, on_failure)
                continue
            assert outcome is not None
            if journal is not None and key_of(each) not in journal.records:
                journal.add(key_of(each), to_plain(outcome))
            drawings.add(each, outcome.rows)
            yield each, outcome


def _outcome(
    each: SourceImage | FailedFile, sought: Sought, locator: Locator | None, journal: Journal | None
) -> Identified | ImageError | None:
    """Return what is in an image, from the journal if that has it, or why it cannot be told; None of what is none."""
    if isinstance(each, FailedFile):
        return None
    key = key_of(each)
    if journal is not None and key in journal.records:
        return from_plain(Identified, journal.records[key])
    try:
        return _identified(each, sought, locator)
    except ImageError as error:
        return error


def _fail(each: SourceImage | FailedFile, outcome: object, on_failure: OnFailure | None) -> None:
    reason = each.reason if isinstance(each, FailedFile) else str(outcome)
    if on_failure is None:
        raise outcome if isinstance(outcome, ImageError) else ImageError(reason)
    on_failure(FailedFile(each.name, reason))


def _identified(each: SourceImage, sought: Sought, locator: Locator | None) -> Identified:
    camera = None if locator is None else locator.camera_of(each)
    marker_map = None if locator is None else locator.marker_map
    calibrated = None if locator is None or locator.calibration is None else camera
    layout = THREE_BIT if marker_map is None else marker_map.layout
    focal_px = None if calibrated is None else calibrated.focal_px
    found = find(each.image, sought.polarity, layout, sought.detectors, sought.limit, focal_px)
    rows = found.rows(each.file, each.frame)
    reason = "" if rows or each.frame is not None else sought.why_nothing(each.image)
    if calibrated is not None:
        rows = tuple(undistorted(row, calibrated) for row in rows)
    if camera is None or marker_map is None:
        return Identified(rows, reason)
    where = location_or_reason(found, camera, marker_map)
    if isinstance(where, str):
        return Identified(rows, reason, pose_reason=where)
    return Identified(rows, reason, record_of(where))


def key_of(each: SourceImage) -> str:
    """Return the name of an image in the journal; a file that has changed since has another one."""
    path, _ = split_topic(each.file)
    changed = path.stat().st_mtime_ns if path.exists() else 0
    return f"{each.file!r} {each.frame} {changed}"


@dataclass
class Drawings:
    """Drawings on their way into a folder; no two of them get one name."""

    folder: Path | None
    """None draws nothing."""
    stack: ExitStack = field(default_factory=ExitStack)
    """Closes the film that is being written."""
    film_of: str = ""
    """The file that it shows."""
    append: Callable[[NDArray[np.uint8]], None] | None = None
    """Adds a frame to it."""
    names: set[str] = field(default_factory=set)
    """Taken names."""

    @classmethod
    def into(cls, folder: Path | None) -> "Drawings":
        """Begin; the folder is made if missing, and one that cannot be is an `InputError`."""
        try:
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"--overlay {folder}: expected a folder: {error.strerror or error}") from error
        return cls(folder)

    def __enter__(self) -> "Drawings":
        return self

    def __exit__(self, *error: Any) -> None:
        if self.film_of and not Path(self.film_of).exists():  # a camera's film ends whenever it is stopped
            error = (None, None, None)
        self.stack.__exit__(*error)

    def add(self, each: SourceImage, rows: tuple[FoundRow, ...]) -> None:
        """Write the drawing of an image, or add it to the film that it is a frame of."""
        if self.folder is None:
            return
        canvas = draw_found(each.image, rows)
        try:
            if each.frame is None:
                with whole_file(self._free(each.name, OVERLAY)) as path:
                    Image.fromarray(canvas).save(path, quality=_JPEG_QUALITY, format="JPEG")
                return
            if self.film_of != each.file or self.append is None:
                self.stack.close()
                name = each.name.rpartition("_")[0]
                path = self.stack.enter_context(whole_file(self._free(name, FILM)))
                width = min(_FILM_WIDTH_PX, canvas.shape[1])
                self.append = self.stack.enter_context(film(path, frames_per_second(Path(each.file)), width))
                self.film_of = each.file
            self.append(canvas)
        except OSError as error:
            raise InputError(f"--overlay {self.folder}: cannot be written: {error.strerror or error}") from error

    def _free(self, name: str, ending: str) -> Path:
        assert self.folder is not None
        numbered = (name if n == 1 else f"{name}-{n}" for n in range(1, len(self.names) + 2))
        chosen = next(one for one in numbered if one + ending not in self.names)
        self.names.add(chosen + ending)
        return self.folder / (chosen + ending)
