"""Correlations are those of the softened image at the posture that is returned; stopping early loses no marker."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.identification.alignment import _SHIFTS, lit_template
from peakmark.identification.correlation import HOPELESS_SCORE, correlate_candidates
from peakmark.markers.patterns import Polarity, Variant, surf_marker
from peakmark.refine.align import shape_grid, softened

Values = NDArray[np.float64]


def scene(polarity: Polarity, side: int, seed: int) -> tuple[NDArray[np.uint8], Values]:
    """Return an image of slanted, rotated markers of a side on clutter under a ramp of light, and where they are."""
    rng = np.random.default_rng(seed)
    canvas = cv2.GaussianBlur(rng.normal(0, 90, (170, 260)).astype(np.float32), (0, 0), 3) * 6 + 120
    sheet = np.pad(surf_marker(90, polarity), 12, constant_values=255).astype(np.float32)
    centers = rng.uniform(40, 45, (6, 2)) + [(80 * k, 80 * m) for k in range(3) for m in range(2)]
    for center in centers:
        turn, tilt = rng.uniform(0, np.pi, 2)
        spin = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        narrow = 0.5 + 0.5 * np.sin(tilt)
        linear = spin @ np.diag([narrow**-0.5, narrow**0.5]) @ spin.T * side / 90
        shift = center - linear @ [56.5, 56.5]
        affine, size = np.column_stack([linear, shift]), canvas.shape[::-1]
        share = cv2.warpAffine(np.ones_like(sheet), affine, size, flags=cv2.INTER_AREA)
        canvas = share * cv2.warpAffine(sheet, affine, size, flags=cv2.INTER_AREA) + (1 - share) * canvas
    ramp = np.linspace(0.5, 1, canvas.shape[1])
    return np.clip(np.rint(canvas * ramp), 0, 255).astype(np.uint8), centers


def score_at(gray: NDArray[np.uint8], posture: Values, samples: Values, template: Values) -> float:
    """Return the correlation of the softened image's levels, a plane taken out, with the template at a posture."""
    soft = softened(gray.astype(np.float32)).astype(np.float64)
    x, y = posture[:2, None] + posture[2:].reshape(2, 2) @ samples.T
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - column, y - row
    upper = soft[row, column] * (1 - fx) + soft[row, column + 1] * fx
    lower = soft[row + 1, column] * (1 - fx) + soft[row + 1, column + 1] * fx
    levels = upper * (1 - fy) + lower * fy
    light = np.linalg.qr(np.column_stack([np.ones(len(samples)), samples]))[0]
    flat = levels - light @ (light.T @ levels)
    return float(levels @ template / np.sqrt(flat @ flat))


@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("side", [14, 22])
def test_a_correlation_is_that_of_the_image_at_its_posture(polarity: Polarity, side: int) -> None:
    gray, centers = scene(polarity, side, side)
    samples, template = lit_template(Variant(polarity))
    sides = np.full(len(centers), 0.9 * side)
    found, postures = correlate_candidates(gray, centers, sides, samples, template, shape_grid(), _SHIFTS)
    expected = [score_at(gray, posture, samples, template) for posture in postures]
    assert found == pytest.approx(expected, abs=2e-4)
    assert found.min() > 0.85
    assert np.abs(postures[:, :2] - centers).max() < 0.12 * side


@pytest.mark.parametrize("polarity", ["dark", "light"])
@pytest.mark.parametrize("side", [14, 40])
def test_stopping_early_loses_no_marker(polarity: Polarity, side: int) -> None:
    gray, centers = scene(polarity, side, 100 + side)
    rng = np.random.default_rng(side)
    near = centers + rng.uniform(-0.03, 0.03, centers.shape) * side
    xy = np.concatenate([near, rng.uniform(0, [259, 169], (200, 2))])
    settings = (xy, np.full(len(xy), float(side)), *lit_template(Variant(polarity)), shape_grid(), _SHIFTS)
    (stopped, at), (searched, best) = (
        correlate_candidates(gray, *settings, hopeless) for hopeless in (HOPELESS_SCORE, -1.0)
    )
    assert searched[: len(centers)].min() > 0.85
    assert np.array_equal(stopped[: len(centers)], searched[: len(centers)])
    assert np.array_equal(at[: len(centers)], best[: len(centers)])
    assert (stopped <= searched).all()
    assert (stopped < searched).sum() > 50
