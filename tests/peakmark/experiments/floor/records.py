"""Records of frames as they might have been: markers in view and detections, without rendering any."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.experiments.floor.flight_records import DetectionRecord, FrameRecord
from peakmark.identification.detection import Detection
from peakmark.score.markers import Localisation, ScoreSummary


def truth_record(name: str, side_px: float = 50.0, tilt_deg: float = 0.0, distance_m: float = 1.0) -> MarkerTruth:
    """Return a marker that is wholly in view; its name's first letter says where."""
    return MarkerTruth(name, "surf-dark", _position(name), np.zeros((4, 2)), side_px, distance_m, tilt_deg, 1.0)


def detection_record(marker: str | None, off_px: float = 0.0) -> DetectionRecord:
    """Return a detection that is so far off its marker, or a false one."""
    xy = _position(marker or "!") + np.array([0.0, off_px])
    return DetectionRecord(Detection(0, xy, 50.0, "dark", 10.0, 0.1, 1), xy, 46.0, 46.0, marker)


def _position(name: str) -> NDArray[np.float64]:
    return np.array([100.0 * (ord(name[0]) - ord("a")), 10.0])


def frame_record(
    truth: Sequence[MarkerTruth | str],
    detections: Sequence[DetectionRecord | str],
    response_drop: float | None = None,
    strongest_clutter: float | None = None,
) -> FrameRecord:
    """Return a frame's record; a name stands for a marker in full view, or for its detection."""
    markers = tuple(truth_record(t) if isinstance(t, str) else t for t in truth)
    rows = tuple(detection_record(d) if isinstance(d, str) else d for d in detections)
    false = sum(row.marker is None for row in rows)
    nothing = Localisation(None, None, None, None)
    score = ScoreSummary(len(markers), 0, (), false, nothing, None, None, strongest_clutter, response_drop)
    return FrameRecord(0, 0.0, "exact", None, np.eye(4), 0, score, {"render": 0.1, "detect": 0.1}, markers, rows)
