"""Every stage of the alignment by itself, on images that the plain model draws: known minima, known covariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, map_coordinates

from peakmark.refine.align import (
    align,
    block_means,
    chosen_pixels,
    coarse_shape,
    gauss_newton,
    sandwich,
    shape_grid,
    soft_fit,
    softened,
)
from peakmark.refine.api import coarse_template, known_pattern
from peakmark.refine.model import PARAMETERS, predict, residuals

Values = NDArray[np.float64]

PATTERN = known_pattern("surf-dark", 0.0)
GRID = (PATTERN.lines, PATTERN.levels)
FREE = np.zeros(PARAMETERS)
"""Precision of a prior that says nothing."""
SHAPE = slice(2, 6)


def parameters(
    side: float = 40.0, rotation_rad: float = 0.3, tilt_rad: float = 0.5, center: tuple[float, float] = (33.2, 30.7)
) -> Values:
    c, s = np.cos(rotation_rad), np.sin(rotation_rad)
    affine = side / np.sqrt(np.cos(tilt_rad)) * np.diag([1.0, np.cos(tilt_rad)]) @ [[c, -s], [s, c]]
    return np.array([*center, *affine.ravel(), 0.02, -0.03, 180.0, 30.0, 0.3])


def drawn(theta: Values, size: int = 66) -> NDArray[np.float32]:
    """Return the image that the plain model predicts, white paper around the pattern."""
    xy = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1).reshape(-1, 2)
    return predict(theta, xy.astype(np.float64), PATTERN).reshape(size, size).astype(np.float32)


def pixels_of(image: NDArray[np.float32], theta: Values) -> NDArray[np.int32]:
    pixels: NDArray[np.int32] = chosen_pixels(image, theta, PATTERN.lines, PATTERN.extent, 3000)
    return pixels


def assert_same_shape(found: Values, expected: Values, rtol: float) -> None:
    """Compare A Aᵀ, which rotations of the pattern by 90° leave alone."""
    a, b = (theta[SHAPE].reshape(2, 2) for theta in (found, expected))
    assert np.linalg.norm(a @ a.T - b @ b.T) < rtol * np.linalg.norm(b @ b.T)


@settings(max_examples=30)
@given(rotation_rad=st.floats(0, 1.5), tilt_rad=st.floats(0, 0.9), side=st.floats(25, 42), seed=st.integers(0, 999))
def test_gauss_newton_ends_in_the_minimum_that_the_image_was_drawn_from(
    rotation_rad: float, tilt_rad: float, side: float, seed: int
) -> None:
    theta = parameters(side, rotation_rad, tilt_rad)
    image = drawn(theta)
    off = np.random.default_rng(seed).normal(0, [0.02 * side] * 6 + [0.01] * 2 + [5, 5, 0.03])
    pixels = pixels_of(image, theta)
    found, noise, converged = gauss_newton(image, pixels, theta + off, *GRID, FREE, FREE, 30, 1e-6)
    assert converged
    # the kernel cuts the Gaussian at 3.5 σ and approximates it, the plain model does not
    np.testing.assert_allclose(found[:2], theta[:2], atol=2e-3)
    np.testing.assert_allclose(found[SHAPE], theta[SHAPE], atol=0.02)
    assert noise == 1 / 12  # no less than rounding


def test_gauss_newton_is_linear_least_squares_where_all_but_the_light_is_held() -> None:
    theta = parameters()
    image = drawn(theta) + np.random.default_rng(0).normal(0, 6, (66, 66)).astype(np.float32)
    pixels, held = pixels_of(image, theta), np.full(PARAMETERS, 1e12)
    held[8:10] = 0
    start = theta.copy()
    start[8:10] = 100, 60
    found, noise, converged = gauss_newton(image, pixels, start, *GRID, theta, held, 30, 1e-8)
    r, J = residuals(image, pixels, theta, *GRID)
    light, *_ = np.linalg.lstsq(J[8:10].T, r, rcond=None)
    assert converged
    np.testing.assert_allclose(found[8:10], theta[8:10] + light, rtol=1e-4)
    np.testing.assert_allclose(found[:8], theta[:8], atol=1e-6)
    squares = np.sum((r - light @ J[8:10]) ** 2)
    assert noise == pytest.approx(squares / (len(pixels) - PARAMETERS), rel=1e-4)


def test_gauss_newton_ends_in_a_strong_prior_whatever_the_image_shows() -> None:
    theta, mean = parameters(), parameters() + 0.3
    image = drawn(theta)
    pixels = pixels_of(image, theta)
    found, _, _ = gauss_newton(image, pixels, mean, *GRID, mean, np.full(PARAMETERS, 1e12), 10, 1e-6)
    np.testing.assert_allclose(found, mean, atol=1e-6)


def test_gauss_newton_refuses_too_few_pixels() -> None:
    theta = parameters()
    image = drawn(theta)
    found, noise, converged = gauss_newton(image, pixels_of(image, theta)[:23], theta + 1, *GRID, FREE, FREE, 9, 1.0)
    assert (noise, converged) == (0.0, False)
    np.testing.assert_array_equal(found, theta + 1)


def leverages(J: Values, noise: float, precision: Values) -> tuple[Values, Values]:
    """Return (n,) leverages and the inverse of the Hessian (11, 11), by dense algebra."""
    inverse = np.linalg.inv(J @ J.T / noise + np.diag(precision))
    return np.einsum("kn,kl,ln->n", J, inverse, J) / noise, inverse


def test_sandwich_is_the_inverse_hessian_where_residuals_are_as_large_as_the_model_expects() -> None:
    """With r² = σ² (1 − leverage) at every pixel the filling of the sandwich is the Hessian itself."""
    theta, sigma = parameters(), 7.0
    precision = np.array([0.0] * 6 + [400.0, 400.0, 0.0, 0.0, 0.04])
    image = drawn(theta)
    pixels = pixels_of(image, theta)
    r, J = residuals(image, pixels, theta, *GRID)
    leverage, inverse = leverages(J, sigma**2, precision)
    signs = np.random.default_rng(1).choice([-1.0, 1.0], len(pixels))
    image[pixels[:, 1], pixels[:, 0]] += (signs * sigma * np.sqrt(1 - leverage) - r).astype(np.float32)
    np.testing.assert_allclose(
        sandwich(image, pixels, theta, *GRID, sigma**2, precision), inverse, rtol=1e-3, atol=1e-9
    )


def test_sandwich_tells_the_scatter_of_fits_under_noise_that_grows_with_the_level() -> None:
    theta, rng = parameters(30.0), np.random.default_rng(2)
    image = drawn(theta)
    pixels = pixels_of(image, theta)
    sigma = np.where(image > 120, 14.0, 2.0)
    centers, promised = [], []
    for _ in range(300):
        noisy = image + (sigma * rng.standard_normal(image.shape)).astype(np.float32)
        found, noise, converged = gauss_newton(noisy, pixels, theta, *GRID, FREE, FREE, 20, 1e-4)
        assert converged
        centers.append(found[:2])
        promised.append(sandwich(noisy, pixels, found, *GRID, noise, FREE)[:2, :2])
    scatter = np.cov(np.array(centers).T)
    # 300 fits tell a variance within 8 % (1 σ)
    np.testing.assert_allclose(np.diag(np.mean(promised, axis=0)), np.diag(scatter), rtol=0.25)


@settings(max_examples=40)
@given(
    rotation_rad=st.floats(0, 6.3), tilt_rad=st.floats(0, 1.0), error=st.floats(0.85, 1.15), seed=st.integers(0, 999)
)
def test_the_soft_fit_finds_any_rotation_and_tilt_from_where_a_detector_says(
    rotation_rad: float, tilt_rad: float, error: float, seed: int
) -> None:
    theta, side = parameters(22.0, rotation_rad, tilt_rad), 22.0
    center = theta[:2] + np.random.default_rng(seed).normal(0, 0.03 * side, 2)
    precision = np.zeros(PARAMETERS)
    precision[6:8], precision[10] = 20.0**2, 1e12
    shapes = shape_grid()
    args = (*GRID, PATTERN.extent, precision, *coarse_template("surf-dark", 0.0), shapes)
    found = soft_fit(drawn(theta), center, error * side, *args)
    assert np.linalg.norm(found[:2] - theta[:2]) < 0.03 * side
    assert_same_shape(found, theta, 0.2)


@settings(max_examples=40)
@given(
    rotation_rad=st.floats(0, 6.3),
    tilt_rad=st.floats(0, 1.0),
    side=st.floats(20, 110),
    error=st.floats(0.85, 1.15),
    seed=st.integers(0, 999),
)
def test_align_finds_a_drawn_pattern_anywhere_at_any_size(
    rotation_rad: float, tilt_rad: float, side: float, error: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    size = int(4 * side)
    theta = parameters(side, rotation_rad, tilt_rad, tuple(size / 2 + rng.uniform(-1, 1, 2)))
    gray = np.clip(np.rint(drawn(theta, size)), 0, 255).astype(np.uint8)
    center = theta[:2] + rng.normal(0, 0.02 * side, 2)
    extra = (*GRID, PATTERN.extent, 800.0, *coarse_template("surf-dark", 0.0), shape_grid())
    found, covariance, noise, converged = align(gray, center, error * side, *extra)
    assert converged
    np.testing.assert_allclose(found[:2], theta[:2], atol=0.03)
    assert_same_shape(found, theta, 0.02)
    assert noise < 1
    assert (np.linalg.eigvalsh(covariance[:6, :6]) > 0).all()


def test_align_says_so_where_nothing_is_to_be_found() -> None:
    extra = (*GRID, PATTERN.extent, 800.0, *coarse_template("surf-dark", 0.0), shape_grid())
    gray = np.full((60, 60), 90, np.uint8)
    for center, size in (((-40.0, 30.0), 20.0), ((30.0, 30.0), 3.0)):
        _, covariance, _, converged = align(gray, np.array(center), size, *extra)
        assert not converged
        assert np.isnan(covariance).all()


def test_the_coarse_search_takes_the_shape_of_highest_correlation() -> None:
    samples, template = coarse_template("surf-dark", 0.0)
    shapes = shape_grid()
    for k in range(6):
        image = drawn(parameters(24.0, 0.4 * k, 0.15 * k)) + np.random.default_rng(k).normal(0, 3, (66, 66))
        x, y = (25 * shapes @ samples.T + np.array([[33.0], [31.0]])).transpose(1, 0, 2)
        levels = map_coordinates(image, [y, x], order=1, mode="nearest")
        scores = [np.corrcoef(row, template)[0, 1] for row in levels]
        assert coarse_shape(image, 33.0, 31.0, 25.0, samples, template, shapes) == np.argmax(scores)


@pytest.mark.parametrize("wanted", [30, 200, 10_000])
def test_about_as_many_pixels_are_chosen_as_are_wanted(wanted: int) -> None:
    theta = parameters()
    image = drawn(theta)
    everything, chosen = (chosen_pixels(image, theta, PATTERN.lines, PATTERN.extent, n) for n in (10**6, wanted))
    assert len(chosen) <= max(1.2 * wanted, 24)
    assert {tuple(p) for p in chosen} <= {tuple(p) for p in everything}
    if wanted >= len(everything):
        assert len(chosen) == len(everything)


def test_block_means_are_means_of_whole_blocks() -> None:
    image = np.random.default_rng(1).uniform(0, 255, (20, 31)).astype(np.float32)
    expected = image[:18, :30].reshape(6, 3, 10, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(block_means(image, 3), expected, rtol=1e-5)


def test_softened_filters_both_axes_and_repeats_edges() -> None:
    image = np.random.default_rng(2).uniform(0, 255, (9, 12)).astype(np.float32)
    kernel = [0.25, 0.5, 0.25]
    expected = convolve1d(convolve1d(image, kernel, 0, mode="nearest"), kernel, 1, mode="nearest")
    np.testing.assert_allclose(softened(image), expected, rtol=1e-5)


def test_shapes_cover_rotations_foreshortenings_and_sizes() -> None:
    shapes = shape_grid()
    sides = np.sqrt(np.linalg.det(shapes))
    np.testing.assert_allclose([sides.min(), sides.max()], [0.75, 1.33])
    stretch = np.linalg.svd(shapes, compute_uv=False)
    assert np.isclose(stretch[:, 0] / stretch[:, 1], 3.3).any()
