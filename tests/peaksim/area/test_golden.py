"""The kernels draw what their predecessors drew: those in Python, compiled by Numba, which made the golden file."""

import numpy as np
import pytest

from tests.peaksim.area.golden_views import GOLDEN, VIEWS

ROUNDING = 1e-3
"""Grey levels: sums of terms of up to 10¹⁰ are added in another order."""


@pytest.mark.parametrize("name", VIEWS)
def test_levels_are_those_of_the_golden_file(name: str) -> None:
    with np.load(GOLDEN / "area.npz") as golden:
        assert np.abs(VIEWS[name]() - golden[name]).max() < ROUNDING


def test_the_golden_file_holds_all_views() -> None:
    with np.load(GOLDEN / "area.npz") as golden:
        assert set(golden) == set(VIEWS)
