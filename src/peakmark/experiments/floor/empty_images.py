"""Images without a single marker, rendered floors and real photographs: how many give no false positives."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.floor.flight import open_flight, render_frame
from peakmark.experiments.floor.flights import flight_config
from peakmark.experiments.photographs import load_photograph
from peakmark.identification.api import identify
from peakmark.identification.stretch import Stretch
from peakmark.keypoints.image import as_gray
from peakmark.plain import to_plain
from peakmark.score.statistics import Rate, rate

PHOTOGRAPHS = (
    *("astronaut", "brick", "cat", "chelsea", "clock", "coffee", "coins", "colorwheel", "grass", "hubble_deep_field"),
    *("immunohistochemistry", "microaneurysms", "moon", "retina", "rocket", "text", "china.jpg", "flower.jpg"),
)
"""camera, cell, gravel and page are left out, for the identification was tuned on them."""

WIDTHS_PX = (240, 400, 640, 1000, 1600)
"""To which each photograph is scaled."""

STRETCHES = (1.0, 2.0)
"""Under which each photograph is searched: none, and the paper's."""

FLOORS = ("brick", "grass", "coins")
FRAMES_PER_FLOOR = 70


@dataclass(frozen=True)
class EmptyImage:
    """An image without markers."""

    name: str
    kind: Literal["photograph", "rendered"]
    gray: NDArray[np.uint8]
    """(H, W)."""
    stretch: Stretch
    """Before detection."""


@dataclass(frozen=True)
class FalsePositives:
    """What was detected in images without markers."""

    images: list[str]
    """Names of the images with detections, and how many."""
    without: dict[str, Rate]
    """Kind → share of the images without a detection."""

    def to_plain(self) -> dict[str, Any]:
        """Return what result.json holds."""
        return {"loud": self.images, **to_plain(self.without)}


def photographs(widths_px: Sequence[int] = WIDTHS_PX) -> Iterator[EmptyImage]:
    """Yield each photograph at each width and stretch."""
    for name in PHOTOGRAPHS:
        gray = load_photograph(name)
        for width in widths_px:
            size = (width, round(gray.shape[0] * width / gray.shape[1]))
            smooth = cv2.INTER_AREA if width < gray.shape[1] else cv2.INTER_CUBIC
            scaled = np.asarray(cv2.resize(gray, size, interpolation=smooth), dtype=np.uint8)
            for stretch in STRETCHES:
                yield EmptyImage(f"{name} {width} px, stretch {stretch:g}", "photograph", scaled, stretch)


def bare_floors(frames: int = FRAMES_PER_FLOOR) -> Iterator[EmptyImage]:
    """Yield frames of a bumpy ride over each floor from which the markers were taken."""
    for seed, floor in enumerate(FLOORS):
        flight = open_flight(flight_config("bumpy", floor, 31 + seed, None))
        scene = flight.setup.scene
        bare = replace(scene, quads=tuple(quad for quad in scene.quads if not quad.marks))
        flight = replace(flight, setup=replace(flight.setup, scene=bare))
        for index in np.linspace(0, len(flight.times_s) - 1, frames).astype(int):
            gray = as_gray(render_frame(flight, int(index)).image)
            yield EmptyImage(f"{floor} {index}", "rendered", gray, flight.stretch)


def count_false_positives(images: Iterable[EmptyImage]) -> FalsePositives:
    """Return the share of images without a detection by kind, and the names of the others."""
    named: list[str] = []
    is_empty: dict[str, list[bool]] = {}
    for image in images:
        found = identify(image.gray, image.stretch)
        is_empty.setdefault(image.kind, []).append(not found)
        named += [f"{image.name}: {len(found)}"] if found else []
    return FalsePositives(named, {kind: rate(sum(cases), len(cases)) for kind, cases in is_empty.items()})
