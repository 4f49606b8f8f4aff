"""The figures of one flight, or of many as one sample: rates by Wilson, quantiles by bootstrap, both 95 %.

`FlightResult` is what result.json says of a flight: all its figures, and remarks on what they are worth.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.experiments.floor.flight import Flight, FlightConfig
from peakmark.experiments.floor.flight_records import FrameRecord
from peakmark.experiments.floor.flight_tracking import (
    DISTANCES,
    Flown,
    FlownFrame,
    distances,
    identity_faults,
    true_distances,
)
from peakmark.localise.locate import FEWEST
from peakmark.plain import plain_fields
from peakmark.report.results import peak_memory_mb
from peakmark.score.poses import TrajectoryErrors, trajectory_errors
from peakmark.score.statistics import Bin, Quantiles, Rate, quantiles, rate, recall_by
from peakmark.score.wanted import IN_VIEW, Wanted

FARTHEST_M = 4.0
"""Distance up to which distances are scored; hardly any marker beyond it is found (docs/figures/driving.md)."""

BINS = {
    "side_px": (0, 10, 15, 20, 30, 45, 70, 1000),
    "tilt_deg": (0, 30, 45, 55, 65, 72, 90),
    "distance_m": (0, 0.8, 1.2, 1.8, 2.5, 3.5, 5, 100),
}
"""Edges of the bins by which recall is broken down, chosen by hand: narrow where recall changes."""


@dataclass(frozen=True)
class DetectionFigures:
    """How the markers of all frames were found."""

    frames: int
    recall: Rate
    """Of the markers that must be found, see `Flown.wanted`."""
    precision: Rate
    """Detections that are at a marker."""
    false: int
    false_per_megapixel: float
    """Detections that are at no marker, in all and for each 10⁶ pixels."""
    uniquely_detectable: Rate
    """Frames with such markers in which the weakest found one has a response above all clutter."""
    silent_without_markers: Rate
    """Frames without a marker in view that have no detection."""
    response_drop: Quantiles
    """Response of the weakest found marker of a frame over its strongest clutter."""
    localisation_px: Quantiles
    """Distances from the true centres."""


@dataclass(frozen=True)
class PoseFigures:
    """How often and how well the map gave the pose, on frames with enough detections."""

    located_alone: Rate
    """Frames whose pose was certain by itself."""
    located: Rate
    """With the pose before, too."""
    wrong: int
    """Poses that were accepted and are a flip or on another part of the map."""
    position_mm: Quantiles
    rotation_deg: Quantiles
    """Errors."""


@dataclass(frozen=True)
class MotionFigures:
    """The camera's trajectory as found, and what tracking lost."""

    map: TrajectoryErrors | None
    """With the map; None without evo."""
    motion: TrajectoryErrors | None
    """Without one, moved as a whole to fit best; None without evo."""
    motion_lost_frames: int
    """Frames without a pose of the latter kind."""
    track_changes: int
    """How often a marker's track changed while it stayed in view."""
    track_swaps: int
    """How many tracks changed their marker."""


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
    recall_by: dict[str, list[Bin]]
    """By side, tilt and distance."""
    pixels: int
    """Of a frame."""
    remarks: list[str]
    """What makes figures unreliable, a line each."""
    renderer: str
    gl_renderer: str | None
    """"exact" or "gl", and what OpenGL calls itself; None for the exact renderer."""
    config: FlightConfig
    peak_memory_mb: float | None

    def to_plain(self) -> dict[str, Any]:
        """Return what result.json holds."""
        of_map = ("distance", "pose", "motion")
        plain = {name: part for name, part in plain_fields(self).items() if part is not None or name not in of_map}
        del plain["detection"]["false"]
        for row in (row for rows in plain["recall_by"].values() for row in rows):
            row["error_px"] = row["error_px"]["p50"]
        return plain


def outcomes(records: Iterable[FrameRecord], wanted: Wanted) -> list[tuple[MarkerTruth, float]]:
    """Return each marker that must be found with its localisation error, px; nan where it was not found."""
    return [(truth, _error_px(record, truth)) for record in records for truth in wanted.of(record.truth)]


def _error_px(record: FrameRecord, truth: MarkerTruth) -> float:
    found = record.detection_of.get(truth.name)
    return np.nan if found is None else float(np.linalg.norm(found.xy - truth.center_xy))


def recall_of(found: Iterable[tuple[MarkerTruth, float]]) -> Rate:
    """Return the share of `outcomes` that were found."""
    errors = [error for _, error in found]
    return rate(int(np.isfinite(errors).sum()), len(errors))


def precision_of(records: Sequence[FrameRecord]) -> Rate:
    """Return the share of detections that are at a marker."""
    total = sum(len(record.detections) for record in records)
    return rate(total - false_detections(records), total)


def false_detections(records: Iterable[FrameRecord]) -> int:
    """Return how many detections are at no marker."""
    return sum(record.score.false_detections for record in records)


