import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import marker
from peakmark.errors import InputError
from peakmark.markers.optimum import linear_optimum, quadratic, quadratic_optimum

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds)
def test_linear_optimum_meets_its_bound_and_beats_random_patterns(seed):
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(3, 4))
    for limit, norm in (("energy", 2), ("range", np.inf)):
        best = linear_optimum(w, limit)
        assert best.gap == pytest.approx(0, abs=1e-12)
        assert np.linalg.norm(best.x.ravel(), norm) == pytest.approx(1)
        rivals = rng.normal(size=(50, 12))
        rivals /= np.linalg.norm(rivals, norm, axis=1, keepdims=True)
        assert (rivals @ w.ravel()).max() <= best.value


@given(seed=seeds)
def test_energy_optimum_is_the_largest_eigenvalue_of_the_dense_matrix(seed):
    rng = np.random.default_rng(seed)
    filters, form = rng.normal(size=(3, 5)), np.diag([1.0, -2.0, 0.5])
    best = quadratic_optimum(filters, form, "energy")
    assert best.value == pytest.approx(np.linalg.eigvalsh(filters.T @ form @ filters)[-1])
    assert np.linalg.norm(best.x) == pytest.approx(1)


@settings(deadline=None)
@given(seed=seeds, weight=st.floats(0, 4))
def test_range_optimum_with_one_positive_eigenvalue_is_proven_and_no_vertex_beats_it(seed, weight):
    filters = np.random.default_rng(seed).normal(size=(3, 8))
    form = marker.surf_form(weight)
    best = quadratic_optimum(filters, form, "range")
    assert np.abs(best.x).max() <= 1 + 1e-12
    assert best.gap < 1e-6
    vertices = (np.array(v) for v in itertools.product((-1.0, 1.0), repeat=8))
    assert max(quadratic(v, filters, form) for v in vertices) <= best.bound * (1 + 1e-12)


@pytest.mark.parametrize("kernel_side", [9, 15, 18, 21, 60, 195])
@pytest.mark.parametrize("weight", [0.0, 0.81, 1.0])
def test_surf_range_optimum_is_proven_binary(kernel_side, weight):
    filters = marker.surf_filters(kernel_side)
    best = quadratic_optimum(filters, marker.surf_form(weight), "range")
    assert best.gap == pytest.approx(0, abs=1e-12)
    np.testing.assert_array_equal(best.x, np.sign(np.round(filters[0] + filters[1], 12)))


def test_convex_operator_reports_a_bound_it_may_not_meet():
    filters = np.random.default_rng(3).normal(size=(4, 6))
    best = quadratic_optimum(filters, np.eye(4), "range")
    top = max(quadratic(np.array(v), filters, np.eye(4)) for v in itertools.product((-1.0, 1.0), repeat=6))
    assert best.value <= top <= best.bound
    assert best.value > 0.8 * top


@pytest.mark.parametrize(
    ("filters", "form"),
    [
        (np.ones((2, 3)), np.eye(3)),
        (np.ones((2, 3)), [[0, 1], [2, 0]]),
        (np.full((1, 3), np.nan), [[1]]),
        (np.eye(2), -np.eye(2)),
    ],
    ids=["size", "asymmetric", "nan", "negative"],
)
def test_unusable_operators_are_refused(filters, form):
    with pytest.raises(InputError, match="expected"):
        quadratic_optimum(filters, form, "energy")


def test_laplacian_of_gaussian_is_matched_by_its_sign_under_range():
    t = np.arange(-12, 13)
    half_r2 = np.add.outer(t**2, t**2) / (2 * 3.0**2)
    best = linear_optimum((half_r2 - 1) * np.exp(-half_r2), "range")
    np.testing.assert_array_equal(best.x < 0, half_r2 < 1)


def test_a_limit_that_is_none_is_refused() -> None:
    for call in (lambda: linear_optimum([1.0, -1.0], "foo"), lambda: quadratic_optimum(np.eye(2), np.eye(2), "foo")):  # type: ignore[arg-type]
        with pytest.raises(InputError, match="limit: expected one of energy, range, got 'foo'"):
            call()
