import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.markers.optimum_harris import SOBEL, gradient_filters, harris_optimum, harris_response


def gaussian(m, sigma=1.5):
    t = np.arange(m) - m // 2
    return np.exp(-np.add.outer(t**2, t**2) / (2 * sigma**2))


def test_response_is_that_of_correlated_derivatives():
    rng = np.random.default_rng(5)
    x, window = rng.normal(size=(7, 7)), gaussian(5)
    patches = np.lib.stride_tricks.sliding_window_view(x, (3, 3))
    dx, dy = ((patches * kernel).sum(axis=(2, 3)) for kernel in (SOBEL, SOBEL.T))
    S = np.array([[(window * a * b).sum() for b in (dx, dy)] for a in (dx, dy)])
    expected = np.linalg.det(S) - 0.04 * np.trace(S) ** 2
    assert harris_response(x, gradient_filters(window, SOBEL), 0.04) == pytest.approx(expected)


@pytest.mark.parametrize("m", [3, 5, 7, 9])
@pytest.mark.parametrize("kappa", [0.0, 0.04, 0.1])
def test_energy_optimum_under_a_gaussian_window_is_proven(m, kappa):
    best = harris_optimum(gaussian(m), "energy", kappa)
    assert np.linalg.norm(best.x) == pytest.approx(1)
    assert best.gap == pytest.approx(0, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), limit=st.sampled_from(["energy", "range"]))
def test_no_random_picture_beats_the_optimum(seed, limit):
    window = gaussian(3)
    best = harris_optimum(window, limit)
    assert best.value <= best.bound * (1 + 1e-9)
    gradients = gradient_filters(window, SOBEL)
    rivals = np.random.default_rng(seed).normal(size=(50, 5, 5))
    norm = {"energy": np.linalg.norm, "range": lambda x: np.abs(x).max()}[limit]
    assert all(harris_response(x / norm(x), gradients, 0.04) < best.value for x in rivals)


@pytest.mark.parametrize(
    ("window", "kappa"), [(np.ones((3, 4)), 0.04), (-np.ones((3, 3)), 0.04), (np.ones((3, 3)), 0.3)]
)
def test_unusable_windows_are_refused(window, kappa):
    with pytest.raises(InputError, match=r"expected .* got "):
        harris_optimum(window, "energy", kappa)
