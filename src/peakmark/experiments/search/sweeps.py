"""How far the general search reaches, one disturbance at a time: single markers on paper, drawn at random phases."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.errors import InputError, check_choice
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.identification.families import SOURCES
from peakmark.identification.general import detect_markers
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Variant, marker_image
from peakmark.score.statistics import wilson

Levels = NDArray[np.float64]

SIDE_PX = 34.0
"""Of the marker, but where the size is swept."""

DISTURBANCES: dict[str, tuple[float, ...]] = {
    "noise_sigma": (2, 8, 12, 16, 20),
    "ramp": (0.2, 0.4, 0.6, 0.8),
    "shadow_edge": (0.2, 0.35, 0.5),
    "gamma": (0.45, 0.7, 1.4, 2.2),
    "sharpening": (1, 2),
    "overexposure": (1.5, 2, 3),
    "motion_px": (2, 4, 6),
    "covered": (0.05, 0.1, 0.2, 0.3, 0.4, 0.5),
    "side_px": (12, 14, 15, 20, 34, 60, 120, 200, 400),
    "tilt_deg": (15, 30, 45, 60, 70, 75),
    "clean_side_px": (12, 15, 20, 34, 60, 120, 200, 400),
    "image_width_px": (640, 1280, 2000, 4000),
}
"""What is swept: σ in grey levels; the share of light that a ramp loses over a side, or a shadow's edge takes; the
exponent between print and image; amount of an unsharp mask of σ 1; factor of the light, clipped; path of the camera;
the share of the marker's area that one grey thing covers from a random side; the sides of markers without noise whose
centres lie on pixels, between them along one axis, and along both; and widths of images with markers of any side from
15 px to 400 and any tilt to 60°."""

TILTED = (0.0, 45.0)
"""Tilts of all sweeps but those that have their own."""

_OWN_TILTS = ("tilt_deg", "side_px", "image_width_px")

_PHASES = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))
"""Of centres between pixels."""


@dataclass(frozen=True)
class SweepConfig:
    """How often."""

    markers: int = 20
    """In each cell, half of them dark."""
    seed: int = 0
    """Of phases, rotations and noise."""
    detector: str = "surf"
    """That looks for them, see `families.SOURCES`."""
    limit: Limit = "energy"
    """Of their pattern."""

    def __post_init__(self) -> None:
        if not 1 <= self.markers <= 10_000 or self.seed < 0:
            raise InputError(f"expected --markers 1…10000 and --seed 0 or more, got {self.markers} and {self.seed}")
        check_choice(self.detector, tuple(SOURCES), "--detector")
        check_choice(self.limit, get_args(Limit), "--limit")

    @property
    def variants(self) -> tuple[Variant, Variant]:
        """Light and dark."""
        made_for = SOURCES[self.detector][0]
        return Variant("light", self.limit, made_for), Variant("dark", self.limit, made_for)


def cells() -> Iterator[tuple[str, float, float]]:
    """Yield name and value of a disturbance, and the tilt, of each cell."""
    for name, values in DISTURBANCES.items():
        for tilt_deg in TILTED if name not in _OWN_TILTS else (0.0,):
            yield from ((name, value, tilt_deg) for value in values)


def draw_marker(
    center: Levels, side_px: float, tilt_deg: float, turn_deg: float, variant: Variant, shape: tuple[int, int]
) -> Levels:
    """Return levels 0…1 (H, W) of a marker on white paper before grey, tilted; drawn four times as fine."""
    fine, texels = 4, 162
    sheet = np.pad(marker_image(texels, variant), texels // 4, constant_values=255).astype(np.float64)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    spin, narrow = np.array([[c, -s], [s, c]]), np.cos(np.radians(tilt_deg))
    linear = spin @ np.diag([1.0, narrow]) @ spin.T * (fine * side_px / texels / np.sqrt(narrow))
    shift = fine * (center + 0.5) - 0.5 - linear @ ((np.array(sheet.shape[::-1]) - 1) / 2)
    size = (fine * shape[1], fine * shape[0])
    drawn = cv2.warpAffine(sheet, np.column_stack([linear, shift]), size, flags=cv2.INTER_AREA, borderValue=150.0)
    return np.asarray(cv2.resize(drawn, shape[::-1], interpolation=cv2.INTER_AREA), dtype=np.float64) / 255


def disturbed(levels: Levels, name: str, value: float, center: Levels, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the image (H, W) of levels 0…1 under one disturbance, with a noise of σ 1 at least."""
    across = (np.arange(levels.shape[1]) - center[0]) / SIDE_PX
    light = {"ramp": np.clip(1 - value / 2 + value * across, 0.1, 1.6), "shadow_edge": 1 - value * (across > 0.12)}
    shown = levels ** (value if name == "gamma" else 1.0) * light.get(name, 1.0)
    if name == "motion_px":
        shown = cv2.blur(cv2.resize(shown, None, fx=4, fy=1), (round(4 * value), 1))
        shown = cv2.resize(shown, levels.shape[::-1], interpolation=cv2.INTER_AREA)
    if name == "covered":
        shown = _covered(shown, value, center, rng)
    image = 40 + 170 * np.asarray(shown)
    if name == "overexposure":
        image = np.minimum(value * image, 255)
    if name == "sharpening":
        image = image + value * (image - np.asarray(cv2.GaussianBlur(image, (0, 0), 1.0)))
    sigma = {"noise_sigma": value, "clean_side_px": 0.0}.get(name, 1.0)
    return np.clip(np.rint(image + rng.normal(0, sigma, image.shape)), 0, 255).astype(np.uint8)


