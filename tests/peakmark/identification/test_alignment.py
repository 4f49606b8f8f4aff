"""The noise that an image really has."""

import cv2
import numpy as np
import pytest

from peakmark.identification.alignment import noise_sigma_of


@pytest.mark.parametrize("sigma", [1.0, 4.0, 12.0])
def test_noise_is_found_on_a_ramp_that_an_edge_crosses(sigma: float) -> None:
    x, y = np.meshgrid(np.linspace(40, 200, 200), np.arange(160))
    image = np.where(y > 90, x, 240 - x) + np.random.default_rng(2).normal(0, sigma, x.shape)
    assert noise_sigma_of(np.clip(np.rint(image), 0, 255).astype(np.uint8)) == pytest.approx(sigma, rel=0.08)


def test_noise_is_the_lower_third_of_medians_of_a_filtered_image() -> None:
    gray = np.random.default_rng(1).integers(0, 256, (70, 101), dtype=np.uint8)
    stencil = np.outer([1, -2, 1], [1, -2, 1]) / 6.0
    response = np.abs(cv2.filter2D(gray.astype(np.float64), -1, stencil))[1:-1, 1:-1]
    medians = [
        1.4826 * np.median(response[y : y + 16, x : x + 16]) for y in (0, 16, 32, 48) for x in range(0, 96 - 15, 16)
    ]
    assert noise_sigma_of(gray) == pytest.approx(np.quantile(medians, 0.3))


def test_noise_of_a_large_image_is_told_from_every_second_block_along_either_side() -> None:
    rng = np.random.default_rng(5)
    gray = np.clip(np.rint(128 + rng.normal(0, 3, (2900, 3000))), 0, 255).astype(np.uint8)
    told = noise_sigma_of(gray)
    for lines in (gray, gray.T):
        number = np.arange(len(lines))
        lines[(number // 16 % 2 == 1) & (number % 16 > 1)] = 0
    assert told == pytest.approx(3, rel=0.08)
    assert noise_sigma_of(gray) == told


@pytest.mark.parametrize("shape", [(1, 1), (2, 500), (17, 17), (0, 4)])
def test_noise_of_images_without_a_block_is_the_least(shape: tuple[int, int]) -> None:
    assert noise_sigma_of(np.zeros(shape, np.uint8)) == 0.3
