"""Arrangements: the true one is found among rotated, shifted, disturbed and incomplete copies of the map."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.localise.match import MOST_HYPOTHESES, arrangements, rotated
from tests.floor_views import winding_map


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), angle=st.floats(-3, 3), foreign=st.integers(0, 3))
def test_the_true_arrangement_comes_first(seed: int, angle: float, foreign: int) -> None:
    rng = np.random.default_rng(seed)
    positions = winding_map(rng, bend=0.3).centers_m[:, :2]
    shift = rng.uniform(-5, 5, 2)
    chosen = rng.permutation(np.arange(10, 20))[:8]
    seen = rotated(positions[chosen] - shift, -angle) + rng.normal(0, 0.005, (8, 2))
    strangers = rng.uniform(-5, 5, (foreign, 2))
    found = arrangements(np.concatenate([seen, strangers]), np.full(8 + foreign, 0.03), positions)
    assert len(found) <= MOST_HYPOTHESES
    best = found[0]
    assert best.count >= 8
    assert np.allclose(rotated(seen, best.rotation_rad) + best.shift_m, positions[chosen], atol=0.03)


def test_an_even_row_fits_one_step_on_as_well() -> None:
    row = np.column_stack([np.zeros(10), 0.3 * np.arange(10)])
    found = arrangements(row[:5], np.full(5, 0.02), row)
    assert sum(a.count == 5 for a in found) >= 6


def test_nothing_in_common_gives_no_arrangement() -> None:
    assert arrangements(np.array([[0, 0], [100.0, 0]]), np.full(2, 0.01), np.array([[0, 0], [1.0, 0]])) == []
    assert arrangements(np.empty((0, 2)), np.empty(0), np.array([[0, 0], [1.0, 0]])) == []
    assert arrangements(np.zeros((1, 2)), np.ones(1), np.array([[0, 0], [1.0, 0]])) == []