def response_drops(records: Iterable[FrameRecord]) -> list[float]:
    """Return the response drops of the frames that have one."""
    return [drop for record in records if (drop := record.score.response_drop) is not None]


def detection_figures(flights: Sequence[Flown]) -> DetectionFigures:
    """Return recall, precision, false detections, unique detectability and response drop over all frames."""
    records = [record for flight in flights for record in flight.records]
    with_markers = [r for flight in flights for r in flight.records if flight.wanted.of(r.truth)]
    empty = [record for record in records if not record.truth]
    megapixels = sum(len(flight.frames) * flight.camera.width * flight.camera.height for flight in flights) / 1e6
    return DetectionFigures(
        frames=len(records),
        recall=recall_of(pair for flight in flights for pair in outcomes(flight.records, flight.wanted)),
        precision=precision_of(records),
        false=false_detections(records),
        false_per_megapixel=false_detections(records) / megapixels,
        uniquely_detectable=rate(sum(drop > 1 for drop in response_drops(with_markers)), len(with_markers)),
        silent_without_markers=rate(sum(not record.detections for record in empty), len(empty)),
        response_drop=quantiles(response_drops(records)),
        localisation_px=quantiles([e for r in records for e in _localisation_errors(r)]),
    )


def _localisation_errors(record: FrameRecord) -> list[float]:
    truth = record.truth_of
    return [float(np.linalg.norm(d.xy - truth[name].center_xy)) for name, d in record.detection_of.items()]


def recall_bins(flights: Iterable[Flown], quantity: str) -> list[Bin]:
    """Return recall and median error in each bin of `BINS[quantity]` that holds markers fully in view."""
    found = outcomes((record for flight in flights for record in flight.records), IN_VIEW)
    values = [getattr(truth, quantity) for truth, _ in found]
    return recall_by(BINS[quantity], values, [error for _, error in found], (50,))


def distance_figures(flights: Sequence[Flown], heights_m: Sequence[NDArray[np.float64]]) -> dict[str, Quantiles]:
    """Return the relative errors of each of `DISTANCES`, of markers up to `FARTHEST_M`.

    `heights_m` are the camera heights taken as known, (n,) for the frames of each flight.
    """
    errors = [
        relative_errors(flight, frame.record, height)
        for flight, of_flight in zip(flights, heights_m, strict=True)
        for frame, height in zip(flight.frames, of_flight.tolist(), strict=True)
    ]
    return {name: quantiles(np.concatenate([np.empty(0), *(e[name] for e in errors)])) for name in DISTANCES}


def relative_errors(flight: Flown, record: FrameRecord, height_m: float) -> dict[str, NDArray[np.float64]]:
    """Return (k,) absolute relative errors of each kind of distance; nan where the shape is not known."""
    truth = true_distances(record)
    near = truth <= FARTHEST_M
    found = distances(record, flight.camera, flight.floor_map, height_m)
    return {name: np.abs(values[near] / truth[near] - 1) for name, values in found.items()}


def pose_figures(frames: Iterable[FlownFrame]) -> PoseFigures:
    """Return how often and how well the map gave the pose, on frames with at least `FEWEST` detections."""
    enough = [frame for frame in frames if len(frame.record.detections) >= FEWEST]
    located = [frame for frame in enough if frame.located is not None]
    errors = np.array([frame.map_error for frame in located]).reshape(-1, 2)
    return PoseFigures(
        located_alone=rate(sum(not frame.is_tracked for frame in located), len(enough)),
        located=rate(len(located), len(enough)),
        wrong=sum(frame.is_wrong for frame in located),
        position_mm=quantiles(errors[:, 0]),
        rotation_deg=quantiles(errors[:, 1]),
    )


def motion_figures(flight: Flown) -> MotionFigures:
    """Return evo's errors of the trajectory with and without the map, and what tracking lost."""
    truth = [record.world_from_camera for record in flight.records]
    by_map, by_motion = flight.trajectories["map"], flight.trajectories["motion"]
    changes, swaps = identity_faults(flight.records, [frame.track_ids for frame in flight.frames])
    return MotionFigures(
        map=trajectory_errors(flight.times_s, truth, by_map, is_aligned=False) if has_evo() else None,
        motion=trajectory_errors(flight.times_s, truth, by_motion, is_aligned=True) if has_evo() else None,
        motion_lost_frames=sum(pose is None for pose in by_motion),
        track_changes=changes,
        track_swaps=swaps,
    )


def has_evo() -> bool:
    """Return whether evo, an extra, is installed."""
    return find_spec("evo") is not None


def speed_figures(records: Sequence[FrameRecord]) -> dict[str, float]:
    """Return median seconds of each stage, and the frames a second of all together."""
    medians = {stage: float(np.median([record.time_s[stage] for record in records])) for stage in records[0].time_s}
    return {**medians, "frames_per_second": 1 / max(sum(medians.values()), 1e-9)}


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
        recall_by={quantity: recall_bins([flown], quantity) for quantity in BINS},
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
