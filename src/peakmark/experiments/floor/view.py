"""One frame of the floor, what was found in it, and how well."""

from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import Frame

from peakmark.identification.api import Narrower, detect_stretched, identify_features
from peakmark.identification.detection import Identification
from peakmark.identification.sift_features import detect_sift, identify_sift_features
from peakmark.identification.stretch import Stretch, stretched
from peakmark.keypoints.image import as_gray
from peakmark.markers.patterns import Made
from peakmark.plain import INLINED
from peakmark.report.overlay import draw_overlay
from peakmark.score.markers import Score, ScoreSummary, ranks_above_clutter, score_frame


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
    made_for: Made = "surf"
    """The detector whose markers were looked for."""

    def row(self) -> "ViewRow":
        """Return the figures of this frame."""
        times = {stage: seconds for stage, seconds in self.time_s.items() if stage != "score"}
        return ViewRow(self.index, self.frame.time_s, len(self.found.features), self.score.summary(), times)

    def errors_px(self) -> list[NDArray[np.float64]]:
        """Return the (2,) errors of all found markers."""
        truth = {marker.name: marker.center_xy for marker in self.frame.truth}
        return [self.found.detections[index].xy - truth[name] for name, index in self.score.matches.items()]

    def overlay(self) -> NDArray[np.uint8]:
        """Return the frame with the ranks of all features of each marker (Figure 10)."""
        return draw_overlay(self.frame.image, self.frame.truth, self.found.detections, self.score, self.ranks())

    def stretched_overlay(self, stretch: float) -> NDArray[np.uint8]:
        """Return the same on the image that the detector saw, vertically stretched, as the paper's Figure 10 is."""

        def seen(xy: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.array([xy[0], (xy[1] + 0.5) * stretch - 0.5])

        truth = [replace(marker, center_xy=seen(marker.center_xy)) for marker in self.frame.truth]
        detections = [replace(d, xy=seen(d.xy), size=d.size * float(np.sqrt(stretch))) for d in self.found.detections]
        return draw_overlay(stretched(as_gray(self.frame.image), stretch), truth, detections, self.score, self.ranks())

    def ranks(self) -> dict[str, tuple[int, ...]]:
        """Return by marker the ranks of its features that are stronger than all clutter."""
        return ranks_above_clutter(self.frame.truth, self.found.features)


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
    rule: Narrower,
    strongest: int | None = None,
    refine: bool = True,
    made_for: Made = "surf",
    **parameters: Any,
) -> FloorView:
    """Detect, identify and score the markers of a frame that took so long to render.

    `strongest` limits the features that are described, `refine` adds sub-pixel positions; see `identify`. Further
    `parameters` are those of `surf.detect_and_describe`. SIFT's markers are found by the paper's rule alone, unrefined.
    """
    start = perf_counter()
    gray = as_gray(frame.image)
    if made_for == "surf":
        features = detect_stretched(gray, stretch, strongest=strongest, **parameters)
    else:
        features = detect_sift(gray, stretch)
    detected = perf_counter()
    if made_for == "surf":
        found = identify_features(gray, features, "dark", rule, stretch, refine=refine)
    else:
        found = identify_sift_features(features, "dark")
    identified = perf_counter()
    score = score_frame(frame.truth, found.detections, found.features)
    seconds = {
        "render": render_s,
        "detect": detected - start,
        "identify": identified - detected,
        "score": perf_counter() - identified,
    }
    return FloorView(index, frame, found, score, seconds, made_for)
