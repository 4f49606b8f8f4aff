"""What optics and electronics of a camera do to linear grey levels; every effect is off by default.

In the order of the light: lens blur (Gaussian, disc), vignetting, exposure, photon noise, gain, read noise, response
curve, quantisation, JPEG. The noise of a frame comes from the Generator that is passed in.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from peaksim.camera.frame import Frame
from peaksim.errors import SceneError

Levels = NDArray[np.float32]

WHITE = 255.0
"""Linear grey level of white."""


@dataclass(frozen=True)
class Sensor:
    """Settings; the default only rounds the image.

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
    """Response curve: output = 255·(level/255)^(1/gamma), 0.1…10; 1 is linear."""
    bits: int = 8
    """Resolution of the converter, 1…8 bits; the image stays uint8."""
    jpeg_quality: int = 0
    """1…100; 0 for no compression."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("lens_blur_px", 0, 50),
            ("defocus_px", 0, 50),
            ("vignetting", 0, 1),
            ("exposure", 0, 100),
            ("full_well_e", 0, 1e9),
            ("gain", 0, 100),
            ("read_noise", 0, 255),
            ("gamma", 0.1, 10),
            ("bits", 1, 8),
            ("jpeg_quality", 0, 100),
        ):
            value = getattr(self, name)
            whole = name in ("bits", "jpeg_quality")
            if (
                isinstance(value, bool)
                or not isinstance(value, int if whole else int | float)
                or not low <= value <= high
            ):
                kind = "a whole number" if whole else "a number"
                raise SceneError(f"sensor.{name}: expected {kind} in {low:g}…{high:g}, got {value!r}")


def apply_sensor(frame: Frame, sensor: Sensor, rng: np.random.Generator) -> Frame:
    """Return the frame with its image as the sensor gives it; truth stays."""
    return replace(frame, image=capture_image(frame.linear, sensor, rng))


def capture_image(linear: Levels, sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the uint8 image of linear grey levels.

    Parameters
    ----------
    linear
        (H, W) or (H, W, 3) float32, 255 is white; levels may exceed it.
    sensor
        Settings.
    rng
        Source of photon and read noise; a sensor without noise draws nothing.
    """
    levels = linear
    if sensor.lens_blur_px > 0:
        levels = gaussian_blur(levels, sensor.lens_blur_px)
    if sensor.defocus_px > 0:
        levels = disc_blur(levels, sensor.defocus_px)
    if sensor.vignetting > 0:
        levels = _per_pixel(levels, vignette(levels.shape[0], levels.shape[1], sensor.vignetting))
    if sensor.exposure != 1:
        levels = levels * np.float32(sensor.exposure)
    if sensor.full_well_e > 0:
        levels = photon_noise(levels, sensor.full_well_e, rng)
    if sensor.gain != 1:
        levels = levels * np.float32(sensor.gain)
    if sensor.read_noise > 0:
        levels = levels + np.float32(sensor.read_noise) * rng.standard_normal(levels.shape, dtype=np.float32)
    if sensor.gamma != 1:
        levels = np.float32(WHITE) * (np.clip(levels, 0, None) / np.float32(WHITE)) ** np.float32(1 / sensor.gamma)
    image = quantise(levels, sensor.bits)
    return compress_jpeg(image, sensor.jpeg_quality) if sensor.jpeg_quality else image


def gaussian_blur(levels: Levels, sigma_px: float) -> Levels:
    """Return the levels blurred by a Gaussian that is cut at 4 σ; the image is mirrored at its border."""
    for axis in (0, 1):
        levels = gaussian_filter1d(levels, sigma_px, axis=axis, mode="mirror", truncate=4.0)
    return levels


def disc_blur(levels: Levels, radius_px: float) -> Levels:
    """Return the levels blurred by a disc, a defocused lens's image of a point."""
    kernel = disc_kernel(radius_px)
    return np.asarray(cv2.filter2D(levels, -1, kernel, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)


@lru_cache(maxsize=8)
def disc_kernel(radius_px: float) -> Levels:
    """Return the (2r+1, 2r+1) shares of a centred disc in each pixel, by 32×32 samples a pixel; they sum to 1."""
    fine = 32
    half = int(np.ceil(radius_px - 0.5)) if radius_px > 0.5 else 0
    offsets = (np.arange((2 * half + 1) * fine) + 0.5) / fine - half - 0.5
    inside = offsets[:, None] ** 2 + offsets[None, :] ** 2 <= max(radius_px, 1e-3) ** 2
    shares = inside.reshape(2 * half + 1, fine, 2 * half + 1, fine).mean(axis=(1, 3))
    if shares.sum() == 0:  # a disc that falls between the samples is a point
        shares[half, half] = 1
    return np.asarray(shares / shares.sum(), dtype=np.float32)


def vignette(height: int, width: int, corner_loss: float) -> Levels:
    """Return the (height, width) share of light that passes: 1 in the middle, 1 − `corner_loss` in the corners."""
    return np.float32(1) - np.float32(corner_loss) * _falloff(height, width)


@lru_cache(maxsize=2)
def _falloff(height: int, width: int) -> Levels:
    """Return the fourth power of the (height, width) distance from the middle, 1 in the corners."""
    y, x = np.ogrid[:height, :width]
    radius2 = (x - (width - 1) / 2) ** 2 + (y - (height - 1) / 2) ** 2
    corner2 = max(((width - 1) ** 2 + (height - 1) ** 2) / 4, 1.0)
    return np.asarray((radius2 / corner2) ** 2, dtype=np.float32)


def _per_pixel(levels: Levels, factor: Levels) -> Levels:
    return np.asarray(levels * (factor if levels.ndim == 2 else factor[:, :, None]), dtype=np.float32)


def photon_noise(levels: Levels, full_well_e: float, rng: np.random.Generator) -> Levels:
    """Return Poisson-distributed levels: `full_well_e` electrons are level 255."""
    electrons = np.clip(levels, 0, None).astype(np.float64) * (full_well_e / WHITE)
    return np.asarray(rng.poisson(electrons) * (WHITE / full_well_e), dtype=np.float32)


def quantise(levels: Levels, bits: int = 8) -> NDArray[np.uint8]:
    """Return the levels clipped to 0…255 and rounded once to 2^bits equal steps."""
    if bits == 8:
        return np.asarray(np.clip(np.rint(levels), 0, WHITE), dtype=np.uint8)
    steps = 2**bits - 1
    codes = np.clip(np.rint(levels * np.float32(steps / WHITE)), 0, steps)
    return np.asarray(np.rint(codes * (WHITE / steps)), dtype=np.uint8)


def compress_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return the image after JPEG at a quality of 1…100."""
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=quality)
    buffer.seek(0)
    return np.array(Image.open(buffer))
