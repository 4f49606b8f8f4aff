"""The whole comparison: which frames there are, and each through every reader; an interrupted run resumes."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from peaksim.traced.library import is_available

from peakmark.experiments.comparison.frames import SWEEPS, Shot, View, bare_shot, clean_shot, traced_shot, warped_shot
from peakmark.experiments.comparison.measure import FrameOutcome, measure
from peakmark.experiments.comparison.own_images import shot_of
from peakmark.experiments.comparison.prints import DESIGNS
from peakmark.experiments.comparison.readers import READERS, Reader
from peakmark.experiments.comparison.recipe import recipe_shot
from peakmark.experiments.images.truth import read_set
from peakmark.experiments.journal import Journal
from peakmark.experiments.option import check_range
from peakmark.experiments.run import OnStep, run_items
from peakmark.plain import from_plain

TRACED_SAMPLES = 64

PER_BOARD = {"traced": 5, "warped": 12, "bare": 12}
"""Frames of the other sets for each board a value; traced ones are left out where Mitsuba is missing."""

RECIPE_POSES = 8
"""Poses of the recipe for each board a value; in each, every design hangs alone."""


@dataclass(frozen=True)
class ComparisonConfig:
    """How much to measure."""

    frames: int = 10
    """Boards a value of each sweep; of the other sets so many times `PER_BOARD`."""
    every: int = 1
    """Take each n-th value of every sweep."""
    seed: int = 0
    folder: Path | None = None
    """Further images with truth, see `images.truth`: one more set."""

    def __post_init__(self) -> None:
        check_range("frames", self.frames, 1, 10_000)
        check_range("seed", self.seed, 0)


QUICK = ComparisonConfig(frames=1, every=2)
"""About three minutes."""


@dataclass(frozen=True)
class Frame:
    """One frame of the comparison."""

    set: str
    """"clean" (rendered exactly), "traced", "warped" (into photographs), "bare" (no print at all), "render-tag" (one
    print alone, by that benchmark's recipe), or "folder"."""
    quantity: str = ""
    value: float = 0.0
    """Of "clean": a key of `SWEEPS` and one of its values; of "render-tag": the design."""
    number: int = 0

    @property
    def name(self) -> str:
        """Unique in a run; the frame's random stream derives from it."""
        return f"{self.set} {self.quantity} {self.value:g} {self.number}"


@dataclass(frozen=True)
class Measured:
    """A frame and what was made of it."""

    frame: Frame
    outcome: FrameOutcome = field(repr=False)


def frames_of(config: ComparisonConfig) -> list[Frame]:
    """Return all frames of a run."""
    return list(_frames(config))


def _frames(config: ComparisonConfig) -> Iterator[Frame]:
    for quantity, values in SWEEPS.items():
        for value in values[:: config.every]:
            yield from (Frame("clean", quantity, value, k) for k in range(config.frames))
    for name, count in PER_BOARD.items():
        if name != "traced" or is_available():
            yield from (Frame(name, number=k) for k in range(count * config.frames))
    for k in range(RECIPE_POSES * config.frames):
        yield from (Frame("render-tag", design, number=k) for design in DESIGNS)
    if config.folder is not None:
        yield from (Frame("folder", number=k) for k in range(len(read_set(config.folder).images)))


def compare(
    config: ComparisonConfig, out: Path, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> list[Measured]:
    """Return the outcome of every frame.

    Raises
    ------
    InputError
        If a library is missing, or the folder is none.
    """
    for reader in READERS:
        reader.open()
    frames = frames_of(config)
    versions = {reader.package: reader.version for reader in READERS}
    folder = None if config.folder is None else str(config.folder.resolve())
    journal = Journal.open(out, {"seed": config.seed, "folder": folder, "versions": versions})
    records = run_items(journal, [frame.name for frame in frames], partial(_measured, config, frames), workers, on_step)
    return [Measured(f, from_plain(FrameOutcome, record)) for f, record in zip(frames, records, strict=True)]


def _measured(config: ComparisonConfig, frames: list[Frame], index: int) -> FrameOutcome:
    frame = frames[index]
    return measure(shoot(config, frame), readers_of(frame))


def readers_of(frame: Frame) -> list[Reader]:
    """Return who reads a frame; where one print hangs alone, those that read its design."""
    return [
        reader
        for reader in READERS
        if frame.number % reader.every == 0 and (frame.set != "render-tag" or frame.quantity == reader.design)
    ]


def shoot(config: ComparisonConfig, frame: Frame) -> Shot:
    """Return a frame's image and truth."""
    if frame.set == "render-tag":
        (design,) = (design for design in DESIGNS if design == frame.quantity)
        return recipe_shot(design, np.random.default_rng([config.seed, *b"render-tag", frame.number]))
    rng = np.random.default_rng([config.seed, *frame.name.encode()])
    if frame.set == "clean":
        return clean_shot(replace(View(), **{frame.quantity: frame.value}), rng)
    if frame.set == "traced":
        return traced_shot(rng, TRACED_SAMPLES)
    if frame.set == "warped":
        return warped_shot(rng)
    if frame.set == "bare":
        return bare_shot(rng)
    assert config.folder is not None
    return shot_of(config.folder, frame.number)
