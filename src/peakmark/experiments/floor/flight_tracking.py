"""What follows from a flight's records in their order: tracks, the camera's poses, and the errors of these."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, invert

from peakmark.experiments.floor.flight_records import DetectionColumns, FrameRecord, columns
from peakmark.identification.detection import SIDE_OF_SCALE
from peakmark.identification.stretch import Stretch
from peakmark.localise.distance import distances_at_height, distances_of_shapes, solid_angles
from peakmark.localise.locate import FloorMap, Located, locate
from peakmark.localise.odometry import odometry
from peakmark.localise.tracks import Tracks, follow
from peakmark.score.poses import is_wrong, pose_error
from peakmark.score.wanted import SMALLEST_PX, Wanted

DISTANCES = ("rounded", "scale", "refined")
"""What a distance is computed from: the rounded scale, the scale, and the refined shape."""


@dataclass(frozen=True)
class FlownFrame:
    """A frame's record, and what the frames before it add."""

    record: FrameRecord
    track_ids: NDArray[np.intp]
    """(n,) of the detections."""
    located: Located | None
    """The pose in the map, None where it is not certain."""
    is_tracked: bool
    """Whether the pose before was needed to be certain."""
    motion_pose: Pose | None
    """The pose without a map, in the true world of the first frame that has one; None where lost."""

    @property
    def map_pose(self) -> Pose | None:
        """The pose in the map, None where it is not certain."""
        return None if self.located is None else self.located.world_from_camera

    @property
    def map_error(self) -> tuple[float, float] | None:
        """Of `map_pose`, mm and degrees."""
        return pose_error(self.map_pose, self.record.world_from_camera)

    @property
    def motion_error(self) -> tuple[float, float] | None:
        """Of `motion_pose`, mm and degrees."""
        return pose_error(self.motion_pose, self.record.world_from_camera)

    @property
    def is_wrong(self) -> bool:
        """Whether the pose in the map was accepted and is a flip or on another part of the map."""
        return is_wrong(self.map_error)


@dataclass(frozen=True)
class Flown:
    """A finished flight: all that its figures come from."""

    name: str
    """Of the flight among others."""
    camera: Camera
    stretch: Stretch
    """Vertical, before detection."""
    times_s: NDArray[np.float64]
    """(n,) of the frames."""
    floor_map: FloorMap | None
    """None where the markers are not on one level floor: no distances, no poses."""
    frames: list[FlownFrame]

    @property
    def records(self) -> list[FrameRecord]:
        """Of all frames."""
        return [frame.record for frame in self.frames]

    @property
    def wanted(self) -> Wanted:
        """Markers that must be found: fully in view, and large enough after stretching."""
        return Wanted(min_side_px=SMALLEST_PX, stretch=self.stretch)

    @property
    def heights_m(self) -> NDArray[np.float64]:
        """(n,) of the camera above the markers; above the world's origin where they are not on one floor."""
        floor_m = 0.0 if self.floor_map is None else self.floor_map.centers_m[0, 2]
        return np.array([record.world_from_camera[2, 3] - floor_m for record in self.records])

    @property
    def trajectories(self) -> dict[str, list[Pose | None]]:
        """The camera's poses by name: "truth", "map" (found with it) and "motion" (without a map)."""
        return {
            "truth": [record.world_from_camera for record in self.records],
            "map": [frame.map_pose for frame in self.frames],
            "motion": [frame.motion_pose for frame in self.frames],
        }


def track_frames(records: Sequence[FrameRecord], camera: Camera, floor_map: FloorMap | None) -> list[FlownFrame]:
    """Return the frames of a flight, from all records in order, with their tracks, and on a map also their poses."""
    detections = [columns(record) for record in records]
    ids = track_ids(detections)
    located = locations(detections, camera, floor_map) if floor_map else [(None, False)] * len(records)
    moved = motion(records, detections, ids, camera, floor_map.side_m) if floor_map else [None] * len(records)
    return [
        FlownFrame(record, of_frame, pose, is_tracked, motion_pose)
        for record, of_frame, (pose, is_tracked), motion_pose in zip(records, ids, located, moved, strict=True)
    ]


