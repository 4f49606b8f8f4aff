"""Robotic navigation (paper, Section 4.2, Figures 10–12): a floor with a path of markers, detected and scored."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.sensor import apply_sensor
from peaksim.rendering import Renderer, render
from peaksim.scene.file import Setup, load_scene

from peakmark.experiments.floor.view import FloorView, score_view
from peakmark.experiments.option import check_choice, check_range
from peakmark.identification.api import Rule
from peakmark.identification.stretch import LARGEST, SMALLEST
from peakmark.score.markers import Localisation, ScoreSummary, localisation


@dataclass(frozen=True)
class FloorConfig:
    """What to render and how to find markers."""

    scene: str = "floor"
    """Scene file, or the name of one that ships with the package."""
    texture: str | None = None
    """Variant of the texture named "floor"; None takes the first."""
    renderer: Renderer = "auto"
    """"gl", "exact" or "auto"."""
    seed: int = 0
    """Of the sensor's noise; a frame's stream derives from (seed, frame index)."""
    stretch: float = 2.0
    """Vertical stretch before detection."""
    frames: int = 1
    """Frames along the trajectory; 1 is taken from its first pose."""
    rule: Rule = "paper"
    """How key points become markers."""

    def __post_init__(self) -> None:
        check_range("seed", self.seed, 0)
        check_range("frames", self.frames, 1, 1_000_000)
        check_range("stretch", self.stretch, SMALLEST, LARGEST)
        check_choice("renderer", self.renderer, ("auto", "gl", "exact"))
        check_choice("rule", self.rule, get_args(Rule))


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
    frame = render(setup.scene, setup.camera, setup.trajectory, renderer=config.renderer, time_s=time_s)
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


def totals_of(scores: Sequence[ScoreSummary], errors_px: Sequence[NDArray[np.float64]]) -> Totals:
    """Return sums of counts, the smallest drop, and the localisation from the (2,) errors of all found markers."""
    return Totals(
        markers_in_view=sum(score.markers_in_view for score in scores),
        markers_found=sum(score.markers_found for score in scores),
        false_detections=sum(score.false_detections for score in scores),
        false_above_last_marker=sum(score.false_above_last_marker or 0 for score in scores),
        response_drop=min((s.response_drop for s in scores if s.response_drop is not None), default=None),
        localisation_px=localisation(np.array(errors_px).reshape(-1, 2)),
    )
