"""What result.json says of a flight: all its figures, and remarks on what they are worth."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from peakmark.experiments.floor.flight import Flight, FlightConfig
from peakmark.experiments.floor.flight_figures import (
    DetectionFigures,
    MotionFigures,
    PoseFigures,
    RecallRow,
    detection_figures,
    distance_figures,
    has_evo,
    motion_figures,
    pose_figures,
    recall_rows,
    speed_figures,
)
from peakmark.experiments.floor.flight_tracking import Flown, FlownFrame
from peakmark.localise.locate import FEWEST
from peakmark.plain import plain_fields
from peakmark.report.results import peak_memory_mb
from peakmark.score.statistics import Quantiles


@dataclass(frozen=True)
class FlightResult:
    """What result.json holds; `distance`, `pose` and `motion` are left out without a map of level markers."""

    detection: DetectionFigures
    distance: dict[str, Quantiles] | None
    """Relative errors, by each of `DISTANCES`."""
    pose: PoseFigures | None
    motion: MotionFigures | None
    time_s: dict[str, float]
    """Median seconds of each stage, and "frames_per_second"."""
    recall_by: dict[str, list[RecallRow]]
    """By side, tilt and distance."""
    pixels: int
    """Of a frame."""
    remarks: list[str]
    """What makes figures unreliable, a line each."""
    renderer: str
    gl_renderer: str | None
    """"exact" or "gl", and what OpenGL calls itself; None for the exact renderer."""
    config: FlightConfig
    peak_memory_mb: float

    def to_plain(self) -> dict[str, Any]:
        """Return what result.json holds."""
        of_map = ("distance", "pose", "motion")
        plain = {name: part for name, part in plain_fields(self).items() if part is not None or name not in of_map}
        del plain["detection"]["false"]
        return plain


def summarise(flown: Flown, flight: Flight) -> FlightResult:
    """Return all figures of a flight."""
    first, has_map = flown.records[0], flown.floor_map is not None
    height_m = np.full(len(flown.frames), np.median(flown.heights_m))
    return FlightResult(
        detection=detection_figures([flown]),
        distance=distance_figures([flown], [height_m]) if has_map else None,
        pose=pose_figures(flown.frames) if has_map else None,
        motion=motion_figures(flown) if has_map else None,
        time_s=speed_figures(flown.records),
        recall_by=recall_rows(flown),
        pixels=flown.camera.width * flown.camera.height,
        remarks=[*remarks(flight), *surprises(flown.frames)],
        renderer=first.renderer,
        gl_renderer=first.gl_renderer,
        config=flight.config,
        peak_memory_mb=peak_memory_mb(),
    )


def remarks(flight: Flight) -> list[str]:
    """Return one line for each thing about the flight that makes figures unreliable, or leaves some out."""
    floor_map, step = flight.floor_map, flight.ride.longest_step_m()
    if floor_map is None:
        return ["the markers are not on one level floor: no poses, no motion"]
    notes = [] if has_evo() else ["trajectory errors are left out: they need evo (pip install 'peakmark[evo]')"]
    if len(floor_map.centers_m) < 2:
        return notes
    gaps = np.linalg.norm(floor_map.centers_m[:, None] - floor_map.centers_m[None], axis=2)
    spacing = float(np.min(gaps + np.diag(np.full(len(gaps), np.inf))))
    if step <= spacing / 2:
        return notes
    return [
        *notes,
        f"the camera moves up to {step:.2g} m between frames, more than half the markers' spacing of {spacing:.2g} m: "
        "tracks and motion without a map cannot follow",
    ]


def surprises(frames: Sequence[FlownFrame]) -> list[str]:
    """Return one line for each thing about what was found that makes figures meaningless."""
    if not any(frame.record.truth for frame in frames):
        return ["no marker was in view in any frame"]
    enough = [frame for frame in frames if len(frame.record.detections) >= FEWEST]
    wrong = sum(frame.is_wrong for frame in frames)
    if enough and (all(frame.located is None for frame in enough) or 2 * wrong > len(enough)):
        return [f"the map does not fit what is seen: most of {len(enough)} frames with {FEWEST} markers say so"]
    return []
