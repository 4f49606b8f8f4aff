"""Detection on files: images, folders and films in; key points, overlays and a summary out."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.whole_file import whole_file
from PIL import Image

from peakmark.cli.sources import FailedFile, OnFailure, image_count, read_images
from peakmark.detectors.registry import find_detector, settings_of
from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints
from peakmark.report.overlay import draw_keypoints
from peakmark.report.results import write_json

FORMATS = (".npz", ".csv", ".json")
"""Name endings of key point files."""
OVERLAY = ".overlay.png"
"""Name ending of drawings, see `sources.OVERLAYS`."""
RESULT = "result.json"
"""Name of the summary of a folder or film."""


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
    on_failure: OnFailure = lambda one: None,
    is_upright: bool = True,
) -> list[DetectedFile]:
    """Detect key points in an image, each image of a folder, or each frame of a film.

    Parameters
    ----------
    source : an image, a folder (its images, by name; no subfolders) or a film.
    out : a file name ending in .npz, .csv or .json if `source` is an image; otherwise a folder, made if missing,
        which gets NAME.npz for each image, each of them whole, and result.json, however the run ends.
    detector, parameters : see `peakmark.detectors`.
    overlay : also draw the key points, into NAME.overlay.png beside them.
    ending : of the files in a folder: .npz, .csv or .json.
    on_image : called after each image.
    on_failure : called for each image of a folder that cannot be read, which is left out, and for a film that ends
        early; result.json lists them under "failed".
    is_upright : apply the rotation that files note for viewers; see `peaksim.image_file`.

    Returns
    -------
    One record an image, in order.

    Raises
    ------
    InputError
        If the source is missing, or a single image unreadable, no image, or too large; a parameter is not the
        detector's; or `out` cannot be written.
    """
    settings = {"detector": detector, **_as_json(settings_of(detector, parameters or {}))}
    settings |= {} if is_upright else {"raw_orientation": True}
    detect = find_detector(detector)
    is_single = out.suffix in FORMATS
    if is_single and image_count([str(source)]) is None:
        raise InputError(f"{out}: expected a folder, as {source} holds many images")
    if ending not in FORMATS:
        raise InputError(f"format: expected one of {', '.join(FORMATS)}, got {ending!r}")
    summary = _Summary(settings, [], [])
    note = summary.failures_to(on_failure)
    with nullcontext() if is_single else summary.written(out):
        for each in read_images(source, is_upright, note):
            name, image = each.name, each.image
            target = out if is_single else _target(out, name, ending)
            try:
                keypoints = detect(image, **(parameters or {}))
            except InputError as error:
                if not summary.records:  # the parameters are at fault, not this image
                    raise
                note(FailedFile(name, str(error)))
                continue
            with _named(out):
                _save(target, keypoints, settings, draw_keypoints(image, keypoints) if overlay else None)
            summary.records.append(DetectedFile(name, image.shape[1], image.shape[0], len(keypoints), str(target)))
            on_image(summary.records[-1])
    return summary.records


@dataclass(frozen=True)
class _Summary:
    """What result.json holds."""

    settings: dict[str, Any]
    records: list[DetectedFile]
    failed: list[FailedFile]

    def failures_to(self, on_failure: OnFailure) -> OnFailure:
        """Return what notes a failure here and passes it on."""

        def note(one: FailedFile) -> None:
            self.failed.append(one)
            on_failure(one)

        return note

    @contextmanager
    def written(self, out: Path) -> Iterator[None]:
        """Write result.json when the block ends, however it ends."""
        try:
            yield
        except BaseException:
            with suppress(InputError):
                self._write(out)
            raise
        self._write(out)

    def _write(self, out: Path) -> None:
        if self.records or self.failed:
            with _named(out):
                out.mkdir(parents=True, exist_ok=True)
                result = {"settings": self.settings, "pictures": [asdict(record) for record in self.records]}
                with whole_file(out / RESULT) as path:
                    write_json(path, result | {"failed": [asdict(one) for one in self.failed]})


@contextmanager
def _named(out: Path) -> Iterator[None]:
    """Name `out` where files cannot be written there."""
    try:
        yield
    except OSError as error:
        raise InputError(f"--out {out}: expected a path that can be written: {error.strerror or error}") from error


def _save(target: Path, keypoints: Keypoints, settings: dict[str, Any], drawing: NDArray[np.uint8] | None) -> None:
    """Write key points and their drawing, each of them whole or not at all."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if drawing is not None:
        with whole_file(target.with_suffix(OVERLAY)) as path:
            Image.fromarray(drawing).save(path)
    with whole_file(target) as path:
        keypoints.save(path, settings)


def _target(out: Path, name: str, ending: str) -> Path:
    target = out / f"{name}{ending}"
    if target.name == RESULT:
        raise InputError(f"{name}: expected --format npz or csv, as {RESULT} is the summary's name")
    return target


def _as_json(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return parameters for the record: arrays (masks) by their shape."""
    return {
        name: f"array {value.shape}" if isinstance(value, np.ndarray) else value for name, value in parameters.items()
    }
