"""Frames in their order: changed and swapped tracks, and distances where no map gives any."""

import numpy as np

from peakmark.experiments.floor.flight_tracking import distances, identity_faults, track_frames, true_distances
from tests.floor_views import CAMERA
from tests.peakmark.experiments.floor.records import detection_record, frame_record, truth_record


def test_identity_faults_count_changes_and_swaps() -> None:
    both, alone = frame_record("ab", "ab"), frame_record("b", "b")
    frames = [both, both, alone]
    assert identity_faults(frames, [np.array([0, 1]), np.array([0, 1]), np.array([1])]) == (0, 0)
    assert identity_faults(frames, [np.array([0, 1]), np.array([1, 0]), np.array([0])]) == (2, 2)
    gone = [frame_record("a", "a"), frame_record("", ""), frame_record("a", "a")]
    assert identity_faults(gone, [np.array([0]), np.array([]), np.array([5])]) == (0, 0)


def test_a_false_detection_has_no_true_distance() -> None:
    record = frame_record([truth_record("a", distance_m=2.5)], [detection_record(None), detection_record("a")])
    assert np.array_equal(true_distances(record), [np.nan, 2.5], equal_nan=True)


def test_without_a_map_there_are_tracks_and_nothing_else() -> None:
    record = frame_record("a", "a")
    first, second = track_frames([record, record], CAMERA, None)
    assert first.track_ids.tolist() == second.track_ids.tolist() == [0]
    assert (second.map_pose, second.map_error, second.motion_error, second.is_wrong) == (None, None, None, False)
    assert all(np.isnan(values).all() for values in distances(record, CAMERA, None, 1.0).values())
