"""Detection on files: pictures, folders and films in; key points, overlays and a summary out."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.image_file import MAX_PIXELS, read_image
from PIL import Image

from peakmark.detectors.registry import find_detector, settings_of
from peakmark.errors import ImageError, InputError
from peakmark.keypoints.keypoints import Keypoints
from peakmark.report.keypoints_overlay import draw_keypoints

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".webp")
"""Name endings that count as pictures in a folder."""
FILMS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg")
"""Name endings that count as films."""
FORMATS = (".npz", ".csv", ".json")
"""Name endings of key point files."""


@dataclass(frozen=True)
class Found:
    """What was found in one picture, for the summary."""

    name: str
    """The picture's file name without its ending; of films with the frame's number behind."""
    width: int
    """px."""
    height: int
    """px."""
    keypoints: int
    """How many."""
    file: str
    """Where they were written."""


def detect_files(
    source: Path,
    out: Path,
    detector: str = "surf",
    parameters: dict[str, Any] | None = None,
    overlay: bool = False,
    ending: str = ".npz",
    on_found: Callable[[Found], None] = lambda found: None,
) -> list[Found]:
    """Detect key points in a picture, each picture of a folder, or each frame of a film.

    Parameters
    ----------
    source : a picture, a folder (its pictures, by name; no subfolders) or a film.
    out : a file name ending in .npz, .csv or .json if `source` is a picture; otherwise a folder, made if missing,
        which gets NAME.npz for each picture and result.json.
    detector, parameters : see `peakmark.detectors`.
    overlay : also draw the key points, into NAME.overlay.png beside them.
    ending : of the files in a folder: .npz, .csv or .json.
    on_found : called after each picture.

    Returns
    -------
    One record a picture, in order.

    Raises
    ------
    InputError
        If the source is missing, unreadable, no picture, or too large; or a parameter is not the detector's.
    """
    settings = {"detector": detector, **_as_json(settings_of(detector, parameters or {}))}
    detect = find_detector(detector)
    single = out.suffix in FORMATS
    if single and (source.is_dir() or source.suffix.lower() in FILMS):
        raise InputError(f"{out}: expected a folder, as {source} holds many pictures")
    if ending not in FORMATS:
        raise InputError(f"format: expected one of {', '.join(FORMATS)}, got {ending!r}")
    (out.parent if single else out).mkdir(parents=True, exist_ok=True)
    records = []
    for name, image in read_pictures(source):
        target = out if single else out / f"{name}{ending}"
        keypoints = detect(image, **(parameters or {}))
        keypoints.save(target, settings)
        if overlay:
            _save_overlay(image, keypoints, target.with_suffix(".overlay.png"))
        records.append(Found(name, image.shape[1], image.shape[0], len(keypoints), str(target)))
        on_found(records[-1])
    if not single:
        result = {"settings": settings, "pictures": [asdict(record) for record in records]}
        (out / "result.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    return records


def read_pictures(source: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and pixels of a picture, of each picture of a folder, or of each frame of a film.

    Raises
    ------
    InputError
        If there is nothing to read, a picture is damaged, or two pictures of a folder share a name.
    """
    if source.is_dir():
        paths = sorted(path for path in source.iterdir() if path.suffix.lower() in PICTURES)
        names = [path.stem for path in paths]
        twice = sorted({name for name in names if names.count(name) > 1})
        if not paths or twice:
            got = f"two called {twice[0]}" if twice else "none"
            raise InputError(f"{source}: expected a folder of pictures with different names, got {got}")
        yield from ((path.stem, read_image(path)) for path in paths)
    elif source.suffix.lower() in FILMS:
        yield from ((f"{source.stem}_{index:06d}", frame) for index, frame in enumerate(read_film(source)))
    else:
        yield source.stem, read_image(source)


def read_film(path: Path) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames of a film's first video stream as (H, W, 3) RGB.

    Raises
    ------
    ImageError
        If the file is missing, no film, damaged, has no frame, or its frames exceed `MAX_PIXELS`.
    """
    import av

    count = 0
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise ImageError(f"{path}: expected a film, found no video stream")
            for frame in container.decode(container.streams.video[0]):
                if frame.width * frame.height > MAX_PIXELS:
                    raise ImageError(f"{path}: expected at most {MAX_PIXELS} pixels, got {frame.width}×{frame.height}")
                count += 1
                yield frame.to_ndarray(format="rgb24")
    except (OSError, ValueError, av.error.FFmpegError) as error:
        if isinstance(error, ImageError):
            raise
        raise ImageError(f"{path}: expected a film: {getattr(error, 'strerror', None) or error}") from error
    if not count:
        raise ImageError(f"{path}: expected a film, found no frame")


def _save_overlay(image: NDArray[Any], keypoints: Keypoints, path: Path) -> None:

    Image.fromarray(draw_keypoints(image, keypoints)).save(path)


def _as_json(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return parameters for the record: arrays (masks) by their shape."""
    return {
        name: f"array {value.shape}" if isinstance(value, np.ndarray) else value for name, value in parameters.items()
    }
