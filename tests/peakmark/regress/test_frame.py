"""Scoring one frame: what was wanted, found and wrongly found; written and read back alike."""

import json
from dataclasses import asdict

import numpy as np
import pytest
from peaksim.camera.frame import MarkerTruth
from pydantic import TypeAdapter

from peakmark.identification.detection import Detection
from peakmark.keypoints.keypoints import Keypoints
from peakmark.regress.detector_protocol import Found
from peakmark.regress.frame import ScoredFrame, score_answer, score_failure, strongest_at_markers
from peakmark.score.wanted import Wanted

WANTED = Wanted(min_side_px=14.0, kinds=("surf",))
TOLERANCE_PX = 3.0


def truth(name: str, x: float, kind: str = "surf-dark", side: float = 20.0, visible: float = 1.0) -> MarkerTruth:
    center = np.array([x, 50.0])
    corners = center + side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return MarkerTruth(name, kind, center, corners, side, 1.0, 0.0, visible)


def detection(x: float, polarity: str | None = "dark", response: float = 900.0) -> Detection:
    return Detection(0, np.array([x, 50.0]), 20.0, polarity, response, 0.1, 1)  # type: ignore[arg-type]


def features(*rows: tuple[float, float, int]) -> Keypoints:
    """Return key points of (x, response, laplacian) at y = 50, strongest first."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    ones = np.ones(len(table), np.float32)
    xy = np.stack([table[:, 0], 50.0 * ones], axis=1).astype(np.float32)
    return Keypoints(xy, 20 * ones, ones, table[:, 1].astype(np.float32), ones, table[:, 2].astype(np.int8), ones)  # type: ignore[arg-type]


SCENE = (
    truth("near", 100),
    truth("light", 200, "surf-light"),
    truth("small", 300, side=10),
    truth("cut", 400, visible=0.5),
    truth("other", 500, "aruco"),
)


def test_what_is_large_visible_and_of_the_kinds_is_wanted() -> None:
    result = score_answer(3, "abc", SCENE, Found(Keypoints.empty(), ()), WANTED, TOLERANCE_PX)
    assert (result.frame, result.picture, list(result.markers)) == (3, "abc", ["near", "light"])
    assert all(m.xy is None and m.polarity_is_right is None for m in result.markers.values())
    assert result.markers["near"].true_xy == (100.0, 50.0)
    assert result.false_xy == ()


def test_found_wrong_and_false_are_told_apart() -> None:
    detections = (detection(101), detection(199, "dark"), detection(300), detection(400), detection(77))
    result = score_answer(0, "", SCENE, Found(Keypoints.empty(), detections), WANTED, TOLERANCE_PX)
    assert result.markers["near"].xy == (101.0, 50.0)
    assert result.markers["near"].polarity_is_right is True
    assert result.markers["light"].polarity_is_right is False
    assert result.false_xy == ((77.0, 50.0),)  # small and cut ones need not be found, and are no false ones


def test_a_detector_that_does_not_identify_is_scored_by_its_strongest_point_at_the_centre() -> None:
    kp = features((250, 900, 1), (102, 800, 1), (100, 700, -1), (201, 600, -1))
    result = score_answer(0, "", SCENE, Found(kp, None), WANTED, TOLERANCE_PX)
    assert result.markers["near"].xy == (102.0, 50.0)
    assert result.markers["light"].polarity_is_right is True
    assert result.false_xy is None
    assert result.features == 4
    assert [d.rank for d in strongest_at_markers(SCENE[:2], kp, 3.0)] == [2, 4]


def test_a_detector_that_tells_no_polarity_is_not_charged_with_a_wrong_one() -> None:
    for found in (
        Found(features((100, 800, 0), (200, 700, 0)), None),
        Found(Keypoints.empty(), (detection(100, None), detection(200, None))),
    ):
        result = score_answer(0, "", SCENE, found, WANTED, TOLERANCE_PX)
        assert [(m.xy is not None, m.polarity_is_right) for m in result.markers.values()] == [(True, None)] * 2


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("responses", [(0.0, 0.0), (5.0, 0.0), (3e38, 1e-38), (0.0, 5.0)])
def test_a_drop_that_is_no_number_is_none(responses: tuple[float, float]) -> None:
    at_marker, clutter = responses
    kp = features(*sorted([(100, at_marker, 1), (300.5, clutter, 1)], key=lambda row: -row[1]))
    drop = score_answer(0, "", SCENE[:1], Found(kp, None), WANTED, TOLERANCE_PX).drop
    assert drop == (0.0 if clutter == 5 else None)


def test_a_failure_misses_every_marker() -> None:
    result = score_failure(0, "", SCENE, "crash: it ended with status 7", WANTED)
    assert [m.xy for m in result.markers.values()] == [None, None]
    assert result.failure == "crash: it ended with status 7"


@pytest.mark.parametrize("found", [Found(features((100, 800, 1)), None), Found(Keypoints.empty(), (detection(100),))])
def test_results_are_read_back_as_they_were(found: Found) -> None:
    result = score_answer(0, "", SCENE, found, WANTED, TOLERANCE_PX)
    again = TypeAdapter(ScoredFrame).validate_python(json.loads(json.dumps(asdict(result))))
    assert again == result
    assert isinstance(again, ScoredFrame)
