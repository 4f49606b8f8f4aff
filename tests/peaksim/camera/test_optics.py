"""What a lens does to light: each effect against its formula."""

import numpy as np
import pytest
from peaksim.camera.optics import LUMA, disc_kernel, gaussian_blur, shift_colours, vignette
from scipy.ndimage import gaussian_filter1d

from tests.peaksim.camera.blobs import blobs, centroids


def test_lens_blur_spreads_a_point_by_its_sigma_and_keeps_its_light() -> None:
    point = np.zeros((61, 61), np.float32)
    point[30, 30] = 1000
    spread = gaussian_blur(point, 2.0).astype(float)
    x = np.arange(61) - 30
    assert spread.sum() == pytest.approx(1000, rel=1e-4)
    assert (spread.sum(axis=0) * x**2).sum() / 1000 == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("shape", [(40, 70), (33, 17, 3), (5, 3), (1, 7), (7, 1), (1, 1, 3), (2, 40, 3)])
@pytest.mark.parametrize("sigma_px", [0.05, 0.13, 0.77, 2.0, 30.0])
def test_lens_blur_is_scipys_to_the_last_bit(shape: tuple[int, ...], sigma_px: float) -> None:
    levels = np.random.default_rng(0).uniform(0, 300, shape).astype(np.float32)
    expected = levels
    for axis in (0, 1):
        expected = gaussian_filter1d(expected, sigma_px, axis=axis, mode="mirror", truncate=4.0)
    assert np.array_equal(gaussian_blur(levels, sigma_px), expected)


@pytest.mark.parametrize("radius_px", [0.1, 0.5, 0.8, 1.5, 4.0, 7.3])
def test_a_disc_is_round_and_has_the_second_moment_of_its_radius(radius_px: float) -> None:
    kernel = disc_kernel(radius_px).astype(float)
    half = len(kernel) // 2
    x = np.arange(-half, half + 1)
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    assert np.array_equal(kernel, kernel.T)
    assert np.array_equal(kernel, kernel[::-1])
    binned = 1 / 12 if half else 0.0  # shares are counted at pixel centres, which adds to the disc's r²/4
    assert (kernel.sum(axis=0) * x**2).sum() == pytest.approx((radius_px**2 / 4 + binned) if half else 0, abs=0.07)


def test_a_vignette_is_the_fourth_power_of_the_radius() -> None:
    passed = vignette(101, 201, 0.6)
    assert passed[50, 100] == 1
    assert np.allclose(passed[[0, 0, -1, -1], [0, -1, 0, -1]], 0.4)
    assert passed[50, 0] == pytest.approx(1 - 0.6 * (100**2 / (100**2 + 50**2)) ** 2)


def test_colours_part_by_the_stated_distance_and_grey_stays() -> None:
    centers = np.array([(40.3, 30.6), (600.2, 450.9), (320.1, 240.4), (590.7, 35.2)])
    light = np.repeat(blobs((480, 640), centers)[:, :, None], 3, axis=2)
    shifted = shift_colours(light, 3.0)
    red, green, blue = (centroids(shifted[:, :, k], centers) for k in range(3))
    middle = np.array([639, 479]) / 2
    parts = (red - blue) / (centers - middle)
    assert np.allclose(parts[[0, 1, 3]], 3.0 / np.hypot(*middle), rtol=0.01)
    assert np.allclose((red + blue) / 2, green, atol=0.003)
    assert np.allclose(centroids(shifted @ np.array(LUMA, np.float32), centers), centers, atol=0.004)
