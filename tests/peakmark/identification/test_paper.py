"""The paper's rule: the largest drop in the responses separates markers from clutter."""

import numpy as np
import pytest

from peakmark.identification.paper import above_drop


@pytest.mark.parametrize(
    ("responses", "count"), [([], 0), ([5], 1), ([9, 8, 7, 2, 1.9], 3), ([9, 8, 7, 6.5], 0), ([100, 10, 9, 8], 1)]
)
def test_the_largest_drop_separates(responses: list[float], count: int) -> None:
    assert above_drop(np.array(responses, dtype=np.float32)) == count