def track_ids(detections: Sequence[DetectionColumns]) -> list[NDArray[np.intp]]:
    """Return each frame's (n,) track ids."""
    tracks, ids = Tracks(), []
    for rows in detections:
        tracks, of_frame = follow(tracks, rows.xy, rows.side_px)
        ids.append(of_frame)
    return ids


def locations(
    detections: Sequence[DetectionColumns], camera: Camera, floor_map: FloorMap
) -> list[tuple[Located | None, bool]]:
    """Return each frame's pose in the map, by itself where that is certain, else near the pose before.

    The second value says whether the pose before was needed.
    """
    before: Pose | None = None
    found: list[tuple[Located | None, bool]] = []
    for rows in detections:
        xy, affinity = rows.xy[rows.refined], rows.affinity[rows.refined]
        alone = locate(camera, floor_map, xy, affinity)
        near = None if alone or before is None else locate(camera, floor_map, xy, affinity, near=before)
        located = alone or near
        before = None if located is None else located.world_from_camera
        found.append((located, near is not None))
    return found


def motion(
    records: Sequence[FrameRecord],
    detections: Sequence[DetectionColumns],
    ids: Sequence[NDArray[np.intp]],
    camera: Camera,
    side_m: float,
) -> list[Pose | None]:
    """Return each frame's pose without a map; the first that has one is put where it truly is."""
    frames = [(i[d.refined], d.xy[d.refined], d.affinity[d.refined]) for i, d in zip(ids, detections, strict=True)]
    poses = list(odometry(camera, side_m, frames))
    start = next(((k, pose) for k, pose in enumerate(poses) if pose is not None), None)
    if start is None:
        return poses
    index, first = start
    world_from_own = records[index].world_from_camera @ invert(first)
    return [None if pose is None else world_from_own @ pose for pose in poses]


def distances(
    record: FrameRecord, camera: Camera, floor_map: FloorMap | None, height_m: float
) -> dict[str, NDArray[np.float64]]:
    """Return the (n,) distances of the detections by each of `DISTANCES`, metres; nan where not known.

    The first two take the camera's height above the floor as known.
    """
    if floor_map is None:
        return {name: np.full(len(record.detections), np.nan) for name in DISTANCES}
    xy = np.array([row.feature_xy for row in record.detections]).reshape(-1, 2)
    by_scale = [
        distances_at_height(solid_angles(camera, xy, SIDE_OF_SCALE * np.array(scales)), floor_map.side_m, height_m)
        for scales in ([row.rounded_scale_px for row in record.detections], [row.scale_px for row in record.detections])
    ]
    rows = columns(record)
    by_shape, _ = distances_of_shapes(camera, rows.xy, np.nan_to_num(rows.affinity), floor_map.side_m)
    return dict(zip(DISTANCES, (*by_scale, np.where(rows.refined, by_shape, np.nan)), strict=True))


def true_distances(record: FrameRecord) -> NDArray[np.float64]:
    """Return the (n,) true distances of the detected markers, metres; nan for false detections."""
    true = {truth.name: truth.distance_m for truth in record.truth}
    return np.array([true.get(row.marker or "", np.nan) for row in record.detections], dtype=np.float64)


def identity_faults(records: Sequence[FrameRecord], ids: Sequence[NDArray[np.intp]]) -> tuple[int, int]:
    """Return how often a marker's track changed while it stayed in view, and how many tracks changed their marker."""
    track_of: dict[str, int] = {}
    name_of: dict[int, str] = {}
    changes = swaps = 0
    for record, of_frame in zip(records, ids, strict=True):
        track_of = {name: track for name, track in track_of.items() if name in record.truth_of}
        for row, track in zip(record.detections, of_frame.tolist(), strict=True):
            if row.marker is None:
                continue
            changes += track_of.get(row.marker, track) != track
            swaps += name_of.get(track, row.marker) != row.marker
            track_of[row.marker], name_of[track] = track, row.marker
    return changes, swaps
