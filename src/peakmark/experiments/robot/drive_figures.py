"""What the drives come to: how far off the path, how far along it, which markers were lost and found again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.floor_path import FloorPath

from peakmark.experiments.floor.flight_figures import outcomes, precision_of, recall_of, speed_figures
from peakmark.experiments.floor.flight_records import FrameRecord
from peakmark.experiments.floor.flight_tracking import Flown
from peakmark.experiments.robot.drive import DriveFrame
from peakmark.experiments.robot.robot import STOP
from peakmark.score.statistics import Quantiles, Rate, quantiles, rate
from peakmark.score.wanted import Wanted

LOST_M = 0.3
"""A robot that is farther from its path has left it: its own width."""


@dataclass(frozen=True)
class PathFigures:
    """The figures of one drive."""

    reached_m: float
    """Largest arc length along the path."""
    completed: bool
    """Whether it came to the path's end without leaving it."""
    stopped: bool
    """Whether it stood still in the end."""
    cross_track_rms_m: float
    cross_track_max_m: float
    """Distance from the path, root mean square and largest."""
    coasted_m: float
    """Driven after the last image with a detected marker."""
    markers_passed: int
    markers_seen: int
    """Markers that had to be found in any frame, and that were."""
    gaps: int
    """How often a marker that had been found was not, although it was in full view and large enough."""
    found_again: int
    """How many of these ended with a detection."""
    frames: int
    position_mm: Quantiles
    """Errors of the position with the map."""
    wrong_poses: int
    """Poses that were accepted and are a flip or on another part of the map."""


@dataclass(frozen=True)
class DriveFigures:
    """The figures of all drives together; the fields are those of `PathFigures`."""

    completed: Rate
    stopped: Rate
    cross_track_rms_m: float
    """Of the paths' root mean squares, each path counting the same."""
    cross_track_worst_rms_m: float
    """Of the worst path."""
    cross_track_max_m: float
    coasted_max_m: float
    recall: Rate
    """Of the markers that had to be found, over all frames."""
    precision: Rate
    """Of the detections."""
    gaps: int
    found_again: int
    wrong_poses: int
    time_s: dict[str, float]
    """Median seconds of each stage, and "frames_per_second"."""


def path_figures(path: FloorPath, frames: Sequence[DriveFrame], flown: Flown) -> PathFigures:
    """Return the figures of one drive; `flown` holds the same frames, tracked."""
    positions_m = np.array([[frame.state.x_m, frame.state.y_m] for frame in frames])
    at, left = path.nearest(positions_m)
    off_path = np.abs(left[(at >= 0) & (at <= path.length_m)])
    gaps, found_again = gaps_of(flown.records, flown.wanted)
    errors = [error[0] for frame in flown.frames if (error := frame.map_error) is not None]
    return PathFigures(
        reached_m=float(at.max()),
        completed=bool(at.max() >= path.length_m and off_path.max() <= LOST_M),
        stopped=frames[-1].command == STOP,
        cross_track_rms_m=float(np.sqrt((off_path**2).mean())),
        cross_track_max_m=float(off_path.max()),
        coasted_m=coasted_m(positions_m, [len(record.detections) for record in flown.records]),
        markers_passed=len({truth.name for truth, _ in outcomes(flown.records, flown.wanted)}),
        markers_seen=len({name for record in flown.records for name in record.detection_of}),
        gaps=gaps,
        found_again=found_again,
        frames=len(frames),
        position_mm=quantiles(errors),
        wrong_poses=sum(frame.is_wrong for frame in flown.frames),
    )


def coasted_m(positions_m: NDArray[np.float64], detections: Sequence[int]) -> float:
    """Return the length driven from the last of (n, 2) positions with any detection to the last of all."""
    last = max((k for k, count in enumerate(detections) if count), default=0)
    return float(np.linalg.norm(np.diff(positions_m[last:], axis=0), axis=1).sum())


def gaps_of(records: Sequence[FrameRecord], wanted: Wanted) -> tuple[int, int]:
    """Return how often a marker that was found before was lost in full view, and how many were found again."""
    before: set[str] = set()
    lost: set[str] = set()
    gaps = found_again = 0
    for record in records:
        found = set(record.detection_of)
        found_again += len(lost & found)
        fresh = (before & {truth.name for truth in wanted.of(record.truth)}) - found - lost
        gaps += len(fresh)
        lost = (lost | fresh) - found
        before |= found
    return gaps, found_again


def overall(paths: Sequence[PathFigures], records: Sequence[FrameRecord], wanted: Wanted) -> DriveFigures:
    """Return the figures of all drives together, from those of each and the records of all."""
    rms_m = np.array([path.cross_track_rms_m for path in paths])
    return DriveFigures(
        completed=rate(sum(path.completed for path in paths), len(paths)),
        stopped=rate(sum(path.stopped for path in paths), len(paths)),
        cross_track_rms_m=float(np.sqrt((rms_m**2).mean())),
        cross_track_worst_rms_m=float(rms_m.max()),
        cross_track_max_m=max(path.cross_track_max_m for path in paths),
        coasted_max_m=max(path.coasted_m for path in paths),
        recall=recall_of(outcomes(records, wanted)),
        precision=precision_of(records),
        gaps=sum(path.gaps for path in paths),
        found_again=sum(path.found_again for path in paths),
        wrong_poses=sum(path.wrong_poses for path in paths),
        time_s=speed_figures(records),
    )
