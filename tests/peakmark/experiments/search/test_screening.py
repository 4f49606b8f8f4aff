"""What the screen's training counts: markers, not alignments, and those found another way are not lost."""

import numpy as np
from peaksim.camera.frame import MarkerTruth

from peakmark.experiments.search.screening import LOST, Screened, choose_limit
from peakmark.experiments.search.training import marker_of


def screened(found: list[bool], markers: list[int]) -> Screened:
    n = len(found)
    is_found = np.array(found)
    return Screened(np.zeros((n, 0)), is_found, ~is_found, np.zeros(n, np.int64), np.array(markers))


def test_the_limit_loses_as_many_markers_as_it_may() -> None:
    n = 4000
    sums = np.arange(2.0 * n)
    # every marker has two alignments, of which the one that is less likely does not matter
    limit = choose_limit(sums, screened([True] * 2 * n, [k // 2 for k in range(2 * n)]))
    assert (sums[1::2] < limit).sum() == int(LOST * n)


def test_without_any_marker_nothing_is_stopped() -> None:
    assert choose_limit(np.array([1.0]), screened([False], [-1])) == -np.inf


def test_alignments_belong_to_the_nearest_marker_in_sides() -> None:
    def marker(x: float, side: float, visible: float = 1.0) -> MarkerTruth:
        center = np.array([x, 50.0])
        return MarkerTruth("m", "surf-dark", center, np.zeros((4, 2)), side, 1.0, 0.0, visible)

    truth = [marker(0, 100), marker(60, 10), marker(45, 90, 0.0)]
    assert marker_of(np.array([40.0, 50.0]), truth) == 0
    assert marker_of(np.array([58.0, 50.0]), truth) == 1
    assert marker_of(np.array([40.0, 50.0]), []) == -1
