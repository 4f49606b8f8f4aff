"""What a flight's records tell in their order: tracks, distances, where the camera was, and how well it was found."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, invert

from peakmark.identification.detection import SIDE_OF_SCALE
from peakmark.localise.distance import distances_at_height, distances_of_shapes, solid_angles
from peakmark.localise.locate import FloorMap, Located, locate
from peakmark.localise.odometry import odometry
from peakmark.localise.tracks import Tracks, follow


@dataclass(frozen=True)
class Sight:
    """The detections of one frame as columns."""

    xy: NDArray[np.float64]
    """(n, 2) px."""
    affinity: NDArray[np.float64]
    """(n, 2, 2) px per side; nan where not refined."""
    side_px: NDArray[np.float64]
    """(n,)."""

    @property
    def refined(self) -> NDArray[np.bool_]:
        """(n,) whether the shape is known."""
        return np.asarray(np.isfinite(self.affinity).all(axis=(1, 2)))


@dataclass(frozen=True)
class Step:
    """One frame in the course of the flight."""

    track_ids: NDArray[np.intp]
    """(n,) of the detections."""
    located: Located | None
    """The pose in the map, None where it is not certain."""
    is_tracked: bool
    """Whether the pose before was needed to be certain."""
    moved: Pose | None
    """The pose without a map, in the true world of the first frame that has one; None where lost."""


def sight(record: dict[str, Any]) -> Sight:
    """Return a record's detections as columns."""
    rows = record["detections"]
    shapes = [np.full((2, 2), np.nan) if row["affinity"] is None else row["affinity"] for row in rows]
    return Sight(
        np.array([row["xy"] for row in rows], dtype=np.float64).reshape(-1, 2),
        np.array(shapes, dtype=np.float64).reshape(-1, 2, 2),
        np.array([row["side_px"] for row in rows], dtype=np.float64),
    )


def true_pose(record: dict[str, Any]) -> Pose:
    """Return a record's `world_from_camera`."""
    return np.array(record["world_from_camera"])


def steps(records: Sequence[dict[str, Any]], camera: Camera, floor_map: FloorMap | None) -> list[Step]:
    """Return the course of a flight.

    Parameters
    ----------
    records
        Of all frames, in order.
    camera
        That took them.
    floor_map
        Of the markers; None leaves poses and motion out.
    """
    sights = [sight(record) for record in records]
    ids = track_ids(sights)
    located = locations(sights, camera, floor_map) if floor_map else [(None, False)] * len(sights)
    moved = motion(records, sights, ids, camera, floor_map.side_m) if floor_map else [None] * len(sights)
    return [Step(i, place, tracked, pose) for i, (place, tracked), pose in zip(ids, located, moved, strict=True)]


def ways(records: Sequence[dict[str, Any]], course: Sequence[Step]) -> dict[str, list[Pose | None]]:
    """Return the camera's poses by name: "truth", "map" (found with it) and "motion" (without a map)."""
    return {
        "truth": [true_pose(record) for record in records],
        "map": [None if step.located is None else step.located.world_from_camera for step in course],
        "motion": [step.moved for step in course],
    }


def track_ids(sights: Sequence[Sight]) -> list[NDArray[np.intp]]:
    """Return each frame's (n,) track ids."""
    tracks, ids = Tracks(), []
    for seen in sights:
        tracks, of_frame = follow(tracks, seen.xy, seen.side_px)
        ids.append(of_frame)
    return ids


def locations(sights: Sequence[Sight], camera: Camera, floor_map: FloorMap) -> list[tuple[Located | None, bool]]:
    """Return each frame's pose in the map, by itself where that is certain, else near the pose before."""
    before: Pose | None = None
    found: list[tuple[Located | None, bool]] = []
    for seen in sights:
        xy, affinity = seen.xy[seen.refined], seen.affinity[seen.refined]
        alone = locate(camera, floor_map, xy, affinity)
        near = None if alone or before is None else locate(camera, floor_map, xy, affinity, near=before)
        place = alone or near
        before = None if place is None else place.world_from_camera
        found.append((place, near is not None))
    return found


def motion(
    records: Sequence[dict[str, Any]],
    sights: Sequence[Sight],
    ids: Sequence[NDArray[np.intp]],
    camera: Camera,
    side_m: float,
) -> list[Pose | None]:
    """Return each frame's pose without a map; the first that has one is put where it truly is."""
    frames = [(i[s.refined], s.xy[s.refined], s.affinity[s.refined]) for i, s in zip(ids, sights, strict=True)]
    poses = list(odometry(camera, side_m, frames))
    start = next((k for k, pose in enumerate(poses) if pose is not None), None)
    if start is None:
        return poses
    first = poses[start]
    assert first is not None
    world_from_own = true_pose(records[start]) @ invert(first)
    return [None if pose is None else world_from_own @ pose for pose in poses]


def distances(seen: Sight, record: dict[str, Any], camera: Camera, side_m: float, height_m: float) -> dict[str, Any]:
    """Return (n,) distances in metres: from the rounded scale, the scale, and the refined shape.

    The first two take the camera's height above the floor as known.
    """
    rows = record["detections"]
    places = np.array([row["feature_xy"] for row in rows], dtype=np.float64).reshape(-1, 2)
    by_scale = {
        name: distances_at_height(
            solid_angles(camera, places, SIDE_OF_SCALE * np.array([row[column] for row in rows])), side_m, height_m
        )
        for name, column in (("rounded", "rounded_scale_px"), ("scale", "scale_px"))
    }
    by_shape, _ = distances_of_shapes(camera, seen.xy, np.nan_to_num(seen.affinity), side_m)
    return {**by_scale, "refined": np.where(seen.refined, by_shape, np.nan)}


def identity_faults(records: Sequence[dict[str, Any]], ids: Sequence[NDArray[np.intp]]) -> tuple[int, int]:
    """Return how often a marker's track changed while it stayed in view, and how many tracks changed their marker."""
    track_of: dict[str, int] = {}
    name_of: dict[int, str] = {}
    changes = swaps = 0
    for record, of_frame in zip(records, ids, strict=True):
        in_view = {truth["name"] for truth in record["truth"]}
        track_of = {name: track for name, track in track_of.items() if name in in_view}
        for row, track in zip(record["detections"], of_frame.tolist(), strict=True):
            name = row["truth"]
            if name is None:
                continue
            changes += track_of.get(name, track) != track
            swaps += name_of.get(track, name) != name
            track_of[name], name_of[track] = track, name
    return changes, swaps
