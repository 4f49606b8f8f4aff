"""Robotic navigation (paper, Section 4.2, Figures 10–12): a floor with a path of markers, detected and scored."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import apply_sensor
from peaksim.rendering import Renderer, render
from peaksim.scene.file import Setup, load_scene

from peakmark.errors import InputError
from peakmark.identification import api as identification
from peakmark.identification.api import Rule
from peakmark.identification.detection import Identification
from peakmark.keypoints.image import as_gray
from peakmark.score.markers import Score, localisation, score_frame


@dataclass(frozen=True)
class FloorConfig:
    """What to render and how to look for markers."""

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
    """Frames along the trajectory; 1 looks from its first pose."""
    rule: Rule = "paper"
    """How key points become markers."""
    samples: int = 64
    """Paths a pixel of the traced renderer."""

    def __post_init__(self) -> None:
        for name, value, fits, expected in (
            ("seed", self.seed, self.seed >= 0, "0 or more"),
            ("frames", self.frames, 1 <= self.frames <= 1_000_000, "1…1000000"),
            ("stretch", self.stretch, 0.25 <= self.stretch <= 8, "0.25…8"),
            ("renderer", self.renderer, self.renderer in get_args(Renderer), "auto, gl, exact or traced"),
            ("samples", self.samples, self.samples >= 1, "1 or more"),
            ("rule", self.rule, self.rule in get_args(Rule), "joint or paper"),
        ):
            if not fits:
                raise InputError(f"--{name}: expected {expected}, got {value}")


@dataclass(frozen=True)
class View:
    """One frame, what was found in it, and how well."""

    index: int
    """Frame number from 0."""
    frame: Frame
    """After the sensor."""
    found: Identification
    """All features and the identified markers."""
    score: Score
    """Against truth."""
    time_s: dict[str, float]
    """Seconds for "render" (with the sensor), "detect" and "identify"."""

    def row(self) -> dict[str, Any]:
        """Return the plain figures of this frame."""
        return {
            "frame": self.index,
            "time_on_path_s": self.frame.time_s,
            "features": len(self.found.features),
            **self.score.summary(),
            "time_s": self.time_s,
        }


def open_scene(config: FloorConfig) -> Setup:
    """Load the configuration's scene with its floor texture."""
    return load_scene(config.scene, {} if config.texture is None else {"floor": config.texture})


def fly(setup: Setup, config: FloorConfig) -> Iterator[View]:
    """Yield the views of the trajectory one by one; nothing is kept between them."""
    times = setup.trajectory.times_s
    for index, time_s in enumerate(np.linspace(times[0], times[-1], config.frames)):
        yield look(setup, config, index, float(time_s))


def look(setup: Setup, config: FloorConfig, index: int, time_s: float) -> View:
    """Render, detect, identify and score one frame."""
    start = perf_counter()
    frame = render(
        setup.scene, setup.camera, setup.trajectory, config.renderer, time_s, config.samples, (config.seed, index)
    )
    frame = apply_sensor(frame, setup.sensor, np.random.default_rng((config.seed, index)))
    rendered = perf_counter()
    picture = as_gray(frame.image)
    features = identification.stretched_features(picture, config.stretch)
    detected = perf_counter()
    is_plain = config.rule == "paper"  # which knows no refinement
    found = identification.examine(picture, features, "dark", config.rule, config.stretch, refine=not is_plain)
    score = score_frame(frame.truth, found.detections, found.features)
    times = {"render": rendered - start, "detect": detected - rendered, "identify": perf_counter() - detected}
    return View(index, frame, found, score, times)


class Tally:
    """Sums over the frames of a flight, small enough for any number of them."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []
        self.errors: list[NDArray[np.float64]] = []

    def add(self, view: View) -> None:
        """Count one view."""
        self.rows.append(view.row())
        truth = {t.name: t for t in view.frame.truth}
        for name, index in view.score.matches.items():
            self.errors.append(view.found.detections[index].xy - truth[name].center_xy)

    def summary(self) -> dict[str, Any]:
        """Return totals of counts, the smallest drop, and the localisation over all found markers."""
        drops = [row["response_drop"] for row in self.rows if row["response_drop"] is not None]
        totals = {
            name: sum(row[name] or 0 for row in self.rows)
            for name in ("markers_in_view", "markers_found", "false_detections", "false_above_last_marker")
        }
        return {
            "features": int(np.median([row["features"] for row in self.rows])),
            **totals,
            "response_drop": min(drops, default=None),
            "localisation_px": asdict(localisation(np.array(self.errors).reshape(-1, 2))),
        }

    def seconds(self) -> dict[str, float]:
        """Return the seconds of each stage over all frames."""
        return {stage: sum(row["time_s"][stage] for row in self.rows) for stage in ("render", "detect", "identify")}
