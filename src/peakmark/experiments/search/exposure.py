"""What light and a camera make of printed levels, at random: as wide as photographs of floors, walls and desks are.

In the order of the light: paper's and ink's reflectance, lamps (ramps, shadow edges, gloss), the lens (defocus that
varies over the image, motion), exposure, photon and read noise, clipping, tone curve, denoising, sharpening, JPEG.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

Levels = NDArray[np.float64]

_MOST_NOISE = 16.0
"""σ, grey levels."""


@dataclass(frozen=True)
class Exposure:
    """How strong each effect may be; the default is everyday light and cameras."""

    ramp: float = 1.0
    """Most that light changes over the image's width, share of its mean; ten times as steep in one image of five."""
    motion_px: float = 8.0
    """Longest path of a point during the exposure; of three images in ten."""
    defocus_px: float = 2.2
    """Most σ of the lens at one side of the image, where it is out of focus; of one image in four."""


def expose(printed: Levels, rng: np.random.Generator, limits: Exposure = Exposure()) -> NDArray[np.uint8]:
    """Return the (H, W) image of printed levels 0…255 (H, W)."""
    light = _reflectance(printed, rng) * _lamps(printed.shape, rng, limits)
    light = light + _gloss(printed.shape, rng)
    light = _through_lens(light, rng, limits)
    white = np.quantile(light, 0.98)
    light = light * np.exp(rng.uniform(np.log(0.25), np.log(1.6))) / max(white, 1e-3)
    tone = _tone_curve(rng)
    levels = 255 * tone(np.clip(_with_photon_noise(light, rng), 0, 1))
    levels = _processed(levels, rng)
    gray = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    if rng.random() < 0.5:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(55, 97))]
        gray = np.asarray(cv2.imdecode(cv2.imencode(".jpg", gray, quality)[1], cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    return gray


def _reflectance(printed: Levels, rng: np.random.Generator) -> Levels:
    """Return the share of light that ink and paper give back: files are sRGB, printers follow them more or less."""
    exponent = 2.2 if rng.random() < 0.5 else rng.uniform(1.0, 2.6)
    black, white = rng.uniform(0.01, 0.09), rng.uniform(0.6, 0.92)
    return np.asarray(black + (white - black) * (np.clip(printed, 0, 255) / 255) ** exponent)


def _lamps(shape: tuple[int, ...], rng: np.random.Generator, limits: Exposure) -> Levels:
    """Return the (H, W) light of a room: a plane, waves as short as a marker, and up to three shadow edges."""
    height, width = shape[0], shape[1]
    y, x = np.mgrid[:height, :width] / width
    light = np.ones((height, width))
    light += rng.uniform(0, limits.ramp) * _across(x, y, rng)
    if rng.random() < 0.2:
        periods = rng.uniform(2, 16)
        phase = 2 * np.pi * (periods * _across(x, y, rng) + rng.random())
        light *= 1 + rng.uniform(0, 0.8) * np.sin(phase)
    for _ in range(int(rng.choice([0, 0, 1, 1, 2, 3]))):
        edge = _across(x, y, rng) - rng.uniform(-0.4, 0.4)
        if rng.random() < 0.4:
            edge = edge + 0.03 * np.sin(2 * np.pi * (rng.uniform(2, 9) * _across(x, y, rng) + rng.random()))
        softness = np.exp(rng.uniform(np.log(0.4), np.log(25))) / width
        light *= 1 - rng.uniform(0.1, 0.75) * scipy.special.expit(np.clip(edge / softness, -40, 40))
    return np.clip(light, 0.03, None)


def _across(x: Levels, y: Levels, rng: np.random.Generator) -> Levels:
    """Return the distance along a random direction from the image's middle, image widths."""
    angle = rng.uniform(0, 2 * np.pi)
    return np.asarray(np.cos(angle) * (x - x[0].mean()) + np.sin(angle) * (y - y[:, 0].mean()))


def _gloss(shape: tuple[int, ...], rng: np.random.Generator) -> Levels:
    """Return the (H, W) mirror light of lamps: soft blobs, up to several times as bright as paper."""
    height, width = shape[0], shape[1]
    y, x = np.mgrid[:height, :width] / width
    light = np.zeros((height, width))
    if rng.random() < 0.7:
        return light
    for _ in range(int(rng.integers(1, 4))):
        along, down = x - rng.uniform(0, 1), y - rng.uniform(0, height / width)
        angle, longer = rng.uniform(0, np.pi), np.exp(rng.uniform(np.log(0.03), np.log(0.3)))
        shorter = longer * rng.uniform(0.3, 1)
        u, v = along * np.cos(angle) + down * np.sin(angle), down * np.cos(angle) - along * np.sin(angle)
        light += np.exp(rng.uniform(np.log(0.05), np.log(1.5))) * np.exp(-((u / longer) ** 2 + (v / shorter) ** 2) / 2)
    return light


def _through_lens(light: Levels, rng: np.random.Generator, limits: Exposure) -> Levels:
    """Return the light behind a lens that may be out of focus at one side, and that may move."""
    sharp: Levels = np.asarray(cv2.GaussianBlur(light, (0, 0), float(rng.uniform(0.25, 1.3))), dtype=np.float64)
    if rng.random() < 0.25:
        soft = np.asarray(cv2.GaussianBlur(sharp, (0, 0), float(rng.uniform(0.8, limits.defocus_px))))
        y, x = np.mgrid[: light.shape[0], : light.shape[1]] / light.shape[1]
        share = scipy.special.expit(6 * (_across(x, y, rng) - rng.uniform(-0.4, 0.4)))
        sharp = sharp * (1 - share) + soft * share
    if rng.random() < 0.3 and limits.motion_px > 1:
        sharp = moved(sharp, float(rng.uniform(1, limits.motion_px)), float(rng.uniform(0, 180)))
    return sharp


def moved(levels: Levels, length_px: float, angle_deg: float) -> Levels:
    """Return levels (H, W) averaged along a line of this length."""
    fine, reach = 16, int(np.ceil(length_px / 2)) + 1
    size = 2 * reach + 1
    steps = np.linspace(-0.5, 0.5, max(2, round(fine * length_px))) * length_px
    kernel = np.zeros((size, size))
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    for step in steps:
        x, y = reach + c * step, reach + s * step
        left, top = int(x), int(y)
        for row, column in ((top, left), (top, left + 1), (top + 1, left), (top + 1, left + 1)):
            kernel[row, column] += (1 - abs(x - column)) * (1 - abs(y - row))
    blurred = cv2.filter2D(levels, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float64)


def _with_photon_noise(light: Levels, rng: np.random.Generator) -> Levels:
    """Return the light with noise of photons and of reading; σ at white is 0.5…16 grey levels in all."""
    at_white = np.exp(rng.uniform(np.log(0.3), np.log(9 if rng.random() < 0.85 else _MOST_NOISE))) / 255
    by_reading = rng.uniform(0.1, 0.8)
    sigma = at_white * np.sqrt(by_reading**2 + (1 - by_reading**2) * np.clip(light, 0, 4))
    return np.asarray(light + sigma * rng.standard_normal(light.shape))


def _tone_curve(rng: np.random.Generator) -> Callable[[Levels], Levels]:
    """Return the curve from linear light 0…1 to levels 0…1: sRGB, a phone's S, a linear camera, or any gamma."""
    kind = rng.choice(["srgb", "phone", "linear", "gamma"], p=[0.4, 0.3, 0.12, 0.18])
    if kind == "linear":
        return lambda light: light
    gamma = rng.uniform(1 / 2.4, 2.4) if kind == "gamma" else 2.2
    steepness = rng.uniform(2.5, 7) if kind == "phone" else 0.0
    middle = rng.uniform(0.35, 0.6)

    def curve(light: Levels) -> Levels:
        encoded = light ** (1 / gamma)
        if not steepness:
            return encoded
        low, high = scipy.special.expit(-steepness * middle), scipy.special.expit(steepness * (1 - middle))
        return np.asarray((scipy.special.expit(steepness * (encoded - middle)) - low) / (high - low))

    return curve


def _processed(levels: Levels, rng: np.random.Generator) -> Levels:
    """Return what a camera's own software makes of the levels: denoised, sharpened, enlarged."""
    if rng.random() < 0.25:
        small = np.clip(levels, 0, 255).astype(np.float32)
        sigma = float(rng.uniform(5, 25))
        levels = np.asarray(cv2.bilateralFilter(small, 5, sigma, 1.5), dtype=np.float64)
    if rng.random() < 0.1:
        levels = np.asarray(cv2.GaussianBlur(levels, (0, 0), float(rng.uniform(0.4, 0.9))))
    if rng.random() < 0.35:
        soft = cv2.GaussianBlur(levels, (0, 0), float(rng.uniform(0.7, 2.0)))
        levels = levels + rng.uniform(0.2, 2.0) * (levels - np.asarray(soft))
    return levels
