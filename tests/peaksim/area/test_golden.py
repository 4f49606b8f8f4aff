"""The kernels draw what their predecessors drew: those in Python, compiled by Numba, which made the golden file."""

import numpy as np
import pytest

from tests.peaksim.area.golden_views import GOLDEN, VIEWS


@pytest.mark.parametrize("name", VIEWS)
def test_levels_are_those_of_the_golden_file(name: str) -> None:
    with np.load(GOLDEN / "area.npz") as golden:
        assert np.array_equal(VIEWS[name](), golden[name])


def test_the_golden_file_holds_all_views() -> None:
    with np.load(GOLDEN / "area.npz") as golden:
        assert set(golden) == set(VIEWS)
