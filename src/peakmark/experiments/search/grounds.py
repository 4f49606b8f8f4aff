"""What markers lie on and what is not a marker: photographs, and drawn images of leaves, stars and text."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

DRAWN = ("leaves", "stars", "text", "waves", "tiles")
"""Kinds of drawn grounds."""

_GROUND_PX = 512


def random_ground(rng: np.random.Generator, photos: Mapping[str, Image]) -> Image:
    """Return a photograph (two of three), mirrored, rotated, or as its negative at times, or something drawn."""
    if rng.random() < 1 / 3:
        return draw_ground(str(rng.choice(DRAWN)), rng)
    photo = photos[str(rng.choice(list(photos)))]
    photo = np.rot90(photo, int(rng.integers(4)))
    photo = photo[:, ::-1] if rng.random() < 0.5 else photo
    photo = 255 - photo if rng.random() < 0.2 else photo
    return np.ascontiguousarray(photo)


def draw_ground(kind: str, rng: np.random.Generator, size_px: int = _GROUND_PX) -> Image:
    """Return a square image of one of `DRAWN`."""
    draw = {"leaves": _leaves, "stars": _stars, "text": _text, "waves": _waves, "tiles": _tiles}[kind]
    return np.asarray(np.clip(np.rint(draw(rng, size_px)), 0, 255), dtype=np.uint8)


def _leaves(rng: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return discs and rectangles over one another, radii by r⁻³: edges and blobs as photographs have.

    The dead leaves model (Lee, Mumford & Huang 2001, doi:10.1023/A:1011109015675).
    """
    image = np.full((size, size), rng.uniform(0, 255), np.float32)
    radii = 1 / np.sqrt(rng.uniform(1 / 90**2, 1 / 3.0**2, 3000))
    for radius in radii:
        x, y = (int(value) for value in rng.integers(0, size, 2))
        level, half = float(rng.uniform(0, 255)), int(radius)
        if rng.random() < 0.6:
            cv2.circle(image, (x, y), half, level, -1, cv2.LINE_AA if half > 4 else cv2.LINE_8)
        else:
            corners = cv2.boxPoints(((x, y), (2 * half, half * float(rng.uniform(0.5, 2))), float(rng.uniform(0, 90))))
            cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), level)
    return np.asarray(cv2.GaussianBlur(image, (0, 0), float(rng.uniform(0.3, 1.5))), dtype=np.float64)


def _stars(rng: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return soft blobs of many sizes, light on dark or dark on light."""
    image = np.full((size, size), rng.uniform(0, 60))
    y, x = np.mgrid[:size, :size]
    for _ in range(int(rng.integers(60, 200))):
        radius = 2 / np.sqrt(rng.uniform(0.002, 1))
        cx, cy = rng.uniform(0, size, 2)
        reach = int(4 * radius) + 1
        part = np.s_[max(0, int(cy) - reach) : int(cy) + reach, max(0, int(cx) - reach) : int(cx) + reach]
        ratio, angle = rng.uniform(0.5, 1), rng.uniform(0, np.pi)
        u = (x[part] - cx) * np.cos(angle) + (y[part] - cy) * np.sin(angle)
        v = ((y[part] - cy) * np.cos(angle) - (x[part] - cx) * np.sin(angle)) / ratio
        away = (u**2 + v**2) / radius**2
        image[part] += rng.uniform(30, 250) * (np.exp(-away / 2) if rng.random() < 0.7 else (away < 1))
    return image if rng.random() < 0.6 else 255 - np.clip(image, 0, 255)


def _text(rng: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return lines of letters, dark on light or light on dark."""
    paper, ink = rng.uniform(150, 255), rng.uniform(0, 110)
    image = np.full((size, size), paper, np.float32)
    fonts = (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX, cv2.FONT_HERSHEY_TRIPLEX)
    letters = np.array(list("aabbcdeegghiklmnoopqrsstuw ABDGOPQRS0345689.,:;%&@#*"))
    y = 10
    while y < size:
        scale = float(np.exp(rng.uniform(np.log(0.35), np.log(2.2))))
        y += int(34 * scale)
        line = "".join(rng.choice(letters, 80))
        font, weight = int(rng.choice(fonts)), max(1, round(2.5 * scale * float(rng.uniform(0.5, 1.6))))
        cv2.putText(image, line, (8, y), font, scale, ink, weight, cv2.LINE_AA)
    return np.asarray(image if rng.random() < 0.7 else 255 - image, dtype=np.float64)


def _waves(rng: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return noise whose power falls with frequency, as stone and cloth have."""
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None])
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)))
    image = np.fft.irfft2(spectrum / np.maximum(frequency, 1 / size) ** rng.uniform(0.7, 1.8), (size, size))
    return np.asarray(rng.uniform(90, 170) + rng.uniform(20, 70) * image / image.std())


def _tiles(rng: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return a floor of tiles with small insets, squares in squares and dots."""
    image = np.full((size, size), rng.uniform(100, 255), np.float32)
    pitch = int(rng.integers(24, 120))
    joint = float(rng.uniform(0, 200))
    for low in range(0, size, pitch):
        cv2.line(image, (low, 0), (low, size), joint, max(1, pitch // 20))
        cv2.line(image, (0, low), (size, low), joint, max(1, pitch // 20))
    radii = sorted(rng.uniform(0.06, 0.4, int(rng.integers(1, 4))) * pitch, reverse=True)
    levels, is_round = rng.uniform(0, 255, len(radii)), rng.random() < 0.5
    for x in range(pitch // 2, size, pitch):
        for y in range(pitch // 2, size, pitch):
            for radius, level in zip(radii, levels, strict=True):
                half = max(1, int(radius))
                if is_round:
                    cv2.circle(image, (x, y), half, float(level), -1)
                else:
                    cv2.rectangle(image, (x - half, y - half), (x + half, y + half), float(level), -1)
    return np.asarray(image + rng.normal(0, rng.uniform(0, 6), image.shape), dtype=np.float64)
