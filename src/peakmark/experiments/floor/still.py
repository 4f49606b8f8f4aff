"""Robotic navigation (paper, Section 4.2, Figures 10–12): a floor with a path of markers, detected and scored."""

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.sensor import apply_sensor
from peaksim.rendering import Renderer, render
from peaksim.scene.file import Setup, load_scene

from peakmark.errors import InputError
from peakmark.experiments.floor.view import FloorView, ViewRow, score_view
from peakmark.identification.api import Rule
from peakmark.identification.stretch import LARGEST, SMALLEST
from peakmark.score.markers import Localisation, localisation


@dataclass(frozen=True)
class FloorConfig:
    """What to render and how to find markers."""

    scene: str = "floor"
    """Scene file, or the name of one that ships with the package."""
    texture: str | None = None
    """Variant of the texture named "floor"; None takes the first."""
    renderer: Renderer = "auto"
    """"gl", "exact", "traced" or "auto"."""
    seed: int = 0
    """Of the sensor's noise; a frame's stream derives from (seed, frame index)."""
    stretch: float = 2.0
    """Vertical stretch before detection."""
    frames: int = 1
    """Frames along the trajectory; 1 is taken from its first pose."""
    rule: Rule = "paper"
    """How key points become markers."""
    samples: int = 64
    """Paths a pixel of the traced renderer."""

    def __post_init__(self) -> None:
        for name, value, fits, expected in (
            ("seed", self.seed, self.seed >= 0, "0 or more"),
            ("frames", self.frames, 1 <= self.frames <= 1_000_000, "1…1000000"),
            ("stretch", self.stretch, SMALLEST <= self.stretch <= LARGEST, "0.25…8"),
            ("renderer", self.renderer, self.renderer in get_args(Renderer), "auto, gl, exact or traced"),
            ("samples", self.samples, self.samples >= 1, "1 or more"),
            ("rule", self.rule, self.rule in get_args(Rule), "joint or paper"),
        ):
            if not fits:
                raise InputError(f"--{name}: expected {expected}, got {value}")


def open_scene(config: FloorConfig) -> Setup:
    """Load the configuration's scene with its floor texture."""
    return load_scene(config.scene, {} if config.texture is None else {"floor": config.texture})


def render_views(setup: Setup, config: FloorConfig) -> Iterator[FloorView]:
    """Yield the views of the trajectory one by one; nothing is kept between them."""
    times = setup.trajectory.times_s
    for index, time_s in enumerate(np.linspace(times[0], times[-1], config.frames)):
        yield render_view(setup, config, index, float(time_s))


def render_view(setup: Setup, config: FloorConfig, index: int, time_s: float) -> FloorView:
    """Render, detect, identify and score one frame."""
    start = perf_counter()
    frame = render(
        setup.scene, setup.camera, setup.trajectory, config.renderer, time_s, config.samples, (config.seed, index)
    )
    frame = apply_sensor(frame, setup.sensor, np.random.default_rng((config.seed, index)))
    is_refined = config.rule != "paper"  # the paper knows no refinement
    return score_view(index, frame, perf_counter() - start, config.stretch, config.rule, refine=is_refined)


@dataclass(frozen=True)
class Totals:
    """Sums over the frames of a trajectory."""

    markers_in_view: int
    markers_found: int
    false_detections: int
    """At no marker."""
    false_above_last_marker: int
    """Features of no marker that are stronger than the weakest marker of their frame."""
    response_drop: float | None
    """The smallest; None without any."""
    localisation_px: Localisation
    """Over all found markers."""


class Tally:
    """The figures of the frames of a trajectory, small enough for any number of them."""

    def __init__(self) -> None:
        self.rows: list[ViewRow] = []
        self.errors: list[NDArray[np.float64]] = []

    def add(self, view: FloorView) -> None:
        """Count one view."""
        self.rows.append(view.row())
        truth = {t.name: t for t in view.frame.truth}
        for name, index in view.score.matches.items():
            self.errors.append(view.found.detections[index].xy - truth[name].center_xy)

    def totals(self) -> Totals:
        """Return sums of counts, the smallest drop, and the localisation over all found markers."""
        scores = [row.score for row in self.rows]
        return Totals(
            markers_in_view=sum(score.markers_in_view for score in scores),
            markers_found=sum(score.markers_found for score in scores),
            false_detections=sum(score.false_detections for score in scores),
            false_above_last_marker=sum(score.false_above_last_marker or 0 for score in scores),
            response_drop=min((s.response_drop for s in scores if s.response_drop is not None), default=None),
            localisation_px=localisation(np.array(self.errors).reshape(-1, 2)),
        )

    def seconds(self) -> dict[str, float]:
        """Return the seconds of each stage over all frames."""
        return {stage: sum(row.time_s[stage] for row in self.rows) for stage in self.rows[0].time_s}
