"""The sensor: each effect against its formula or its statistics, off by default, seeded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.camera.sensor import Sensor, capture_image, disc_kernel, gaussian_blur, quantise, vignette
from peaksim.errors import SceneError
from PIL import Image

FLAT = np.full((200, 300), 100.25, np.float32)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@given(st.integers(0, 2**31), st.booleans())
def test_the_default_only_rounds(seed: int, colour: bool) -> None:
    levels = rng(seed).uniform(-20, 300, (7, 9, 3) if colour else (7, 9)).astype(np.float32)
    assert np.array_equal(capture_image(levels, Sensor(), rng()), np.clip(np.rint(levels), 0, 255).astype(np.uint8))


def test_noise_is_seeded_and_a_quiet_sensor_draws_nothing() -> None:
    noisy = Sensor(read_noise=3.0, full_well_e=5000)
    assert np.array_equal(capture_image(FLAT, noisy, rng(1)), capture_image(FLAT, noisy, rng(1)))
    assert not np.array_equal(capture_image(FLAT, noisy, rng(1)), capture_image(FLAT, noisy, rng(2)))
    generator = rng(1)
    capture_image(FLAT, Sensor(lens_blur_px=1, vignetting=0.5, jpeg_quality=90), generator)
    assert generator.integers(2**62) == rng(1).integers(2**62)


def test_read_noise_has_the_stated_sigma_and_no_bias() -> None:
    image = capture_image(FLAT, Sensor(read_noise=5.0), rng()).astype(float)
    assert image.mean() == pytest.approx(100.25, abs=4 * 5 / np.sqrt(FLAT.size))
    assert image.std() == pytest.approx(np.sqrt(25 + 1 / 12), rel=0.01)


@pytest.mark.parametrize("level", [20.0, 200.0])
def test_photon_noise_has_the_variance_of_its_electrons(level: float) -> None:
    image = capture_image(np.full_like(FLAT, level), Sensor(full_well_e=2000), rng()).astype(float)
    electrons = level * 2000 / 255
    assert image.var() - 1 / 12 == pytest.approx((level / electrons) ** 2 * electrons, rel=0.04)
    assert image.mean() == pytest.approx(level, abs=0.2)


def test_gain_amplifies_photon_noise_and_exposure_does_not() -> None:
    brighter = capture_image(FLAT / 2, Sensor(exposure=2, full_well_e=2000), rng()).astype(float)
    amplified = capture_image(FLAT / 2, Sensor(gain=2, full_well_e=2000), rng()).astype(float)
    assert brighter.mean() == pytest.approx(amplified.mean(), rel=0.01)
    assert amplified.var() == pytest.approx(2 * brighter.var(), rel=0.05)


def test_lens_blur_spreads_a_point_by_its_sigma_and_keeps_its_light() -> None:
    point = np.zeros((61, 61), np.float32)
    point[30, 30] = 1000
    spread = gaussian_blur(point, 2.0).astype(float)
    x = np.arange(61) - 30
    assert spread.sum() == pytest.approx(1000, rel=1e-4)
    assert (spread.sum(axis=0) * x**2).sum() / 1000 == pytest.approx(4.0, rel=0.01)


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


def test_vignetting_loses_the_stated_share_in_the_corners_only() -> None:
    passed = vignette(101, 201, 0.6)
    assert passed[50, 100] == 1
    assert np.allclose(passed[[0, 0, -1, -1], [0, -1, 0, -1]], 0.4)
    white = capture_image(np.full((101, 201, 3), 200, np.float32), Sensor(vignetting=0.6), rng())
    assert white[0, 0].tolist() == [80, 80, 80]


def test_gamma_is_a_power_law_with_fixed_ends() -> None:
    ramp = np.array([[-5, 0, 64, 128, 255, 400]], np.float32)
    assert capture_image(ramp, Sensor(gamma=2.2), rng()).tolist() == [[0, 0, 136, 186, 255, 255]]


@pytest.mark.parametrize("bits", range(1, 9))
def test_quantisation_has_two_to_the_bits_levels_from_black_to_white(bits: int) -> None:
    levels = np.unique(quantise(np.linspace(-10, 265, 5000, dtype=np.float32)[None], bits))
    assert len(levels) == 2**bits
    assert (levels[0], levels[-1]) == (0, 255)


def test_jpeg_is_the_codecs_own() -> None:
    from io import BytesIO

    image = rng().integers(0, 255, (64, 64, 3), dtype=np.uint8)
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=40)
    assert np.array_equal(
        capture_image(image.astype(np.float32), Sensor(jpeg_quality=40), rng()), np.array(Image.open(buffer))
    )


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lens_blur_px", -1.0),
        ("read_noise", float("nan")),
        ("vignetting", 1.5),
        ("gamma", 0.0),
        ("bits", 9),
        ("bits", 7.5),
        ("jpeg_quality", 101),
        ("gain", float("inf")),
        ("exposure", "bright"),
        ("full_well_e", True),
    ],
)
def test_senseless_settings_name_the_field_and_its_range(field: str, value: object) -> None:
    with pytest.raises(SceneError, match=rf"sensor\.{field}: expected a .*number in .*, got"):
        Sensor(**{field: value})  # type: ignore[arg-type]
