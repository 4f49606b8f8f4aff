"""The figures of a flight, with intervals: rates by Wilson, quantiles by bootstrap, both 95 %."""

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera

from peakmark.experiments.floor.flight_course import Sight, Step, distances, identity_faults, sight, true_pose
from peakmark.identification.stretch import Stretch
from peakmark.localise.locate import FEWEST, FloorMap
from peakmark.score.plain_statistics import quantiles, rate
from peakmark.score.poses import is_wrong, pose_error, trajectory_errors
from peakmark.score.wanted import FULLY_IN_VIEW

SMALLEST_SIDE_PX = 20.0
"""Side after stretching from which a marker fully in view must be found."""

FARTHEST_M = 4.0
"""Distance up to which distance from scale is judged."""


def wanted_markers(record: dict[str, Any], stretch: Stretch) -> list[dict[str, Any]]:
    """Return a record's markers that are fully in view and at least `SMALLEST_SIDE_PX` after stretching."""
    factor = np.asarray(stretch, dtype=np.float64)

    def stretched_side(truth: dict[str, Any]) -> float:
        row = int(np.clip(round(truth["center_xy"][1]), 0, max(factor.size - 1, 0)))
        return float(truth["side_px"] * np.sqrt(factor[row] if factor.ndim else factor))

    return [
        truth
        for truth in record["truth"]
        if truth["visible_fraction"] >= FULLY_IN_VIEW and stretched_side(truth) >= SMALLEST_SIDE_PX
    ]


def detection_figures(records: Sequence[dict[str, Any]], stretch: Stretch, pixels: int) -> dict[str, Any]:
    """Return recall, precision, false detections, unique detectability and margin over a flight."""
    wanted = found = false = total = unique = with_markers = empty = silent = 0
    drops = []
    for record in records:
        names = {row["truth"] for row in record["detections"]}
        asked = wanted_markers(record, stretch)
        wanted += len(asked)
        found += sum(truth["name"] in names for truth in asked)
        total += len(record["detections"])
        false += record["score"]["false_detections"]
        drop = record["score"]["response_drop"]
        drops += [] if drop is None else [drop]
        with_markers += bool(asked)
        unique += bool(asked) and drop is not None and drop > 1
        empty += not record["truth"]
        silent += not record["truth"] and not record["detections"]
    return {
        "frames": len(records),
        "recall": rate(found, wanted),
        "precision": rate(total - false, total),
        "false_per_megapixel": 1e6 * false / (len(records) * pixels),
        "uniquely_detectable": rate(unique, with_markers),
        "silent_without_markers": rate(silent, empty),
        "response_drop": quantiles(drops),
        "localisation_px": quantiles([e for r in records for e in _localisation_errors(r)]),
    }


def _localisation_errors(record: dict[str, Any]) -> list[float]:
    places = {truth["name"]: np.array(truth["center_xy"]) for truth in record["truth"]}
    rows = [row for row in record["detections"] if row["truth"] in places]
    return [float(np.linalg.norm(np.array(row["xy"]) - places[row["truth"]])) for row in rows]


def distance_figures(
    records: Sequence[dict[str, Any]], camera: Camera, side_m: float, height_m: float
) -> dict[str, dict[str, Any]]:
    """Return the relative errors of the three distances of markers up to `FARTHEST_M`."""
    errors: dict[str, list[float]] = {"rounded": [], "scale": [], "refined": []}
    for record in records:
        for name, values in relative_errors(record, sight(record), camera, side_m, height_m).items():
            errors[name] += list(values)
    return {name: quantiles(values) for name, values in errors.items()}


def relative_errors(
    record: dict[str, Any], seen: Sight, camera: Camera, side_m: float, height_m: float
) -> dict[str, NDArray[np.float64]]:
    """Return (k,) absolute relative errors of each kind of distance; nan where the shape is not known."""
    true = {truth["name"]: truth["distance_m"] for truth in record["truth"]}
    truth = np.array([true.get(row["truth"], np.nan) for row in record["detections"]], dtype=np.float64)
    near = truth <= FARTHEST_M
    found = distances(seen, record, camera, side_m, height_m)
    return {name: np.abs(values[near] / truth[near] - 1) for name, values in found.items()}


