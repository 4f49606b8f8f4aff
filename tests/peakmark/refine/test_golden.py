"""Alignments in C against those that Numba gave in double precision: the same decisions, nearly the same numbers."""

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
def test_single_precision_is_a_ten_thousandth_of_a_grey_level(name: str, golden: Columns, measured: Columns) -> None:
    is_residual = name.endswith("residuals")
    largest = np.ones(1) if is_residual else np.abs(golden[name]).max(axis=1, keepdims=True)
    error = np.abs(measured[name] - golden[name])
    assert (error <= (1e-4 if is_residual else 3e-6) * largest).all()


def test_fits_end_in_the_same_place(golden: Columns, measured: Columns) -> None:
    """Where there is a marker: elsewhere a fit may run off, and a last bit decides whither."""
    done = (golden["align_converged"] == 1) & (np.arange(len(golden["xy"])) < 12)
    assert done.sum() >= 11
    found, expected = (columns["align_theta"][done] for columns in (measured, golden))
    sigma = np.sqrt(np.diagonal(golden["align_covariance"][done], axis1=1, axis2=2))
    assert (np.abs(found - expected) < 0.01 * sigma).all()
    for name, rtol in (("noise", 1e-5), ("covariance", 0.02)):
        found, expected = (columns[f"align_{name}"][done] for columns in (measured, golden))
        np.testing.assert_allclose(found, expected, rtol=rtol)


def test_the_coarse_search_by_groups_misses_little_of_the_search_of_all_shapes(
    golden: Columns, measured: Columns
) -> None:
    lost = golden["correlation"] - measured["correlation"]
    assert np.abs(lost[:12]).max() < 0.02
    assert lost.max() < 0.1
