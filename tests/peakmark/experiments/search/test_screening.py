"""What the screen's training counts: markers, not alignments, and those found another way are not lost."""

import numpy as np
import pytest
from peaksim.camera.frame import MarkerTruth

from peakmark.experiments.search.screening import LOST, Screened, choose_limit, train
from peakmark.experiments.search.training import SearchTrainingConfig, marker_of
from peakmark.identification.screening import SCREEN_COLUMNS
from peakmark.identification.stages import STAGE_COLUMNS, STAGES


def screened(found: list[bool], markers: list[int]) -> Screened:
    n = len(found)
    is_found = np.array(found)
    said = np.zeros((n, len(STAGES), len(STAGE_COLUMNS)))
    return Screened(np.zeros((n, 0)), said, is_found, ~is_found, np.zeros(n, np.int64), np.array(markers))


def test_the_limit_loses_as_many_markers_as_it_may() -> None:
    n = 4000
    sums = np.arange(2.0 * n)
    # every marker has two alignments, of which the one that is less likely does not matter
    candidates = screened([True] * 2 * n, [k // 2 for k in range(2 * n)])
    limit = choose_limit(sums, np.ones(2 * n, np.bool_), candidates, 0.003)
    assert (sums[1::2] < limit).sum() == int(0.003 * n)
    # those that did not come so far are not lost here
    limit = choose_limit(sums, sums >= 2000, candidates, 0.003)
    assert ((sums[1::2] < limit) & (sums[1::2] >= 2000)).sum() == int(0.003 * (n - 1000))


def test_without_any_marker_nothing_is_stopped() -> None:
    assert choose_limit(np.array([1.0]), np.array([True]), screened([False], [-1]), 0.003) == -np.inf


def test_each_gate_learns_from_what_the_stage_before_it_said() -> None:
    rng, n = np.random.default_rng(0), 1000
    found = np.arange(n) % 2 == 0
    looks = rng.normal(size=(n, len(SCREEN_COLUMNS)))
    said = rng.normal(size=(n, len(STAGES), len(STAGE_COLUMNS)))
    said[:, 1, 0] += 6 * found  # only the second stage tells markers from the rest
    said[::3, 2] = np.nan  # and not all are looked at in parts
    images = np.arange(n) // 10
    plain = train(Screened(looks, said, found, ~found, images, np.arange(n)), SearchTrainingConfig())
    before, soft, sharp, parts = plain["gates"]
    assert [gate["lost"] for gate in plain["gates"]] == list(LOST)
    assert before["clutter"] == n // 2
    assert max(before["stopped"], soft["stopped"]) < 0.1
    assert sharp["stopped"] > 0.9
    assert plain["stopped"] >= sharp["stopped"] * 0.9
    assert parts["clutter"] == pytest.approx(2 / 3 * (1 - plain["stopped"]) * n / 2, abs=25)


def test_alignments_belong_to_the_nearest_marker_in_sides() -> None:
    def marker(x: float, side: float, visible: float = 1.0) -> MarkerTruth:
        center = np.array([x, 50.0])
        return MarkerTruth("m", "surf-dark", center, np.zeros((4, 2)), side, 1.0, 0.0, visible)

    truth = [marker(0, 100), marker(60, 10), marker(45, 90, 0.0)]
    assert marker_of(np.array([40.0, 50.0]), truth) == 0
    assert marker_of(np.array([58.0, 50.0]), truth) == 1
    assert marker_of(np.array([40.0, 50.0]), []) == -1
