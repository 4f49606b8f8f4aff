"""What the drives come to: how far off the path, how far along it, what was lost from sight and found again."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.floor_path import FloorPath

from peakmark.experiments.floor.flight_course import Step, true_pose
from peakmark.experiments.floor.flight_figures import speed_figures, wanted_markers
from peakmark.experiments.robot.drive import DriveConfig
from peakmark.identification.stretch import Stretch, floor_stretch
from peakmark.score.plain_statistics import quantiles, rate
from peakmark.score.poses import is_wrong, pose_error

LOST_M = 0.3
"""A robot that is farther from its path has left it."""

Records = Sequence[dict[str, Any]]


def path_figures(config: DriveConfig, path: FloorPath, records: Records, course: Sequence[Step]) -> dict[str, Any]:
    """Return the figures of one drive; lengths in metres.

    `coasted_m` is how far the robot went after the last picture in which it saw a marker; `gaps` how often a marker
    that it had seen was not detected although it was in full view and large enough, `found_again` how many of those
    ended with a detection.
    """
    places = np.array([record["state"][:2] for record in records])
    at, left = path.nearest(places)
    on_path = (at >= 0) & (at <= path.length_m)
    stretch = floor_stretch(config.camera, config.mount.pitch_deg)
    gaps, found_again = gaps_of(records, stretch)
    return {
        "reached_m": float(at.max()),
        "completed": bool(at.max() >= path.length_m and np.abs(left[on_path]).max() <= LOST_M),
        "stopped": records[-1]["command"] == [0.0, 0.0],
        "cross_track_rms_m": float(np.sqrt((left[on_path] ** 2).mean())),
        "cross_track_max_m": float(np.abs(left[on_path]).max()),
        "coasted_m": coasted_m(places, [len(record["detections"]) for record in records]),
        "markers_passed": len({truth["name"] for r in records for truth in wanted_markers(r, stretch)}),
        "markers_seen": len({row["truth"] for r in records for row in r["detections"]} - {None}),
        "gaps": gaps,
        "found_again": found_again,
        "frames": len(records),
        "position_mm": quantiles(_position_errors(records, course)),
        "wrong_poses": sum(is_wrong(_error(record, step)) for record, step in zip(records, course, strict=True)),
    }


def _error(record: dict[str, Any], step: Step) -> tuple[float, float] | None:
    return pose_error(None if step.located is None else step.located.world_from_camera, true_pose(record))


def _position_errors(records: Records, course: Sequence[Step]) -> list[float]:
    errors = [_error(record, step) for record, step in zip(records, course, strict=True)]
    return [error[0] for error in errors if error is not None]


def coasted_m(places: NDArray[np.float64], seen: Sequence[int]) -> float:
    """Return the way from the last of (n, 2) places at which anything was seen to the last of all."""
    last = max((k for k, count in enumerate(seen) if count), default=0)
    return float(np.linalg.norm(np.diff(places[last:], axis=0), axis=1).sum())


def gaps_of(records: Records, stretch: Stretch) -> tuple[int, int]:
    """Return how often a marker that was seen before got lost in full view, and how many of these were found again."""
    before: set[str] = set()
    lost: set[str] = set()
    gaps = found_again = 0
    for record in records:
        seen = {row["truth"] for row in record["detections"]} - {None}
        asked = {truth["name"] for truth in wanted_markers(record, stretch)}
        found_again += len(lost & seen)
        fresh = (before & asked) - seen - lost
        gaps += len(fresh)
        lost = (lost | fresh) - seen
        before |= seen
    return gaps, found_again


def overall(runs: Sequence[dict[str, Any]], records: Records, stretch: Stretch) -> dict[str, Any]:
    """Return the figures of all drives together, from those of each and the records of all."""
    squares = np.array([run["cross_track_rms_m"] for run in runs])
    wanted = [(truth["name"], record) for record in records for truth in wanted_markers(record, stretch)]
    found = sum(name in {row["truth"] for row in record["detections"]} for name, record in wanted)
    total = sum(len(record["detections"]) for record in records)
    false = sum(record["score"]["false_detections"] for record in records)
    return {
        "completed": rate(sum(run["completed"] for run in runs), len(runs)),
        "stopped": rate(sum(run["stopped"] for run in runs), len(runs)),
        "cross_track_rms_m": float(np.sqrt((squares**2).mean())),
        "cross_track_worst_rms_m": float(squares.max()),
        "cross_track_max_m": max(run["cross_track_max_m"] for run in runs),
        "coasted_max_m": max(run["coasted_m"] for run in runs),
        "recall": rate(found, len(wanted)),
        "precision": rate(total - false, total),
        "gaps": sum(run["gaps"] for run in runs),
        "found_again": sum(run["found_again"] for run in runs),
        "wrong_poses": sum(run["wrong_poses"] for run in runs),
        "time_s": speed_figures(list(records)),
    }
