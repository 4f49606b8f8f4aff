"""What a flight keeps of each frame: the truth of the markers in view, and the detections."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth
from peaksim.geometry.pose import Pose

from peakmark.experiments.floor.view import FloorView
from peakmark.identification.detection import Detection
from peakmark.keypoints.keypoints import Keypoints
from peakmark.score.markers import ScoreSummary


@dataclass(frozen=True)
class DetectionRecord:
    """A detection, the feature that it comes from, and the marker that it truly is."""

    detection: Detection
    feature_xy: NDArray[np.float64]
    """(2,) centre of the feature, px."""
    scale_px: float
    rounded_scale_px: float
    """Of the feature, interpolated and as SURF gives it."""
    marker: str | None
    """Name of the marker that it is; None for a false detection."""


@dataclass(frozen=True)
class FrameRecord:
    """A frame of a flight."""

    frame: int
    time_on_path_s: float
    """Frame number from 0, and when it was taken."""
    renderer: str
    gl_renderer: str | None
    """"exact" or "gl", and what OpenGL calls itself; None for the exact renderer."""
    world_from_camera: Pose
    """(4, 4) true pose."""
    features: int
    score: ScoreSummary
    """Number of key points, and the frame against truth."""
    time_s: dict[str, float]
    """Seconds of each stage."""
    truth: tuple[MarkerTruth, ...]
    """Of the markers that are in view at least in part."""
    detections: tuple[DetectionRecord, ...]
    """Strongest first."""

    @cached_property
    def detection_of(self) -> dict[str, Detection]:
        """Name of a found marker → its detection."""
        return {row.marker: row.detection for row in self.detections if row.marker is not None}

    @cached_property
    def truth_of(self) -> dict[str, MarkerTruth]:
        """Name of a marker in view → its truth."""
        return {truth.name: truth for truth in self.truth}


@dataclass(frozen=True)
class DetectionColumns:
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


def record_of(view: FloorView) -> FrameRecord:
    """Return what is kept of a frame."""
    names = {index: name for name, index in view.score.matches.items()}
    return FrameRecord(
        frame=view.index,
        time_on_path_s=view.frame.time_s,
        renderer=view.frame.renderer,
        gl_renderer=view.frame.gl_renderer,
        world_from_camera=view.frame.world_from_camera,
        features=len(view.found.features),
        score=view.score.summary(),
        time_s=view.time_s,
        truth=tuple(truth for truth in view.frame.truth if truth.visible_fraction > 0),
        detections=tuple(_detection_record(d, view.found.features, names.get(d.id)) for d in view.found.detections),
    )


def _detection_record(detection: Detection, features: Keypoints, marker: str | None) -> DetectionRecord:
    row = detection.rank - 1
    xy, scale, size = features.xy[row].astype(np.float64), float(features.scale[row]), float(features.size[row])
    return DetectionRecord(detection, xy, scale, size, marker)


def columns(record: FrameRecord) -> DetectionColumns:
    """Return a record's detections as columns."""
    rows = [row.detection for row in record.detections]
    shapes = [np.full((2, 2), np.nan) if row.affinity is None else row.affinity for row in rows]
    return DetectionColumns(
        np.array([row.xy for row in rows], dtype=np.float64).reshape(-1, 2),
        np.array(shapes, dtype=np.float64).reshape(-1, 2, 2),
        np.array([row.size for row in rows], dtype=np.float64),
    )
