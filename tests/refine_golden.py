"""Alignments as the kernels gave them when Numba compiled them, at commit a8ff718; the C kernels are held to these.

`python -m tests.refine_golden` writes them anew, from whatever kernels there are; `refine/test_golden.py` compares.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skimage import data

from peakmark.identification.alignment import _SHIFTS, lit_pattern, lit_template
from peakmark.identification.correlation import correlate_candidates
from peakmark.markers.patterns import Variant
from peakmark.refine.align import align, chosen_pixels, shape_grid
from peakmark.refine.api import coarse_template, known_pattern
from peakmark.refine.lit import lit_residuals
from peakmark.refine.model import Pattern, predict, residuals
from tests.places import GOLDEN

PATH = GOLDEN / "native" / "refine.npz"
FOCAL_PX = 500.0


@dataclass(frozen=True)
class Views:
    """An image of markers on a photograph, and where a detector would say that they are; the last ones are none."""

    image: NDArray[np.uint8]
    xy: NDArray[np.float64]
    sides_px: NDArray[np.float64]


def drawn_views() -> Views:
    """Return the (384, 512) image: twelve markers of 12…90 px, tilted, blurred, in ramps of light, and noise."""
    rng = np.random.default_rng(17)
    image = np.asarray(data.camera(), dtype=np.float64)[:384].copy()
    pattern = known_pattern("surf-dark", 0.0)
    centers = [(60 + 120 * (k % 4), 60 + 125 * (k // 4)) for k in range(12)]
    sides = np.array([12, 15, 18, 22, 26, 30, 36, 42, 50, 60, 75, 90.0])
    for (x, y), side in zip(centers, sides, strict=True):
        tilt, turn, axis = rng.uniform(0, 1.1), rng.uniform(0, 6.3), rng.uniform(0, 3.1)
        along = np.array([[np.cos(axis), -np.sin(axis)], [np.sin(axis), np.cos(axis)]])
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        squeezed = along @ np.diag([1 / np.sqrt(np.cos(tilt)), np.sqrt(np.cos(tilt))]) @ along.T @ turned
        theta = np.array([x, y, *(side * squeezed).ravel(), 0.02, -0.03, 150.0, 40.0, rng.uniform(0.1, 1.5)])
        columns, rows = np.meshgrid(np.arange(x - 59, x + 60), np.arange(y - 59, y + 60))
        xy = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
        inside = np.abs(np.linalg.solve(squeezed, (xy - [x, y]).T / side)).max(axis=0) < 0.61
        ramp = 1 + rng.uniform(-0.3, 0.3) * (xy[:, 0] - x) / side
        shown = predict(theta, xy, pattern) * ramp
        image[rows.ravel()[inside], columns.ravel()[inside]] = shown[inside]
    image += rng.normal(0, 3, image.shape)
    others = rng.uniform([20, 20], [490, 360], (6, 2))
    gray = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    xy = np.concatenate([np.array(centers) + rng.normal(0, 0.02, (12, 2)) * sides[:, None], others])
    return Views(gray, xy, np.concatenate([sides * rng.uniform(0.85, 1.15, 12), rng.uniform(12, 60, 6)]))


def measure(views: Views) -> dict[str, NDArray[np.float64]]:
    """Return what the kernels make of the views, as columns."""
    return {**_aligned(views), **_correlated(views), **_derivatives(views)}


def _aligned(views: Views) -> dict[str, NDArray[np.float64]]:
    pattern = known_pattern("surf-dark", 0.0)
    extra = (pattern.lines, pattern.levels, pattern.extent, FOCAL_PX, *coarse_template("surf-dark", 0.0), shape_grid())
    fits = [align(views.image, *view, *extra) for view in zip(views.xy, views.sides_px, strict=True)]
    names = ("align_theta", "align_covariance", "align_noise", "align_converged")
    return {name: np.array([fit[k] for fit in fits], dtype=np.float64) for k, name in enumerate(names)}


def _correlated(views: Views) -> dict[str, NDArray[np.float64]]:
    scores, _ = correlate_candidates(
        views.image, views.xy, views.sides_px, *lit_template(Variant("dark")), shape_grid(), _SHIFTS, hopeless=-1.0
    )
    return {"correlation": scores}


def _derivatives(views: Views) -> dict[str, NDArray[np.float64]]:
    """Residuals and their derivatives at parameters that fit a marker badly, so that every term counts."""
    lines, index, base = lit_pattern(Variant("dark"))
    theta = np.array(
        [301.2, 184.1, 40.0, 6.0, -7.0, 35.0, 0.1, -0.05, 140.0, 30.0, 0.8, 0.2, -0.1, 0.05, 0.1, 0.4, 0, 0]
    )
    image = views.image.astype(np.float32)
    pixels = chosen_pixels(image, theta, lines, 0.5, 300)
    pixels = pixels[np.lexsort(pixels.T)]
    lit, lit_slopes = lit_residuals(image, pixels, theta, np.array([300.0, 185.0, 42.0]), lines, index, base)
    plain, slopes = residuals(image, pixels, theta[:11], lines, Pattern(lines, base[index], 0.5).levels)
    return {
        "pixels": pixels.astype(np.float64),
        "lit_residuals": lit,
        "lit_jacobian": lit_slopes[:16],
        "residuals": plain,
        "jacobian": slopes,
    }


if __name__ == "__main__":
    views = drawn_views()
    PATH.parent.mkdir(exist_ok=True)
    np.savez_compressed(PATH, image=views.image, xy=views.xy, sides_px=views.sides_px, **measure(views))
