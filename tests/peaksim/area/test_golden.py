"""The kernels draw what their predecessors drew: those in Python, compiled by Numba, which made the golden file."""

import numpy as np
import pytest

from tests.peaksim.area.golden_views import GOLDEN, VIEWS

ROUNDING = 1e-3
"""Grey levels: sums of terms of up to 10¹⁰ are added in another order."""

SHARE_OF_EDGES, ON_EDGES = 0.01, 0.1
"""Share of the levels that may be farther off, and how far: the last bits of products of matrices are those of what
NumPy's BLAS has for the processor (seen: Haswell, SkylakeX, Prescott), and where surfaces meet a level follows them."""


@pytest.mark.parametrize("name", VIEWS)
def test_levels_are_those_of_the_golden_file(name: str) -> None:
    with np.load(GOLDEN / "area.npz") as golden:
        off = np.abs(VIEWS[name]() - golden[name])
    assert (off > ROUNDING).mean() < SHARE_OF_EDGES
    assert off.max() < ON_EDGES


def test_the_golden_file_holds_all_views() -> None:
    with np.load(GOLDEN / "area.npz") as golden:
        assert set(golden) == set(VIEWS)