def pose_figures(records: Sequence[dict[str, Any]], course: Sequence[Step]) -> dict[str, Any]:
    """Return how often and how well the map gave the pose, on frames with at least four markers detected."""
    rows = [k for k, r in enumerate(records) if len(r["detections"]) >= FEWEST]
    alone = [k for k in rows if course[k].located is not None and not course[k].is_tracked]
    any_way = [k for k in rows if course[k].located is not None]
    errors = {k: pose_error(course[k].located.world_from_camera, true_pose(records[k])) for k in any_way}  # type: ignore[union-attr]
    return {
        "located_alone": rate(len(alone), len(rows)),
        "located": rate(len(any_way), len(rows)),
        "wrong": sum(is_wrong(error) for error in errors.values()),
        "position_mm": quantiles(_column(errors.values(), 0)),
        "rotation_deg": quantiles(_column(errors.values(), 1)),
    }


def _column(errors: Iterable[tuple[float, float] | None], index: int) -> list[float]:
    return [error[index] for error in errors if error is not None]


def motion_figures(
    times_s: NDArray[np.float64], records: Sequence[dict[str, Any]], course: Sequence[Step]
) -> dict[str, Any]:
    """Return evo's errors of both ways to know where the camera is, None without evo, and what tracking lost."""
    truth = [true_pose(record) for record in records]
    by_map = [None if step.located is None else step.located.world_from_camera for step in course]
    by_motion = [step.moved for step in course]
    changes, swaps = identity_faults(records, [step.track_ids for step in course])
    return {
        "map": trajectory_errors(times_s, truth, by_map, is_aligned=False) if has_evo() else None,
        "motion": trajectory_errors(times_s, truth, by_motion, is_aligned=True) if has_evo() else None,
        "motion_lost_frames": sum(pose is None for pose in by_motion),
        "track_changes": changes,
        "track_swaps": swaps,
    }


def has_evo() -> bool:
    """Return whether evo, an extra, is installed."""
    return find_spec("evo") is not None


def speed_figures(records: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Return median seconds of each stage, and the frames a second of all together."""
    stages = records[0]["time_s"]
    medians = {stage: float(np.median([record["time_s"][stage] for record in records])) for stage in stages}
    return {**medians, "frames_per_second": 1 / max(sum(medians.values()), 1e-9)}


def figures(
    records: Sequence[dict[str, Any]],
    course: Sequence[Step],
    times_s: NDArray[np.float64],
    camera: Camera,
    stretch: Stretch,
    floor_map: FloorMap | None,
) -> dict[str, Any]:
    """Return all figures of a flight; those that need a map of level markers are left out without one."""
    result: dict[str, Any] = {"detection": detection_figures(records, stretch, camera.width * camera.height)}
    if floor_map is not None:
        height = float(np.median([true_pose(r)[2, 3] for r in records]) - floor_map.centers_m[0, 2])
        result["distance"] = distance_figures(records, camera, floor_map.side_m, height)
        result["pose"] = pose_figures(records, course)
        result["motion"] = motion_figures(times_s, records, course)
    return {**result, "time_s": speed_figures(records)}


BINS = {
    "side_px": (0, 10, 15, 20, 30, 45, 70, 1000),
    "tilt_deg": (0, 30, 45, 55, 65, 72, 90),
    "distance_m": (0, 0.8, 1.2, 1.8, 2.5, 3.5, 5, 100),
}
"""Edges of the bins by which recall is broken down."""


def recall_by(records: Sequence[dict[str, Any]], quantity: str) -> list[dict[str, Any]]:
    """Return one row a bin of `BINS[quantity]` that holds markers fully in view: recall, and localisation p50 in px."""
    rows = []
    for low, high in pairwise(BINS[quantity]):
        wanted = found = 0
        errors: list[float] = []
        for record in records:
            seen = {row["truth"]: np.array(row["xy"]) for row in record["detections"]}
            for truth in record["truth"]:
                if truth["visible_fraction"] >= FULLY_IN_VIEW and low <= truth[quantity] < high:
                    wanted += 1
                    found += truth["name"] in seen
                    if truth["name"] in seen:
                        errors.append(float(np.linalg.norm(seen[truth["name"]] - truth["center_xy"])))
        if wanted:
            rows.append({"low": low, "high": high, "recall": rate(found, wanted), "error_px": quantiles(errors)["p50"]})
    return rows
