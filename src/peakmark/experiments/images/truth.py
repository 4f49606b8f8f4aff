"""A folder of images and what they truly show.

Three kinds of folder are known: one with a `truth.json` beside the images (below), a finished corpus of peaksim, and
photographs without any truth, in which there must be no markers.

`truth.json` is a list with one table an image: `file` (below the folder), `condition`, `version` (the sensor), and
`markers`: `polarity`, `xy` (px), `side_px`, `tilt_deg`, `visible` and `inside` (shares 0…1), and where they apply
`limit` ("range"), `bent`, `group` (the array that it belongs to) and `code`; further `tags` with `id`, `xy`,
`side_px`, `tilt_deg`, `visible`. Other fields are taken for notes.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.corpus.read import Corpus, open_corpus
from peaksim.image_file import read_image
from peaksim.text_file import read_text
from peaksim.toml_file import validate
from pydantic import BaseModel, ConfigDict, Field

from peakmark.errors import InputError
from peakmark.experiments.option import check_choice
from peakmark.identification.api import usual_limit
from peakmark.identification.families import SOURCES
from peakmark.keypoints.image import as_gray
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity
from peakmark.score.wanted import polarity_of

TRUTH = "truth.json"
_LARGEST = 200_000_000
"""Bytes of a truth file."""

ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")
"""Name endings of photographs."""

Point = tuple[float, float]


class _Table(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, frozen=True)


class TrueMarker(_Table):
    """A marker in an image."""

    polarity: Polarity
    limit: Limit = "energy"
    """Of the pattern that was printed."""
    xy: Point
    """Centre, px."""
    side_px: float = Field(gt=0)
    """Square root of its area, px."""
    tilt_deg: float = Field(ge=0, le=90)
    visible: float = Field(ge=0, le=1)
    """Share of it that nothing covers and the image holds."""
    inside: float = Field(default=1.0, ge=0, le=1)
    """Share of it that the image holds."""
    bent: float | bool | str | None = None
    """Anything but nothing if its paper is not flat."""
    group: str | None = None
    """Name of the array that it belongs to."""
    code: int | None = None
    """That this array carries."""


class TrueTag(_Table):
    """An AprilTag 36h11 in an image."""

    id: int
    xy: Point
    side_px: float = Field(gt=0)
    tilt_deg: float = Field(default=0.0, ge=0, le=90)
    visible: float = Field(default=1.0, ge=0, le=1)


class TrueImage(_Table):
    """An image and what is in it."""

    file: str
    condition: str = "all"
    """How it was taken, such as "shadow"."""
    version: str = ""
    """The sensor; a text in braces is notes."""
    markers: tuple[TrueMarker, ...] = ()
    tags: tuple[TrueTag, ...] = ()

    @property
    def sensor(self) -> str:
        """Name of the sensor, "any" where there is none."""
        return "any" if not self.version or self.version.startswith("{") else self.version


class _TruthFile(_Table):
    images: tuple[TrueImage, ...]


@dataclass(frozen=True)
class ImageSet:
    """Images with their truth."""

    images: tuple[TrueImage, ...]
    read: Callable[[int], NDArray[np.uint8]]
    """Returns the grey image of an index."""


@dataclass(frozen=True)
class Sought:
    """Which markers are looked for: as `identify` takes them."""

    detector: str = "surf"
    limit: Limit | Literal["both"] | None = None

    def __post_init__(self) -> None:
        check_choice("detector", self.detector, tuple(SOURCES))
        check_choice("limit", self.limit or "energy", (*get_args(Limit), "both"))

    def includes(self, kind: str) -> bool:
        """Return whether a kind of marker, such as "sift-range-dark", is looked for."""
        limit = "range" if "range" in kind else "energy"
        wanted = self.limit or usual_limit((self.detector,))
        return kind.startswith(SOURCES[self.detector][0]) and wanted in (limit, "both")


USUAL = Sought()
"""SURF's markers, the paper's."""


def read_set(folder: Path, sought: Sought = USUAL) -> ImageSet:
    """Return the images of a folder of one of the three kinds; of a corpus's markers those that are looked for count.

    Raises
    ------
    InputError
        If it is none, holds no image, or its truth is not as above: file, field, expected, got.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a folder of images, found {'a file' if folder.exists() else 'nothing'}")
    if (folder / TRUTH).exists():
        return _with_truth(folder)
    if (folder / "corpus.json").exists() or (folder / "manifest.json").exists():
        return _of_corpus(open_corpus(str(folder)), sought)
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() in ENDINGS)
    if not files:
        raise InputError(f"{folder}: expected {TRUTH}, a corpus or photographs, found none of them")
    images = tuple(TrueImage(file=str(path.relative_to(folder)), condition="bare") for path in files)
    return ImageSet(images, lambda k: as_gray(read_image(files[k])))


def _with_truth(folder: Path) -> ImageSet:
    path = folder / TRUTH
    try:
        content = json.loads(read_text(path, _LARGEST))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: line {error.lineno}: expected JSON, got {error.msg}") from error
    images = validate(_TruthFile, {"images": content}, str(path)).images
    root = folder.resolve()
    for k, image in enumerate(images):
        if not (root / image.file).resolve().is_relative_to(root):
            raise InputError(f"{path}: images[{k}].file: expected one below the folder, got {image.file!r}")
    if not images:
        raise InputError(f"{path}: expected at least one image, got none")
    return ImageSet(images, lambda k: as_gray(read_image(root / images[k].file)))


def _of_corpus(corpus: Corpus, sought: Sought) -> ImageSet:
    images = tuple(_of_record(number, record, sought) for number, record in enumerate(corpus.records()))
    return ImageSet(images, lambda k: as_gray(corpus.picture(k)))


def _of_record(number: int, record: Any, sought: Sought) -> TrueImage:
    """Return a corpus's frame; of its markers those that are looked for and in view."""
    markers = [
        TrueMarker(
            polarity=polarity_of(marker["kind"]),
            limit="range" if "range" in marker["kind"] else "energy",
            xy=tuple(marker["points_xy"][0]),
            side_px=marker["side_px"],
            tilt_deg=marker["tilt_deg"],
            visible=marker["visible_fraction"],
            inside=1.0 if all(marker["points_seen"]) else 0.0,
        )
        for marker in record["markers"]
        if sought.includes(marker["kind"]) and marker["visible_fraction"] > 0 and None not in marker["points_xy"][0]
    ]
    return TrueImage(file=f"frame {number}", version=record["camera"]["name"], markers=tuple(markers))
