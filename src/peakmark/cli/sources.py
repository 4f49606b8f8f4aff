"""What commands read: images, folders of them, films, bags, cameras; bad files are named and left out."""

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from glob import glob, has_magic
from itertools import count
from pathlib import Path
from time import monotonic
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import read_image

from peakmark.cli import film_file
from peakmark.errors import ImageError, InputError
from peakmark.recording.bag import is_bag, read_bag, split_topic

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".webp")
"""Name endings that count as images in a folder."""
OVERLAYS = {".overlay.png": (".npz", ".csv", ".json"), ".overlay.jpg": IMAGES}
"""Name endings of drawings, which are not read as images beside a file of the same name and one of those endings."""

STDIN = "-"
"""The source that stands for a list of sources on standard input, one a line."""


@dataclass(frozen=True)
class SourceImage:
    """One image to work on."""

    name: str
    """The file's name without its ending; for a frame of a film or camera followed by its number."""
    file: str
    """The file as it was named; "camera 0" for a camera."""
    frame: int | None
    """Number from 0 in a film or of a camera; None in an image."""
    time_s: float | None
    """Of a frame, from the film's or camera's start; None in an image."""
    image: NDArray[Any]
    """(H, W) grey or (H, W, 3) RGB."""


@dataclass(frozen=True)
class FailedFile:
    """An image that was left out, or a film that ended early."""

    name: str
    """The file's name, or that of the image as in `SourceImage`."""
    reason: str
    """One line."""


OnFailure = Callable[[FailedFile], None]
ReadImage = Callable[[Path], NDArray[Any]]


def is_film(source: Path) -> bool:
    """Return whether a file's name ends as films' do."""
    return source.suffix.lower() in film_file.ENDINGS


def image_count(sources: Sequence[str]) -> int | None:
    """Return how many images sources are; None where a folder, film or bag does not tell beforehand."""
    is_known = not any(Path(one).is_dir() or is_film(Path(one)) or is_bag(one) for one in sources)
    return len(sources) if is_known else None


def read_images(
    source: Path, is_upright: bool = True, on_failure: OnFailure | None = None, read: ReadImage | None = None
) -> Iterator[SourceImage]:
    """Yield an image, each image of a folder, or each frame of a film or bag (BAG#TOPIC where it has several cameras).

    Images of a folder that cannot be read, and the early end of a film, go to `on_failure` where it is given. `read`
    reads an image instead of `read_image`.

    Raises
    ------
    InputError
        If there is nothing to read, two images of a folder share a name, or an image is damaged.
    """
    read = read or (lambda path: read_image(path, is_upright=is_upright))
    if is_bag(str(source)):
        yield from _read_frames(source, split_topic(str(source))[0].stem, read_bag(str(source)), on_failure)
    elif source.is_dir():
        for path in images_in(source):
            try:
                if not path.is_file():
                    raise ImageError(f"{path}: expected a file")
                image = read(path)
            except ImageError as error:
                if on_failure is None:
                    raise
                on_failure(FailedFile(path.name, str(error)))
                continue
            yield SourceImage(path.stem, str(path), None, None, image)
    elif is_film(source):
        yield from _read_frames(source, source.stem, film_file.read_timed_film(source, is_upright), on_failure)
    else:
        yield SourceImage(source.stem, str(source), None, None, read(source))


def _read_frames(
    source: Path, name: str, frames: Iterator[tuple[float, NDArray[Any]]], on_failure: OnFailure | None
) -> Iterator[SourceImage]:
    index = -1
    try:
        for index, (time_s, frame) in enumerate(frames):
            yield SourceImage(f"{name}_{index:06d}", str(source), index, time_s, frame)
    except ImageError as error:
        if on_failure is None or index < 0:
            raise
        on_failure(FailedFile(source.name, str(error)))


def read_sources(
    sources: Sequence[str], is_upright: bool, on_failure: OnFailure, read: ReadImage | None = None
) -> Iterator[SourceImage]:
    """Yield the images of several sources: as `read_images`, and those that match a pattern such as "in/*.jpg".

    Whatever cannot be read goes to `on_failure`; a source that is the only one raises instead.

    Raises
    ------
    InputError
        If there is one source alone, and it cannot be read.
    """
    for source in sources:
        try:
            yield from read_images(Path(source), is_upright, on_failure, read)
        except InputError as error:
            if len(sources) == 1:
                raise
            on_failure(FailedFile(Path(source).name, str(error)))


def with_failures(images: Iterable[SourceImage], failed: deque[FailedFile]) -> Iterator[SourceImage | FailedFile]:
    """Yield images, and in their turn what reading them puts into `failed`, which is emptied."""

    def taken() -> Iterator[FailedFile]:
        while failed:
            yield failed.popleft()

    for each in images:
        yield from taken()
        yield each
    yield from taken()


def expanded(sources: Sequence[str]) -> list[str]:
    """Return sources with patterns replaced by the files that match, and "-" by the lines of standard input.

    Raises
    ------
    InputError
        If a pattern matches nothing, standard input names nothing, or there is no source at all.
    """
    found: list[str] = []
    for source in sources:
        if source == STDIN:
            found += [line for line in sys.stdin.read().splitlines() if line.strip()]
        elif has_magic(source) and not Path(source).exists():
            matching = sorted(glob(source, recursive=True))
            if not matching:
                raise InputError(f"{source}: expected a pattern that files match, got none")
            found += matching
        else:
            found.append(source)
    if not found:
        raise InputError("SOURCE: expected images, folders or films, got none")
    return found


def images_in(folder: Path) -> list[Path]:
    """Return a folder's images by name, without the drawings that an earlier run left in it.

    Raises
    ------
    InputError
        If the folder cannot be read, holds no image, or two that differ in their endings alone.
    """
    try:
        there = {path.name: path for path in folder.iterdir()}
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror or error}") from error
    drawn = {
        name
        for name in there
        for drawing, beside in OVERLAYS.items()
        if name.endswith(drawing) and any(f"{name.removesuffix(drawing)}{ending}" in there for ending in beside)
    }
    paths = [there[name] for name in sorted(there) if there[name].suffix.lower() in IMAGES and name not in drawn]
    names = [path.stem for path in paths]
    twice = sorted({name for name in names if names.count(name) > 1})
    if not paths or twice:
        got = f"two called {twice[0]}" if twice else "none"
        raise InputError(f"{folder}: expected a folder of images with different names, got {got}")
    return paths


def read_camera(number: int, frames: int | None = None) -> Iterator[SourceImage]:
    """Yield the images of a camera of this machine as they come, so many of them or without end.

    Raises
    ------
    InputError
        If there is no such camera, or it stops.
    """
    opened = cv2.VideoCapture(number) if Path(f"/dev/video{number}").exists() else cv2.VideoCapture()
    try:
        if not opened.isOpened():
            there = ", ".join(path.name.removeprefix("video") for path in sorted(Path("/dev").glob("video*")))
            got = f"this machine has {there}" if there else "this machine has none"
            raise InputError(f"--camera {number}: expected a camera that can be opened; {got}")
        started_s = monotonic()
        for index in count() if frames is None else range(frames):
            is_read, bgr = opened.read()
            if not is_read:
                raise InputError(f"--camera {number}: expected an image, got none after {index} frames")
            rgb = np.ascontiguousarray(bgr[:, :, ::-1])
            yield SourceImage(f"camera{number}_{index:06d}", f"camera {number}", index, monotonic() - started_s, rgb)
    finally:
        opened.release()
