"""Non-maximum suppression against a plain loop, and what its parameters mean."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from peakmark.identification.suppression import APART, suppress_non_maxima


def test_the_better_of_two_that_overlap_is_kept() -> None:
    xy, sides = np.array([[0, 0], [10, 0], [40, 0.0]]), np.full(3, 20.0)
    assert suppress_non_maxima(xy, sides, np.array([0.5, 0.9, 0.1])).tolist() == [1, 2]
    assert suppress_non_maxima(xy[:0], sides[:0], sides[:0]).tolist() == []


def test_of_equals_the_first_is_kept() -> None:
    assert suppress_non_maxima(np.zeros((3, 2)), np.full(3, 9.0), np.ones(3)).tolist() == [0]


@given(
    st.integers(0, 60), st.floats(5, 200), st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([1.2, 1.6, np.inf])
)
def test_it_keeps_what_a_plain_loop_keeps(
    count: int, extent: float, seed: int, by_larger: bool, like_size: float
) -> None:
    rng = np.random.default_rng(seed)
    xy, sides, worth = rng.uniform(0, extent, (count, 2)), rng.uniform(2, 40, count), rng.integers(0, 9, count)
    kept: list[int] = []
    for i in np.argsort(-worth, kind="stable"):
        gaps = np.linalg.norm(xy[kept] - xy[i], axis=1)
        reach = APART * (np.maximum(sides[kept], sides[i]) if by_larger else sides[kept])
        alike = np.abs(np.log(sides[kept] / sides[i])) <= np.log(like_size)
        if not (alike & (gaps <= reach)).any():
            kept.append(int(i))
    found = suppress_non_maxima(xy, sides, worth.astype(np.float64), by_larger=by_larger, like_size=like_size)
    assert found.tolist() == kept