def _covered(levels: Levels, share: float, center: Levels, rng: np.random.Generator) -> Levels:
    """Return levels (H, W) behind a straight edge that leaves 1 − share of a disc with the marker's area."""
    y, x = np.mgrid[: levels.shape[0], : levels.shape[1]] - center[::-1, None, None]
    angle = rng.uniform(0, 2 * np.pi)
    along = x * np.cos(angle) + y * np.sin(angle)
    edge = np.quantile(along[np.hypot(x, y) < SIDE_PX / np.sqrt(np.pi)], 1 - share)
    return np.asarray(np.where(along > edge, rng.uniform(0, 1), levels))


def found_in(config: SweepConfig, name: str, value: float, tilt_deg: float, cell: int, number: int) -> bool:
    """Return whether one marker of a cell is found, within a twentieth of its side, as what it is."""
    rng = np.random.default_rng((config.seed, cell, number))
    side_px = value if name in ("side_px", "clean_side_px") else SIDE_PX
    tilt_deg = value if name == "tilt_deg" else tilt_deg
    height = max(240, round(1.8 * side_px))
    phase = np.array(_PHASES[number // 2 % 4]) if name == "clean_side_px" else rng.uniform(-0.5, 0.5, 2)
    if name == "image_width_px":
        height = round(value * 3 / 4)
        side_px, tilt_deg = float(np.exp(rng.uniform(np.log(15), np.log(400)))), float(rng.uniform(0, 60))
        side_px = min(side_px, height / 2.2)
    shape = (height, height * 4 // 3)
    center = np.array(shape[::-1]) // 2 + phase
    variant = config.variants[number % 2]
    levels = draw_marker(center, side_px, tilt_deg, rng.uniform(0, 360), variant, shape)
    found = detect_markers(disturbed(levels, name, value, center, rng), config.variants, (config.detector,))
    within = max(side_px / 20, 0.7)
    return any(d.polarity == variant.polarity and float(np.linalg.norm(d.xy - center)) < within for d in found)


def run_sweeps(
    config: SweepConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> list[dict[str, Any]]:
    """Return a row of each cell: what was disturbed how much at which tilt, found of how many, and 95 % interval."""
    listed = list(cells())
    names = [f"{name} {value:g} {tilt:g}" for name, value, tilt in listed]
    counts = run_items(journal, names, partial(_count, config), workers, on_step)
    return [
        {
            "disturbance": name,
            "value": value,
            "tilt_deg": tilt,
            "found": found,
            "of": config.markers,
            "interval": list(wilson(found, config.markers)),
        }
        for (name, value, tilt), found in zip(listed, counts, strict=True)
    ]


def _count(config: SweepConfig, cell: int) -> int:
    name, value, tilt_deg = list(cells())[cell]
    return sum(found_in(config, name, value, tilt_deg, cell, number) for number in range(config.markers))
