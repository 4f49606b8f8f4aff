"""Pictures without a single marker: how many stay without a detection, rendered floors and real photographs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.experiments.floor.flight import open_flight, photograph
from peakmark.experiments.floor.flights import flight_config
from peakmark.identification.api import identify
from peakmark.identification.stretch import Stretch
from peakmark.keypoints.image import as_gray
from peakmark.score.plain_statistics import rate

PHOTOGRAPHS = (
    "astronaut",
    "brick",
    "cat",
    "chelsea",
    "clock",
    "coffee",
    "coins",
    "colorwheel",
    "grass",
    "hubble_deep_field",
    "immunohistochemistry",
    "microaneurysms",
    "moon",
    "retina",
    "rocket",
    "text",
)
"""Of scikit-image; camera, cell, gravel and page are left out, for the identification was tuned on them."""

SAMPLES = ("china.jpg", "flower.jpg")
"""Of scikit-learn."""

WIDTHS_PX = (240, 400, 640, 1000, 1600)
STRETCHES = (1.0, 2.0)
FLOORS = ("brick", "grass", "coins")
FRAMES_PER_FLOOR = 70


@dataclass(frozen=True)
class Blank:
    """A picture without markers."""

    name: str
    kind: str
    """"photograph" or "rendered"."""
    gray: NDArray[np.uint8]
    stretch: Stretch


def photographs(widths_px: Sequence[int] = WIDTHS_PX) -> Iterator[Blank]:
    """Yield each photograph at each width and stretch.

    Raises
    ------
    InputError
        If scikit-image or scikit-learn is not installed.
    """
    for name, gray in _originals():
        for width in widths_px:
            size = (width, round(gray.shape[0] * width / gray.shape[1]))
            smooth = cv2.INTER_AREA if width < gray.shape[1] else cv2.INTER_CUBIC
            scaled = np.asarray(cv2.resize(gray, size, interpolation=smooth), dtype=np.uint8)
            for stretch in STRETCHES:
                yield Blank(f"{name} {width} px, stretch {stretch:g}", "photograph", scaled, stretch)


def _originals() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    try:
        from skimage import data
        from sklearn.datasets import load_sample_image
    except ImportError as error:
        raise InputError(f"photographs need scikit-image and scikit-learn: {error}") from error
    for name in PHOTOGRAPHS:
        yield name, as_gray(np.asarray(getattr(data, name)())[..., :3] if name not in _GREY else getattr(data, name)())
    for name in SAMPLES:
        yield name, as_gray(load_sample_image(name))


_GREY = ("brick", "clock", "coins", "grass", "microaneurysms", "moon", "text")


def bare_floors(frames: int = FRAMES_PER_FLOOR) -> Iterator[Blank]:
    """Yield frames of a bumpy ride over each floor from which the markers were taken."""
    for seed, floor in enumerate(FLOORS):
        flight = open_flight(flight_config("bumpy", floor, 31 + seed, None))
        scene = flight.setup.scene
        bare = replace(scene, quads=tuple(quad for quad in scene.quads if not quad.marks))
        flight = replace(flight, setup=replace(flight.setup, scene=bare))
        for index in np.linspace(0, len(flight.times_s) - 1, frames).astype(int):
            gray = as_gray(photograph(flight, int(index)).image)
            yield Blank(f"{floor} {index}", "rendered", gray, flight.stretch)


def silence(pictures: Iterator[Blank]) -> dict[str, Any]:
    """Return the share of pictures without a detection by kind, and the names of the others."""
    loud: list[str] = []
    counts: dict[str, list[bool]] = {}
    for picture in pictures:
        found = identify(picture.gray, picture.stretch)
        counts.setdefault(picture.kind, []).append(not found)
        loud += [f"{picture.name}: {len(found)}"] if found else []
    return {"loud": loud, **{kind: rate(sum(silent), len(silent)) for kind, silent in counts.items()}}
