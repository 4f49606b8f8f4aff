"""Posters on a wall, drawn by OpenCV's warping, independent of the renderers."""

import cv2
import numpy as np
from numpy.typing import NDArray

from peakmark.markers.array_code import THREE_BIT, polarities_of
from peakmark.markers.patterns import Polarity, surf_marker

TEXELS = 72


def sheet(code: int, white: int = 255) -> NDArray[np.uint8]:
    """Return an array on paper, 4 × 4 sides."""
    paper = np.full((4 * TEXELS, 4 * TEXELS), white, np.uint8)
    middle = 2 * TEXELS
    step = THREE_BIT.pitch * TEXELS / 2
    for (column, row), polarity in zip(THREE_BIT.cells, polarities_of(code), strict=True):
        left, top = (int(middle + (2 * k - 1) * step - TEXELS / 2) for k in (column, row))
        paper[top : top + TEXELS, left : left + TEXELS] = surf_marker(TEXELS, polarity)
    return paper


def centers(code: int) -> dict[tuple[int, int], Polarity]:
    """Return (column, row) → polarity of an array's markers."""
    return dict(zip(THREE_BIT.cells, polarities_of(code), strict=True))


def wall(
    papers: list[tuple[NDArray[np.uint8], float, float, float, float]],
    size: tuple[int, int] = (480, 360),
    seed: int = 0,
) -> NDArray[np.uint8]:
    """Return papers (texels, x, y, side of a marker in px, rotation in degrees) on plaster, softened, with noise."""
    rng, fine = np.random.default_rng(seed), 3
    rough = cv2.GaussianBlur(rng.normal(0, 60, (size[1], size[0])).astype(np.float32), (0, 0), 4)
    canvas = cv2.resize(140 + rough, (size[0] * fine, size[1] * fine))
    for paper, x, y, side_px, rotation_deg in papers:
        scale = side_px * fine / TEXELS
        middle = ((paper.shape[1] - 1) / 2, (paper.shape[0] - 1) / 2)
        warp = cv2.getRotationMatrix2D(middle, rotation_deg, scale)
        warp[:, 2] += np.array([(x + 0.5) * fine - 0.5 - middle[0], (y + 0.5) * fine - 0.5 - middle[1]])
        drawn = cv2.warpAffine(paper.astype(np.float32), warp, canvas.shape[::-1], flags=cv2.INTER_AREA)
        mask = cv2.warpAffine(np.ones(paper.shape, np.float32), warp, canvas.shape[::-1])
        canvas = canvas * (1 - mask) + drawn * mask
    small = cv2.resize(canvas, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), 0.6) + rng.normal(0, 2, small.shape)
    return np.clip(np.rint(small), 0, 255).astype(np.uint8)
