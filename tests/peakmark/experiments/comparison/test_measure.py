"""Scores: what is right, wrong, cut or alike; poses of tags and of arrays; whether a covariance is honest."""

import numpy as np
import pytest
from peaksim.geometry.pose import invert, pose_distance, transform

from peakmark.experiments.comparison.boards import CAMERA, Print, TruePrint, random_pose
from peakmark.experiments.comparison.measure import CHI2_95, false_answers, map_of, normalised_error, solved
from peakmark.experiments.comparison.prints import Design
from peakmark.experiments.comparison.readers import READERS, Seen
from peakmark.localise.pose import moved

READER = {reader.name: reader for reader in READERS}
AT = np.array([100.0, 100.0])


def truth(design: str, code: int = 1, is_whole: bool = True) -> TruePrint:
    return TruePrint(design, code, (100.0, 100.0), 40.0, 0.0, is_whole)


@pytest.mark.parametrize(
    ("reader", "seen", "there", "false"),
    [
        ("AprilTag-C", Seen(1, AT), [truth("AprilTag 36h11")], 0),
        ("AprilTag-C", Seen(2, AT), [truth("AprilTag 36h11")], 1),
        ("AprilTag-C", Seen(2, AT), [truth("AprilTag 36h11", is_whole=False)], 0),
        ("AprilTag-C", Seen(1, AT + 40), [truth("AprilTag 36h11")], 1),
        ("AprilTag-C", Seen(1, AT), [truth("ring")], 1),
        ("AprilTag-C", Seen(1, AT), [], 1),
        ("identify", Seen(0, AT), [truth("array")], 0),
        ("identify", Seen(0, AT), [truth("marker")], 1),
        ("decode_arrays", Seen(4, AT), [truth("marker")], 1),
        ("chess-corners", Seen(None, AT), [truth("ring")], 0),
        ("chess-corners", Seen(None, AT), [], 1),
    ],
)
def test_false_answers(reader: str, seen: Seen, there: list[TruePrint], false: int) -> None:
    assert false_answers(READER[reader], [seen], there) == false


def prints(design: Design) -> list[Print]:
    return [Print(design, k, 0.1 * k - 0.1, 0.05 * k, 40.0 * k) for k in range(3)]


def test_tags_give_the_pose_and_a_wrong_number_does_not_move_it() -> None:
    pose = random_pose(48, 40, np.random.default_rng(0))
    board = prints("AprilTag 36h11")
    corners = [CAMERA.project(transform(invert(pose), one.corners_m)) for one in board]
    seen = [Seen(one.code, xy.mean(axis=0), xy) for one, xy in zip(board, corners, strict=True)]
    for answers in (seen, [*seen, Seen(0, AT, corners[2] + 50), Seen(99, AT, corners[0])]):
        found = solved(answers, {one.code: one for one in board}, CAMERA)
        assert found is not None
        assert pose_distance(found, pose)[1] < 0.01
    assert solved(seen[:0], {}, CAMERA) is None
    centers = [Seen(one.code, one.middles_m[0, :2]) for one in board]
    assert solved(centers, {one.code: one for one in board}, CAMERA) is None


def test_maps_have_the_prints_markers_where_they_hang() -> None:
    arrays = map_of(READER["decode_arrays"], prints("array"))
    assert len(arrays) == 9
    assert sorted(arrays.places) == [0, 1, 2]
    markers = map_of(READER["identify"], prints("marker"))
    assert markers.polarities == ("dark", "light", "light")
    assert markers.centers_m == pytest.approx(np.array([one.middles_m[0] for one in prints("marker")]))


def test_an_honest_covariance_holds_the_truth_in_95_of_100() -> None:
    rng, pose = np.random.default_rng(0), random_pose(48, 30, np.random.default_rng(1))
    shape = rng.normal(size=(6, 6)) * 1e-3
    covariance = shape @ shape.T
    steps = rng.multivariate_normal(np.zeros(6), covariance, 2000)
    errors = np.array([normalised_error(moved(pose, step), covariance, pose) for step in steps])
    assert (errors <= CHI2_95).mean() == pytest.approx(0.95, abs=0.015)
    assert errors.mean() == pytest.approx(6, rel=0.1)
