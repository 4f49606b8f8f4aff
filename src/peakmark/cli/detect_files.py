"""Detection on files: images, folders and films in; key points, overlays and a summary out."""

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
from peakmark.report.overlay import draw_keypoints
from peakmark.report.results import write_json

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".webp")
"""Name endings that count as images in a folder."""
FILMS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg")
"""Name endings that count as films."""
FORMATS = (".npz", ".csv", ".json")
"""Name endings of key point files."""


@dataclass(frozen=True)
class DetectedFile:
    """What was found in one image, for the summary."""

    name: str
    """The image's file name without its ending; for a frame of a film followed by its number."""
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
    on_image: Callable[[DetectedFile], None] = lambda one: None,
) -> list[DetectedFile]:
    """Detect key points in an image, each image of a folder, or each frame of a film.

    Parameters
    ----------
    source : an image, a folder (its images, by name; no subfolders) or a film.
    out : a file name ending in .npz, .csv or .json if `source` is an image; otherwise a folder, made if missing,
        which gets NAME.npz for each image and result.json.
    detector, parameters : see `peakmark.detectors`.
    overlay : also draw the key points, into NAME.overlay.png beside them.
    ending : of the files in a folder: .npz, .csv or .json.
    on_image : called after each image.

    Returns
    -------
    One record an image, in order.

    Raises
    ------
    InputError
        If the source is missing, unreadable, no image, or too large; or a parameter is not the detector's.
    """
    settings = {"detector": detector, **_as_json(settings_of(detector, parameters or {}))}
    detect = find_detector(detector)
    single = out.suffix in FORMATS
    if single and (source.is_dir() or source.suffix.lower() in FILMS):
        raise InputError(f"{out}: expected a folder, as {source} holds many images")
    if ending not in FORMATS:
        raise InputError(f"format: expected one of {', '.join(FORMATS)}, got {ending!r}")
    (out.parent if single else out).mkdir(parents=True, exist_ok=True)
    records = []
    for name, image in read_images(source):
        target = out if single else out / f"{name}{ending}"
        keypoints = detect(image, **(parameters or {}))
        keypoints.save(target, settings)
        if overlay:
            Image.fromarray(draw_keypoints(image, keypoints)).save(target.with_suffix(".overlay.png"))
        records.append(DetectedFile(name, image.shape[1], image.shape[0], len(keypoints), str(target)))
        on_image(records[-1])
    if not single:
        result = {"settings": settings, "pictures": [asdict(record) for record in records]}
        write_json(out / "result.json", result)
    return records


def read_images(source: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and pixels of an image, of each image of a folder, or of each frame of a film.

    Raises
    ------
    InputError
        If there is nothing to read, an image is damaged, or two images of a folder share a name.
    """
    if source.is_dir():
        paths = sorted(path for path in source.iterdir() if path.suffix.lower() in IMAGES)
        names = [path.stem for path in paths]
        twice = sorted({name for name in names if names.count(name) > 1})
        if not paths or twice:
            got = f"two called {twice[0]}" if twice else "none"
            raise InputError(f"{source}: expected a folder of images with different names, got {got}")
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


def _as_json(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return parameters for the record: arrays (masks) by their shape."""
    return {
        name: f"array {value.shape}" if isinstance(value, np.ndarray) else value for name, value in parameters.items()
    }
