"""What optics and electronics of a camera do to linear grey levels; every effect is off by default.

In the order of the light: lens blur (Gaussian, disc), chromatic aberration, vignetting, exposure, colour filters,
photon noise, gain, hot pixels, read noise, demosaicing, tone curve, sharpening, quantisation, JPEG. The noise of a
frame comes from the Generator that is passed in; which photosites are hot belongs to the sensor.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peaksim.camera.frame import Frame
from peaksim.camera.mosaic import MOSAICS, behind_filters, demosaic
from peaksim.camera.optics import LUMA, Levels, disc_blur, gaussian_blur, shift_colours, vignette
from peaksim.camera.tone import Points, check_tone, coded
from peaksim.errors import SceneError

WHITE = 255.0
"""Linear grey level of white."""

_METERINGS = 8
"""Moments of the past that an automatic exposure looks back at."""

OUTPUTS = ("image", "grey", "rgb", "raw")

_RANGES = {
    "lens_blur_px": (0, 50),
    "defocus_px": (0, 50),
    "chromatic_aberration_px": (0, 50),
    "vignetting": (0, 1),
    "auto_exposure": (0, 255),
    "adaptation_s": (0, 100),
    "exposure": (0, 100),
    "full_well_e": (0, 1e9),
    "gain": (0, 100),
    "hot_pixels": (0, 0.1),
    "hot_seed": (0, 2**31),
    "read_noise": (0, 255),
    "gamma": (0.1, 10),
    "sharpening": (0, 5),
    "sharpening_px": (0.1, 10),
    "bits": (1, 16),
    "jpeg_quality": (0, 100),
}
WHOLE = ("hot_seed", "bits", "jpeg_quality")
"""Fields that are whole numbers."""


@dataclass(frozen=True)
class Sensor:
    """Settings; the default only rounds the image. `peaksim.camera.presets` has cameras by name.

    Raises
    ------
    SceneError
        It names the field and its range.
    """

    lens_blur_px: float = 0.0
    """σ of a Gaussian, px; 0…50."""
    defocus_px: float = 0.0
    """Radius of a disc, px; 0…50."""
    vignetting: float = 0.0
    """Share of the light that is lost in the corners, 0…1; it grows with the fourth power of the radius."""
    exposure: float = 1.0
    """Multiplier of the light before noise, 0…100."""
    full_well_e: float = 0.0
    """Electrons at grey level 255 and gain 1, which make the photon noise; 0 for none."""
    gain: float = 1.0
    """Multiplier after the photon noise, 0…100."""
    read_noise: float = 0.0
    """σ in grey levels before the response curve, 0…255."""
    gamma: float = 1.0
    """Power after the tone curve: output = 255·(level/255)^(1/gamma), 0.1…10; 1 is none."""
    bits: int = 8
    """Resolution of the converter, 1…16 bits; the image is uint8, and from 9 bits on uint16, both over their range."""
    jpeg_quality: int = 0
    """1…100, for up to 8 bits; 0 for no compression."""
    chromatic_aberration_px: float = 0.0
    """How far red is outside blue in the corners, px, 0…50; grey levels stay where they are."""
    auto_exposure: float = 0.0
    """Linear level that the exposure brings the geometric mean of the image to, before `exposure`; 0 for none."""
    adaptation_s: float = 0.0
    """Time constant with which the automatic exposure follows along a trajectory, s, 0…100; 0 follows at once."""
    mosaic: str = "none"
    """Colour filters over the photosites: "rggb", "bggr", "grbg", "gbrg", or "none"."""
    hot_pixels: float = 0.0
    """Share of photosites with a dark current, 0…0.1: exponential, of mean 127 grey levels, the same in all frames."""
    hot_seed: int = 0
    """Which ones: another number is another camera of the kind."""
    tone: str | Points = "linear"
    """Tone curve: "linear", "srgb", "s-curve" (the mean of measured cameras), or points (linear, coded), each 0…1."""
    sharpening: float = 0.0
    """Unsharp mask: so many times the difference from a blurred image is added to all colours, 0…5."""
    sharpening_px: float = 1.0
    """σ of that blur, px, 0.1…10."""
    output: str = "image"
    """"image" has the channels of the scene, "grey" and "rgb" one and three; "raw" are the (H, W) levels of the
    photosites, linear, before demosaicing, tone curve, sharpening and JPEG; without a mosaic as many as the scene."""
    name: str = ""
    """Of the camera that it stands for; it changes nothing."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            whole = name in WHOLE
            if (
                isinstance(value, bool)
                or not isinstance(value, int if whole else int | float)
                or not low <= value <= high
            ):
                kind = "a whole number" if whole else "a number"
                raise SceneError(f"sensor.{name}: expected {kind} in {low:g}…{high:g}, got {value!r}")
        for name, known in (("mosaic", ("none", *MOSAICS)), ("output", OUTPUTS)):
            if getattr(self, name) not in known:
                raise SceneError(f"sensor.{name}: expected one of {', '.join(known)}, got {getattr(self, name)!r}")
        if not isinstance(self.name, str):
            raise SceneError(f"sensor.name: expected a name, got {self.name!r}")
        object.__setattr__(self, "tone", check_tone(self.tone, "sensor.tone"))
        if self.bits > 8 and self.jpeg_quality and self.output != "raw":
            raise SceneError(f"sensor.jpeg_quality: expected 0 with more than 8 bits, got {self.jpeg_quality}")


