import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from peakmark.refine.api import PATTERNS, known_pattern
from peakmark.refine.model import normal_distribution, pattern_points, predict, residuals, select_pixels, smooth_step

GRID_PATTERNS = [name for name in PATTERNS if name.startswith("surf")]

angles = st.floats(0, 2 * np.pi)


def parameters(rotation_rad=0.3, tilt=0.5, side=40.0, g=(0.05, -0.1), blur=0.2):
    rotation = np.array([[np.cos(rotation_rad), -np.sin(rotation_rad)], [np.sin(rotation_rad), np.cos(rotation_rad)]])
    affine = side * np.diag([1.0, np.cos(tilt)]) @ rotation
    return np.r_[33.2, 30.7, affine.ravel(), g, 210.0, 20.0, blur]


def pixels_in_use(theta, pattern):
    return select_pixels(theta, pattern.lines, pattern.extent, 64, 64, 1)


@pytest.mark.parametrize("name", GRID_PATTERNS)
@given(rotation_rad=angles, tilt=st.floats(0, 1.2), side=st.floats(14, 60), blur=st.floats(0.01, 3))
def test_kernel_agrees_with_the_plain_model(name, rotation_rad, tilt, side, blur):
    pattern, theta = known_pattern(name, 0.05), parameters(rotation_rad, tilt, side, blur=blur)
    pixels = pixels_in_use(theta, pattern)
    image = np.random.default_rng(1).uniform(0, 255, (64, 64)).astype(np.float32)
    kernel = residuals(image, pixels, theta, pattern.lines, pattern.levels)[0]
    plain = image[pixels[:, 1], pixels[:, 0]] - predict(theta, pixels.astype(float), pattern)
    np.testing.assert_allclose(kernel, plain, atol=0.2)  # the kernel cuts the Gaussian at 3.5 σ


def test_derivatives_are_those_of_the_plain_model_where_blur_is_fixed():
    """Centre, gain, offset and blur exactly; A and g up to how they change the blur, which J leaves out."""
    pattern, theta = known_pattern("surf-dark", 0.05), parameters(blur=1.0)
    pixels = pixels_in_use(theta, pattern)
    zeros = np.zeros((64, 64), np.float32)
    J = residuals(zeros, pixels, theta, pattern.lines, pattern.levels)[1]
    for k, tolerance in [*((k, 0.02) for k in (0, 1, 8, 9, 10)), *((k, 0.25) for k in range(2, 8))]:
        h = np.eye(11)[k] * 1e-4
        xy = pixels.astype(float)
        numeric = (predict(theta + h, xy, pattern) - predict(theta - h, xy, pattern)) / 2e-4
        assert np.linalg.norm(J[k] - numeric) < tolerance * np.linalg.norm(numeric), k


@given(rotation_rad=angles, tilt=st.floats(0, 1.2), g=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)))
def test_pattern_points_invert_the_projection(rotation_rad, tilt, g):
    theta = parameters(rotation_rad, tilt, g=g)
    u = np.random.default_rng(2).uniform(-0.5, 0.5, (20, 2))
    xy = theta[:2] + u @ theta[2:6].reshape(2, 2).T / (1 + u @ theta[6:8])[:, None]
    found, by_px = pattern_points(theta, xy)
    np.testing.assert_allclose(found, u, atol=1e-9)
    step = np.array([1e-5, 0])
    np.testing.assert_allclose((pattern_points(theta, xy + step)[0] - found) / 1e-5, by_px[:, :, 0], atol=1e-4)


def test_an_upright_sharp_pixel_sees_its_share_of_area():
    t = np.linspace(-1, 1, 21)
    shares = smooth_step(t, np.array(1.0), np.array(1e-4))
    np.testing.assert_allclose(shares, np.clip(t + 0.5, 0, 1), atol=1e-4)


def test_selected_pixels_are_inside_and_thin_out():
    pattern, theta = known_pattern("surf-dark", 0.0), parameters()
    pixels = pixels_in_use(theta, pattern)
    u = pattern_points(theta, pixels.astype(float))[0]
    assert np.abs(u).max() < 0.5
    thin = select_pixels(theta, pattern.lines, pattern.extent, 64, 64, 3)
    assert len(pixels) / 4 < len(thin) < len(pixels) / 2
    assert {tuple(p) for p in thin} <= {tuple(p) for p in pixels}


def test_the_normal_distribution_is_scipys():
    z = np.concatenate([np.linspace(-12, 12, 4801), [-1e300, -np.inf, np.inf, 1e-300, 0]]).reshape(2, -1)
    np.testing.assert_allclose(normal_distribution(z), ndtr(z), rtol=0, atol=1e-15)
    assert normal_distribution(np.empty(0)).shape == (0,)
