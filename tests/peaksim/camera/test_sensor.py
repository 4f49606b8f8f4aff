"""The sensor: each effect against its formula or its statistics, off by default, seeded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim import Camera, Quad, Scene, Texture, Trajectory, render
from peaksim.camera import apply_sensor
from peaksim.camera.sensor import Sensor, capture_image, metered, quantise
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at
from PIL import Image
from scipy.special import erf

_FACING_LEFT = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])
_FACING_RIGHT = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])

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


def test_vignetting_loses_the_stated_share_in_the_corners_only() -> None:
    white = capture_image(np.full((101, 201, 3), 200, np.float32), Sensor(vignetting=0.6), rng())
    assert white[[0, 0, -1, -1], [0, -1, 0, -1]].tolist() == [[80, 80, 80]] * 4
    assert white[50, 100].tolist() == [200, 200, 200]


def test_gamma_is_a_power_law_with_fixed_ends() -> None:
    ramp = np.array([[-5, 0, 64, 128, 255, 400]], np.float32)
    assert capture_image(ramp, Sensor(gamma=2.2), rng()).tolist() == [[0, 0, 136, 186, 255, 255]]


@pytest.mark.parametrize("bits", [*range(1, 9), 10, 12, 16])
def test_quantisation_has_two_to_the_bits_levels_from_black_to_white(bits: int) -> None:
    image = quantise(np.linspace(-10, 265, 400_000, dtype=np.float32)[None], bits)
    levels = np.unique(image)
    assert len(levels) == 2**bits
    assert (levels[0], levels[-1]) == ((0, 255) if bits <= 8 else (0, 65535))
    assert image.dtype == (np.uint8 if bits <= 8 else np.uint16)


def test_the_codes_of_ten_bits_come_back_from_sixteen() -> None:
    codes = np.arange(1024)
    image = quantise((codes * (255 / 1023)).astype(np.float32)[None], 10)
    assert np.array_equal(np.rint(image[0] * (1023 / 65535)), codes)


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
        ("bits", 17),
        ("hot_pixels", 0.2),
        ("hot_seed", -1),
        ("sharpening_px", 0.0),
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


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("mosaic", "rgbg", "one of none, rggb, bggr, grbg, gbrg"),
        ("output", "yuv", "one of image, grey, rgb, raw"),
        ("tone", "log", "one of linear, srgb, s-curve, or points"),
        ("tone", ((0, 0), (0.5, 0.8), (1, 0.7)), "one of linear, srgb, s-curve, or points"),
        ("name", 7, "a name"),
    ],
)
def test_unknown_words_are_refused_with_those_that_there_are(field: str, value: object, expected: str) -> None:
    with pytest.raises(SceneError, match=rf"sensor\.{field}: expected {expected}.*, got"):
        Sensor(**{field: value})  # type: ignore[arg-type]


def test_jpeg_holds_no_more_than_eight_bits_and_raw_needs_none() -> None:
    with pytest.raises(SceneError, match=r"sensor\.jpeg_quality: expected 0 with more than 8 bits, got 90"):
        Sensor(bits=12, jpeg_quality=90)
    assert capture_image(FLAT, Sensor(bits=12, jpeg_quality=90, output="raw"), rng()).dtype == np.uint16


# --- hot pixels, sharpening, exposure ------------------------------------------------------------------------------


def test_hot_pixels_are_the_same_in_all_frames_of_a_camera() -> None:
    dark = np.zeros((200, 300), np.float32)
    first, second, other = (
        capture_image(dark, Sensor(hot_pixels=0.01, hot_seed=camera, read_noise=0.1), rng(frame))
        for camera, frame in ((0, 1), (0, 2), (1, 1))
    )
    hot = first > 5
    assert 0.008 < hot.mean() < 0.011  # of an exponential distribution 4 % lie below 5 levels
    assert np.array_equal(hot, second > 5)
    assert not np.array_equal(hot, other > 5)
    assert first[hot].mean() == pytest.approx(110, abs=12)


def test_sharpening_adds_the_stated_share_of_what_a_blur_takes() -> None:
    edge = np.full((40, 80), 60, np.float32)
    edge[:, 40:] = 160
    image = capture_image(edge, Sensor(sharpening=0.5, sharpening_px=2.0), rng()).astype(float)
    inside = 0.5 * (1 + erf(0.5 / 2 / np.sqrt(2)))  # share of the near side in the pixel beside the edge
    assert image[20, 40] == pytest.approx(160 + 0.5 * 100 * (1 - inside), abs=1)
    assert image[20, 39] == pytest.approx(60 - 0.5 * 100 * (1 - inside), abs=1)
    assert image[20, [5, 75]].tolist() == [60, 160]


def test_automatic_exposure_brings_the_geometric_mean_to_its_level() -> None:
    levels = rng().uniform(5, 40, (60, 80)).astype(np.float32)
    levels[0, 0] = 1e5  # a lamp
    image = capture_image(levels, Sensor(auto_exposure=70, bits=16), rng()) * (255 / 65535)
    assert metered(image.astype(np.float32)) == pytest.approx(70, rel=0.003)
    darker = capture_image(levels, Sensor(auto_exposure=70, exposure=0.5, bits=16), rng()) * (255 / 65535)
    assert metered(darker.astype(np.float32)) == pytest.approx(35, rel=0.003)


def test_automatic_exposure_follows_along_a_trajectory_with_its_time_constant() -> None:
    """A camera that turns from a wall of level 40 to one of 160 at 1 s, and what it makes of the second."""
    walls = tuple(
        Quad(f"wall{k}", Texture.from_array(np.full((1, 1), level, np.uint8)), (40, 40), compose(look, [side, 0, 0]))
        for k, (level, side, look) in enumerate(((40, 10, _FACING_LEFT), (160, -10, _FACING_RIGHT)))
    )
    times_s = np.arange(0, 9.01, 0.05)  # close together, for splines join them
    poses = [look_at((0, 0, 0), (1 if time_s <= 1 else -1, 0, 0)) for time_s in times_s]
    trajectory = Trajectory(times_s, np.stack(poses))
    sensor = Sensor(auto_exposure=70, adaptation_s=2.0)

    def level(time_s: float) -> float:
        frame = render(Scene(walls), Camera(64, 48, 60.0), trajectory, "exact", time_s)
        return float(apply_sensor(frame, sensor, rng()).image.mean())

    assert level(0.5) == pytest.approx(70, abs=0.6)
    assert level(9.0) == pytest.approx(70, abs=2)
    ages = [level(time_s) for time_s in (1.1, 2.0, 3.0, 5.0)]
    assert ages == sorted(ages, reverse=True)
    assert ages[0] == pytest.approx(255, abs=1)  # 280 clipped: still exposed for the dark wall
    # ln exposure has gone 1 − exp(−2/2) of the way at 3 s, in eighths
    assert ages[2] == pytest.approx(70 * 4 ** np.exp(-1), rel=4 ** (1 / 16) - 1)
    still = render(Scene(walls), Camera(64, 48, 60.0), poses[-1], "exact")
    assert apply_sensor(still, sensor, rng()).image.mean() == pytest.approx(70, abs=0.6)
