"""The figures of one flight, or of many as one sample: rates by Wilson, quantiles by bootstrap, both 95 %."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

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
from peakmark.score.poses import TrajectoryErrors, trajectory_errors
from peakmark.score.statistics import Bin, Quantiles, Rate, quantiles, rate, recall_by
from peakmark.score.wanted import IN_VIEW, Wanted

FARTHEST_M = 4.0
"""Distance up to which distances are scored; hardly any marker beyond it is found (docs/driving.md)."""

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
class RecallRow:
    """Recall in one bin, markers fully in view."""

    low: float
    """Of the bin, itself in it."""
    high: float
    """No longer in it."""
    recall: Rate
    """Of the markers in it."""
    error_px: float | None
    """Median localisation error of the found ones."""


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


def recall_rows(flight: Flown) -> dict[str, list[RecallRow]]:
    """Return the rows of each of `BINS` for one flight."""
    return {
        quantity: [RecallRow(b.low, b.high, b.recall, b.error_px[50]) for b in recall_bins([flight], quantity)]
        for quantity in BINS
    }


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
