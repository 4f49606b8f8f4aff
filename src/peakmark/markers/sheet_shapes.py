"""What a printed page is made of: boxes, discs, DoGs and lines of text, in millimetres; x right, y down."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import ImageFont

from peakmark.markers.patterns import DOG_RATIO, Polarity


@dataclass(frozen=True)
class Box:
    """A filled rectangle."""

    x_mm: float
    y_mm: float
    """Left and top edge."""
    width_mm: float
    height_mm: float
    gray: float
    """Grey level, 0…255."""


@dataclass(frozen=True)
class Disc:
    """A filled circle."""

    x_mm: float
    y_mm: float
    """Centre."""
    radius_mm: float
    gray: float
    """Grey level, 0…255."""


@dataclass(frozen=True)
class Dog:
    """A square filled with the DoG marker, stretched to 0…255."""

    x_mm: float
    y_mm: float
    """Centre."""
    side_mm: float
    """Side of the square."""
    sigma_mm: float
    """σ of the inner Gaussian."""
    polarity: Polarity


@dataclass(frozen=True)
class Text:
    """One line of black small print."""

    x_mm: float
    y_mm: float
    """Left end of the baseline."""
    height_mm: float
    """Font size."""
    text: str
    """Printable characters of Latin-1."""


def text_length(text: str) -> float:
    """Return the length of a line in its heights, the longer of Pillow's font (PNG) and Helvetica's (PDF, SVG)."""
    return max(sum(map(_helvetica_width, text)), _FONT.getlength(text) / 100)


def _helvetica_width(letter: str) -> float:
    """Return the width in font sizes, rounded up (Adobe's font metrics have four digits a letter)."""
    if letter in "ijlI ,.:;!|'/":
        return 0.28
    if letter in "WM@%Æ¼½¾©®":
        return 1.02
    if letter in "mw" or letter.isupper() or not letter.isascii():
        return 0.9
    return 0.56 if letter.isalnum() else 0.67


_FONT = ImageFont.load_default(size=100)


Item = Box | Disc | Dog | Text


def dog_discs(item: Dog, steps: int = 1040) -> tuple[Box | Disc, ...]:
    """Return a DoG as a square and `steps` concentric discs, largest first, below 1.2 grey levels apart.

    The largest disc stays inside the square, at 5.8 σ, where the DoG has reached its far level.
    """
    half = item.side_mm / 2
    reach = 0.97 * half
    radii = reach * np.arange(steps, 0, -1) / steps
    grays = dog_gray((radii - reach / (2 * steps)) / item.sigma_mm, item.polarity)
    far = float(dog_gray(np.array([np.inf]), item.polarity)[0])
    square = Box(item.x_mm - half, item.y_mm - half, item.side_mm, item.side_mm, far)
    discs = [Disc(item.x_mm, item.y_mm, float(r), float(g)) for r, g in zip(radii, grays, strict=True)]
    return (square, *discs)


def dog_gray(radius_in_sigma: NDArray[np.float64], polarity: Polarity) -> NDArray[np.float64]:
    """Return the grey level 0…255 of the DoG marker at distances from its centre."""
    half_r2 = np.asarray(radius_in_sigma, dtype=np.float64) ** 2 / 2
    profile = np.exp(-half_r2 / DOG_RATIO**2) / DOG_RATIO**2 - np.exp(-half_r2)
    low, high = 1 / DOG_RATIO**2 - 1, _dog_brim()
    dark = 255 * (profile - low) / (high - low)
    return np.asarray(dark if polarity == "dark" else 255 - dark)


def _dog_brim() -> float:
    """Return the largest value of G(kσ) − G(σ), times 2πσ²: at r² = 8 σ² k² ln k / (k² − 1)."""
    k2 = DOG_RATIO**2
    half_r2 = 2 * k2 * np.log(k2) / (k2 - 1)
    return float(np.exp(-half_r2 / k2) / k2 - np.exp(-half_r2))
