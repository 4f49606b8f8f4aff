"""One frame of the floor, what was found in it, and how well."""

from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import Frame
from peaksim.rendering import Renderer
from peaksim.scene.scene import Scene

from peakmark.identification.api import Rule, detect_stretched, identify_features
from peakmark.identification.detection import Identification
from peakmark.identification.stretch import Stretch
from peakmark.keypoints.image import as_gray
from peakmark.plain import INLINED
from peakmark.report.overlay import draw_overlay
from peakmark.score.markers import Score, ScoreSummary, score_frame


@dataclass(frozen=True)
class FloorView:
    """A frame that was scored."""

    index: int
    """Frame number from 0."""
    frame: Frame
    """After the sensor."""
    found: Identification
    score: Score
    time_s: dict[str, float]
    """Seconds for "render" (with the sensor), "detect", "identify" and "score"."""

    def row(self) -> "ViewRow":
        """Return the figures of this frame."""
        times = {stage: seconds for stage, seconds in self.time_s.items() if stage != "score"}
        return ViewRow(self.index, self.frame.time_s, len(self.found.features), self.score.summary(), times)

    def errors_px(self) -> list[NDArray[np.float64]]:
        """Return the (2,) errors of all found markers."""
        truth = {marker.name: marker.center_xy for marker in self.frame.truth}
        return [self.found.detections[index].xy - truth[name] for name, index in self.score.matches.items()]

    def overlay(self) -> NDArray[np.uint8]:
        """Return the frame with ranks (Figure 10)."""
        return draw_overlay(self.frame.image, self.frame.truth, self.found.detections, self.score)


@dataclass(frozen=True)
class ViewRow:
    """A frame's line of frames.csv."""

    frame: int
    time_on_path_s: float
    """Frame number from 0, and when it was taken."""
    features: int
    score: ScoreSummary = field(metadata=INLINED)
    """Number of key points, and the frame against truth."""
    time_s: dict[str, float]
    """Seconds of each stage."""


def score_view(
    index: int,
    frame: Frame,
    render_s: float,
    stretch: Stretch,
    rule: Rule,
    strongest: int | None = None,
    refine: bool = True,
) -> FloorView:
    """Detect, identify and score the markers of a frame that took so long to render.

    `strongest` limits the features that are described, `refine` adds sub-pixel positions; see `identify`.
    """
    start = perf_counter()
    gray = as_gray(frame.image)
    features = detect_stretched(gray, stretch, strongest=strongest)
    detected = perf_counter()
    found = identify_features(gray, features, "dark", rule, stretch, refine=refine)
    identified = perf_counter()
    score = score_frame(frame.truth, found.detections, found.features)
    seconds = {
        "render": render_s,
        "detect": detected - start,
        "identify": identified - detected,
        "score": perf_counter() - identified,
    }
    return FloorView(index, frame, found, score, seconds)


def faster_renderer(renderer: Renderer, scene: Scene) -> Renderer:
    """Return the exact renderer for "auto" where there is no furniture: it is faster there than OpenGL on a CPU."""
    return "exact" if renderer == "auto" and not scene.meshes else renderer