def apply_sensor(frame: Frame, sensor: Sensor, rng: np.random.Generator) -> Frame:
    """Return the frame with its image as the sensor gives it; truth stays.

    Along a trajectory an automatic exposure follows with `adaptation_s` what the camera has seen before.
    """
    return replace(frame, image=capture_image(frame.linear, _adapted(sensor, frame), rng))


def _adapted(sensor: Sensor, frame: Frame) -> Sensor:
    """Return a sensor whose automatic exposure has followed the light up to the frame's time, and is now fixed.

    A low-pass filter of the exposure's logarithm: its mean over the past, weighted by exp(−age/adaptation_s). It is
    computed for each frame alone, so that frames need no order.
    """
    times_s = frame.posed_camera.trajectory.times_s
    if not (sensor.auto_exposure > 0 and sensor.adaptation_s > 0 and len(times_s) > 1):
        return sensor
    ages_s = -sensor.adaptation_s * np.log(1 - (np.arange(_METERINGS) + 0.5) / _METERINGS)
    moments, counts = np.unique(np.maximum(frame.time_s - ages_s, times_s[0]), return_counts=True)
    log_levels = [np.log(metered(frame.preview(float(time_s)))) for time_s in moments]
    level = float(np.exp(np.average(log_levels, weights=counts)))
    return _exposed(sensor, level)


def _exposed(sensor: Sensor, level: float) -> Sensor:
    """Return a sensor with the fixed exposure that brings a level to `auto_exposure`."""
    exposure = min(sensor.exposure * sensor.auto_exposure / level, _RANGES["exposure"][1])
    return replace(sensor, auto_exposure=0.0, exposure=float(exposure))


def capture_image(linear: Levels, sensor: Sensor, rng: np.random.Generator) -> NDArray[Any]:
    """Return the image of linear grey levels, uint8, or uint16 from 9 bits on.

    Parameters
    ----------
    linear
        (H, W) or (H, W, 3) float32, 255 is white; levels may exceed it.
    sensor
        Settings.
    rng
        Source of photon and read noise; a sensor without noise draws nothing.
    """
    if sensor.auto_exposure > 0:
        sensor = _exposed(sensor, metered(linear))
    light = _optics(linear, sensor)
    is_grey = sensor.output == "grey" or (sensor.output != "rgb" and linear.ndim == 2)
    if is_grey and sensor.mosaic == "none":
        light = _with_channels(light, 1)
    sites = _electronics(light, sensor, rng)
    if sensor.output == "raw":
        return quantise(sites, sensor.bits)
    levels = sites if sensor.mosaic == "none" else demosaic(sites, sensor.mosaic)
    levels = _developed(np.clip(levels, 0, WHITE), sensor)
    image = quantise(_with_channels(levels, 1 if is_grey else 3), sensor.bits)
    return compress_jpeg(image, sensor.jpeg_quality) if sensor.jpeg_quality else image


def _optics(levels: Levels, sensor: Sensor) -> Levels:
    """Return the light on the photosites, before exposure; colours where they part."""
    if sensor.lens_blur_px > 0:
        levels = gaussian_blur(levels, sensor.lens_blur_px)
    if sensor.defocus_px > 0:
        levels = disc_blur(levels, sensor.defocus_px)
    if sensor.chromatic_aberration_px > 0:
        levels = shift_colours(_with_channels(levels, 3), sensor.chromatic_aberration_px)
    if sensor.vignetting > 0:
        levels = _per_pixel(levels, vignette(levels.shape[0], levels.shape[1], sensor.vignetting))
    return levels


