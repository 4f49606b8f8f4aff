"""Sheets in photographs: light, blur and noise are the photograph's own, and nothing else of it changes."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture, render
from peaksim.camera.optics import gaussian_blur
from peaksim.corpus.backdrop import edge_blur_px, fitted, into_photograph, light_of, noise_sigma
from peaksim.geometry.pose import compose, look_at

CAMERA = Camera(160, 120, 150.0)


def steps(seed: int = 0) -> np.ndarray:
    """Return a (240, 320) image of plain patches of many levels, whose edges lie between pixels."""
    rng = np.random.default_rng(seed)
    patches = rng.uniform(40, 215, (8, 10)).astype(np.float32)
    return cv2.resize(patches, (320, 240), interpolation=cv2.INTER_NEAREST)


@pytest.mark.parametrize("sigma_px", [0.6, 1.0, 2.0])
def test_the_blur_of_a_photograph_is_measured(sigma_px: float) -> None:
    assert edge_blur_px(gaussian_blur(steps(), sigma_px)) == pytest.approx(
        sigma_px, rel=0.12
    )  # a Gaussian of 0.6 px is poorly sampled


@pytest.mark.parametrize("sigma", [1.0, 3.0, 8.0])
def test_the_noise_of_a_photograph_is_measured(sigma: float) -> None:
    noisy = steps() + np.random.default_rng(1).normal(0, sigma, (240, 320)).astype(np.float32)
    assert noise_sigma(noisy) == pytest.approx(sigma, rel=0.1)


def test_even_images_have_the_least_blur_and_no_noise() -> None:
    assert edge_blur_px(np.full((20, 30), 128, np.float32)) == 0.1
    assert noise_sigma(np.full((20, 30), 128, np.float32)) == 0


def test_photographs_keep_their_middle_and_their_aspect() -> None:
    photo = np.zeros((100, 400), np.uint8)
    photo[:, 150:250] = 200
    small = fitted(photo, 64, 32)
    assert small.shape == (32, 64)
    assert small[:, 17:47].min() == 200  # the middle half of the 200 columns that stay
    assert small[:, :15].max() == 0


def test_light_follows_brightness_and_half_as_much_as_it() -> None:
    linear = np.full((60, 200, 3), 20, np.float32)
    linear[:, 100:] = 80
    light = light_of(linear)
    assert light[30, 190, 0] / light[30, 10, 0] == pytest.approx(4**0.6, rel=0.02)
    assert np.ptp(light, axis=2).max() < 1e-5


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """Dark on the left, light on the right, with noise of 4 levels."""
    levels = np.where(np.arange(160) < 80, 60, 180)[None, :] + np.random.default_rng(5).normal(0, 4, (120, 160))
    path = tmp_path / "photo.png"
    cv2.imwrite(str(path), np.repeat(levels[:, :, None], 3, axis=2).clip(0, 255).round().astype(np.uint8))
    return path


def frames(quads: tuple[Quad, ...]) -> list:
    pose = look_at((0, 0, 0), (0, 1, 0))
    return [render(Scene(quads, background=level), CAMERA, pose, "exact") for level in (0.0, 255.0)]


def test_beside_the_sheets_the_photograph_is_what_it_was(photo: Path) -> None:
    facing = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    sheet = Quad("sheet", Texture.from_array(np.full((1, 1), 200, np.uint8)), (0.2, 0.2), compose(facing, [0.3, 1, 0]))
    frame = into_photograph(*frames((sheet,)), photo, np.random.default_rng(0))
    before = cv2.imread(str(photo), cv2.IMREAD_COLOR)
    covered = np.zeros((120, 160), bool)
    covered[38:82, 98:152] = True
    assert np.array_equal(np.rint(frame.linear[~covered]), before[~covered].astype(np.float32))
    assert np.abs(frame.linear[60, 125] - before[60, 125]).max() > 5


def test_a_sheet_has_the_noise_of_the_photograph_and_its_light(photo: Path) -> None:
    facing = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    paper = Texture.from_array(np.full((1, 1), 128, np.uint8))
    sheets = tuple(Quad(f"sheet{k}", paper, (0.4, 0.5), compose(facing, [x, 1, 0])) for k, x in enumerate((-0.3, 0.3)))
    levels = into_photograph(*frames(sheets), photo, np.random.default_rng(0)).linear[:, :, 0]
    dark, light = levels[35:85, 10:50], levels[35:85, 110:150]
    noise = [np.std(part - gaussian_blur(np.ascontiguousarray(part), 3.0)) for part in (dark, light)]
    assert noise == pytest.approx([4, 4], rel=0.15)
    assert light.mean() > dark.mean() + 20
