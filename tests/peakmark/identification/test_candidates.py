"""Candidates found again are left out as a look at all pairs would."""

import numpy as np
import pytest

from peakmark.identification.candidates import _LIKE, _NEAR, _distinct


@pytest.mark.parametrize(("count", "height", "width"), [(0, 5, 5), (1, 1, 1), (900, 90, 120), (400, 3, 4000)])
def test_distinct_rows_are_those_of_a_look_at_all_pairs(count: int, height: int, width: int) -> None:
    rng = np.random.default_rng(count)
    xy, scales = rng.uniform(-0.5, [width - 0.5, height - 0.5], (count, 2)), 10 * np.exp(rng.uniform(0, 2, count))
    signs = rng.choice([-1.0, 1.0], count)
    expected: list[int] = []
    for i in range(count):
        near = [np.hypot(*(xy[k] - xy[i])) < _NEAR * min(scales[k], scales[i]) for k in expected]
        like = [1 / _LIKE < scales[k] / scales[i] < _LIKE and signs[k] == signs[i] for k in expected]
        if not (np.array(near, bool) & np.array(like, bool)).any():
            expected.append(i)
    rows = np.column_stack([xy, scales, np.ones(count), signs, np.ones(count)])
    assert _distinct(rows, (height, width)).tolist() == expected
