"""Alignments in C against those that Numba's kernels gave: the same decisions, and nearly the same bits."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.refine_golden import PATH, Views, measure

Columns = dict[str, NDArray[np.float64]]


@pytest.fixture(scope="module")
def golden() -> Columns:
    with np.load(PATH) as columns:
        return dict(columns)


@pytest.fixture(scope="module")
def measured(golden: Columns) -> Columns:
    return measure(Views(golden["image"].astype(np.uint8), golden["xy"], golden["sides_px"]))


@pytest.mark.parametrize("name", ["align_converged", "pixels"])
def test_decisions_are_the_same(name: str, golden: Columns, measured: Columns) -> None:
    np.testing.assert_array_equal(measured[name], golden[name])


@pytest.mark.parametrize("name", ["residuals", "jacobian", "lit_residuals", "lit_jacobian"])
def test_derivatives_differ_in_the_last_bits_only(name: str, golden: Columns, measured: Columns) -> None:
    """Sums run in another order, and exp is our own."""
    np.testing.assert_allclose(measured[name], golden[name], rtol=1e-11, atol=1e-12)


def test_fits_end_in_the_same_place(golden: Columns, measured: Columns) -> None:
    """Where there is a marker: elsewhere a fit may run off, and a last bit decides whither."""
    done = (golden["align_converged"] == 1) & (np.arange(len(golden["xy"])) < 12)
    assert done.sum() >= 11
    for name, rtol in (("theta", 1e-5), ("noise", 1e-7), ("covariance", 1e-4)):
        found, expected = (columns[f"align_{name}"][done] for columns in (measured, golden))
        np.testing.assert_allclose(found, expected, rtol=rtol, atol=1e-6 if name == "theta" else 0)


def test_the_coarse_search_by_groups_misses_little_of_the_search_of_all_shapes(
    golden: Columns, measured: Columns
) -> None:
    lost = golden["correlation"] - measured["correlation"]
    assert np.abs(lost[:12]).max() < 0.02
    assert lost.max() < 0.1
