"""Scoring: hand-made truth and detections whose result is known by construction."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim.camera.frame import MarkerTruth

from peakmark.identification.detection import Detection
from peakmark.identification.signature import reference_descriptor
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity
from peakmark.score.markers import Score, localisation, match, ranks_above_clutter, score_frame
from peakmark.score.wanted import READABLE
from tests.samples import some_keypoints


def truth(name: str, x: float, y: float, visible: float = 1.0) -> MarkerTruth:
    half = np.array([[-10, -10], [10, -10], [10, 10], [-10, 10]])
    center = np.array([x, y])
    return MarkerTruth(
        name=name,
        kind="surf-dark",
        center_xy=center,
        corners_xy=center + half,
        side_px=20.0,
        distance_m=2.0,
        tilt_deg=0.0,
        visible_fraction=visible,
    )


def detection(number: int, x: float, y: float, rank: int) -> Detection:
    return Detection(number, np.array([x, y]), 20.0, "dark", 100.0 / rank, 0.1, rank)


def features(*rows: tuple[float, float, float]) -> Keypoints:
    table = np.array(rows, dtype=np.float32).reshape(-1, 3)
    ones = np.ones(len(table))
    return Keypoints(table[:, :2], 20 * ones, ones, table[:, 2], ones, ones, 20 * ones)  # type: ignore[arg-type]


def test_two_markers_one_found_and_clutter_between() -> None:
    markers = [truth("a", 100, 100), truth("b", 200, 100), truth("cut", 300, 100, visible=0.4)]
    found = [detection(0, 101, 100, 1), detection(1, 400, 300, 2)]
    all_features = features((101, 100, 90), (400, 300, 60), (100.5, 101, 50), (200, 102, 45), (7, 7, 5))
    score = score_frame(markers, found, all_features)
    assert (score.markers_in_view, score.markers_found, score.missed) == (2, 1, ("b",))
    assert score.false_detections == 1
    assert score.matches == {"a": 0}
    assert (score.rank_of_last_marker, score.false_above_last_marker) == (1, 0)
    assert score.strongest_clutter == 60
    assert score.response_drop == pytest.approx(90 / 60)
    assert score.localisation_px.rms == pytest.approx(1.0)
    assert score.localisation_px.bias_xy == pytest.approx((1.0, 0.0))


def test_ranks_above_clutter_hold_what_finds_a_marker_again() -> None:
    markers = [truth("a", 100, 100), truth("b", 200, 100), truth("hidden", 300, 100, visible=0.0)]
    all_features = features((101, 100, 90), (200, 100, 60), (100.5, 101, 50), (7, 7, 45), (200, 102, 5))
    assert ranks_above_clutter(markers, all_features) == {"a": (1, 3), "b": (2,)}
    assert ranks_above_clutter(markers, all_features[:3]) == {"a": (1, 3), "b": (2,)}
    assert ranks_above_clutter(markers, features((7, 7, 45), (200, 102, 5))) == {}


def test_clutter_above_the_last_marker_is_counted_and_the_drop_falls_below_one() -> None:
    markers = [truth("a", 100, 100), truth("b", 200, 100)]
    found = [detection(0, 100, 100, 1), detection(1, 200, 100, 4)]
    score = score_frame(markers, found, features((100, 100, 90), (5, 5, 80), (9, 9, 70), (200, 100, 40)))
    assert score.rank_of_last_marker == 4
    assert score.false_above_last_marker == 2
    assert score.response_drop == pytest.approx(0.5)


def test_a_partly_visible_marker_is_neither_required_nor_wrong() -> None:
    score = score_frame([truth("cut", 50, 50, 0.5)], [detection(0, 50, 51, 1)], features((50, 51, 10)))
    assert (score.markers_in_view, score.markers_found, score.false_detections) == (0, 0, 0)
    assert score.matches == {"cut": 0}


def test_nothing_in_view_and_nothing_found_gives_none_not_nan() -> None:
    score = score_frame([], [], features())
    assert score.response_drop is None
    assert score.localisation_px == localisation(np.zeros((0, 2)))
    assert score.rank_of_last_marker is None


def test_matching_is_one_to_one_and_takes_the_nearest_pairs() -> None:
    markers = [truth("a", 100, 100), truth("b", 102, 100)]
    assert match(markers, [detection(0, 101.5, 100, 1)], 3.0) == {"b": 0}
    assert match(markers, [detection(0, 101.5, 100, 1), detection(1, 102.1, 100, 2)], 3.0) == {"b": 1, "a": 0}


@pytest.mark.parametrize(("offset", "found"), [(2.99, 1), (3.01, 0)])
def test_the_tolerance_is_three_pixels(offset: float, found: int) -> None:
    score = score_frame([truth("a", 100, 100)], [detection(0, 100 + offset, 100, 1)], features((100, 100, 5)))
    assert score.markers_found == found


def test_bias_and_rms_of_known_errors() -> None:
    summary = localisation(np.array([[3.0, 4.0], [3.0, 4.0], [-3.0, 4.0], [-3.0, 4.0]]))
    assert summary.bias == pytest.approx(4.0)
    assert summary.rms == pytest.approx(5.0)
    assert summary.p95 == pytest.approx(5.0)


def readable(
    markers: list[MarkerTruth],
    *positions: tuple[float, float],
    polarity: Polarity = "dark",
    signature: Polarity = "dark",
) -> Score:
    """Score detections of a polarity, whose key points have the signature of one, by what must be readable."""
    points = some_keypoints(max(len(positions), 1), 64)
    descriptors = np.tile(reference_descriptor(signature, is_on_paper=True), (len(points), 1))
    found = [replace(detection(k, x, y, k + 1), polarity=polarity) for k, (x, y) in enumerate(positions)]
    return score_frame(markers, found, replace(points, descriptors=descriptors), READABLE)


def test_found_missed_and_false() -> None:
    markers = [truth("a", 100, 100), truth("b", 200, 100), truth("cut", 300, 100, 0.5)]
    score = readable(markers, (101, 100), (9, 9))
    assert (score.markers_in_view, score.markers_found, score.missed, score.false_detections) == (2, 1, ("b",), 1)
    assert [m.is_in_view for m in score.markers] == [True, True, False]
    assert score.markers[0].error_px == pytest.approx(1.0)
    assert score.markers[1].error_px is None
    assert (score.polarity_errors, score.signature_errors) == (0, 0)


def test_polarity_by_laplacian_and_by_signature_are_counted_apart() -> None:
    wrong_sign = readable([truth("a", 100, 100)], (100, 100), polarity="light")
    assert (wrong_sign.polarity_errors, wrong_sign.signature_errors) == (1, 0)
    wrong_signature = readable([truth("a", 100, 100)], (100, 100), signature="light")
    assert (wrong_signature.polarity_errors, wrong_signature.signature_errors) == (0, 1)
    light = replace(truth("a", 100, 100), kind="surf-light")
    right = readable([light], (100, 100), polarity="light", signature="light")
    assert (right.polarity_errors, right.signature_errors) == (0, 0)


@pytest.mark.parametrize(
    ("change", "wanted"),
    [({}, True), ({"side_px": 19.9}, False), ({"tilt_deg": 45.1}, False), ({"visible_fraction": 0.94}, False)],
)
def test_what_must_be_found(change: dict[str, float], wanted: bool) -> None:
    marker = replace(truth("a", 100, 100), **change)  # type: ignore[arg-type]
    assert READABLE.includes(marker) == wanted
    score = readable([marker], (100, 100), polarity="light")
    assert score.polarity_errors == wanted
    assert score.false_detections == 0