def _electronics(levels: Levels, sensor: Sensor, rng: np.random.Generator) -> Levels:
    """Return what the photosites read."""
    if sensor.exposure != 1:
        levels = levels * np.float32(sensor.exposure)
    if sensor.mosaic != "none":
        levels = behind_filters(_with_channels(levels, 3), sensor.mosaic)
    if sensor.full_well_e > 0:
        levels = photon_noise(levels, sensor.full_well_e, rng)
    if sensor.gain != 1:
        levels = levels * np.float32(sensor.gain)
    if sensor.hot_pixels > 0:
        levels = levels + hot_levels(levels.shape, sensor.hot_pixels, sensor.hot_seed)
    if sensor.read_noise > 0:
        levels = levels + np.float32(sensor.read_noise) * rng.standard_normal(levels.shape, dtype=np.float32)
    return np.clip(levels, None, WHITE) if sensor.mosaic != "none" else levels


def _developed(levels: Levels, sensor: Sensor) -> Levels:
    """Return levels after tone curve, gamma and sharpening."""
    if sensor.tone != "linear":
        levels = np.float32(WHITE) * coded(levels / np.float32(WHITE), sensor.tone)
    if sensor.gamma != 1:
        levels = np.float32(WHITE) * (levels / np.float32(WHITE)) ** np.float32(1 / sensor.gamma)
    if sensor.sharpening > 0:
        grey = _with_channels(levels, 1)
        detail = np.float32(sensor.sharpening) * (grey - gaussian_blur(grey, sensor.sharpening_px))
        levels = levels + (detail if levels.ndim == 2 else detail[:, :, None])
    return levels


def metered(levels: Levels) -> float:
    """Return the geometric mean of linear levels, those below 1 counted as 1: lamps in view hardly change it."""
    return float(np.exp(np.log(np.maximum(levels, 1)).mean(dtype=np.float64)))


def _with_channels(levels: Levels, channels: int) -> Levels:
    """Return (H, W) levels as three equal colours, or (H, W, 3) as grey, where that is not what they are."""
    if channels == 3:
        return levels if levels.ndim == 3 else np.repeat(levels[:, :, None], 3, axis=2)
    return levels if levels.ndim == 2 else levels @ np.array(LUMA, dtype=np.float32)


def _per_pixel(levels: Levels, factor: Levels) -> Levels:
    return np.asarray(levels * (factor if levels.ndim == 2 else factor[:, :, None]), dtype=np.float32)


def photon_noise(levels: Levels, full_well_e: float, rng: np.random.Generator) -> Levels:
    """Return Poisson-distributed levels: `full_well_e` electrons are level 255."""
    electrons = np.clip(levels, 0, None).astype(np.float64) * (full_well_e / WHITE)
    return np.asarray(rng.poisson(electrons) * (WHITE / full_well_e), dtype=np.float32)


@lru_cache(maxsize=2)
def hot_levels(shape: tuple[int, ...], share: float, seed: int) -> Levels:
    """Return what the dark current of hot photosites adds to each level, 0 for the others."""
    rng = np.random.default_rng((seed, *shape))
    is_hot = rng.random(shape, dtype=np.float32) < share
    return np.where(is_hot, np.float32(WHITE / 2) * rng.standard_exponential(shape, dtype=np.float32), np.float32(0))


def quantise(levels: Levels, bits: int = 8) -> NDArray[Any]:
    """Return the levels clipped to 0…255 and rounded once to 2^bits equal steps.

    Up to 8 bits the steps spread over 0…255 of uint8, else over 0…65535 of uint16.
    """
    if bits == 8:
        return np.asarray(np.clip(np.rint(levels), 0, WHITE), dtype=np.uint8)
    steps = 2**bits - 1
    codes = np.clip(np.rint(levels * np.float32(steps / WHITE)), 0, steps)
    if bits < 8:
        return np.asarray(np.rint(codes * (WHITE / steps)), dtype=np.uint8)
    return np.asarray(np.rint(codes.astype(np.float64) * (65535 / steps)), dtype=np.uint16)


def compress_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return the image after JPEG at a quality of 1…100."""
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=quality)
    buffer.seek(0)
    return np.array(Image.open(buffer))
