"""Kernels of the alignment on odd input: no position, size, image or parameter makes them read what is not theirs.

Under the sanitizers (`make test-sanitize`) a read beyond an array ends these; without, what comes back is checked.
"""

import numpy as np
import pytest

from peakmark.identification.alignment import _KNOTS, _SHIFTS, lit_pattern, lit_template, measure_alignment
from peakmark.identification.correlation import correlate_candidates
from peakmark.identification.screening import VIEWED, slopes_of
from peakmark.markers.patterns import Variant
from peakmark.refine.align import align, chosen_pixels, shape_grid
from peakmark.refine.api import coarse_template, known_pattern
from peakmark.refine.lit import CUT, NOISE, PART, PARTS, SHARP, SOFT, STEP, align_each, finish_in_light, lit_residuals
from peakmark.refine.posture import view_candidates

ODD = np.array([-np.inf, -1e300, -1e6, -40.0, -0.5, 0.0, 1e-300, 3.2, 17.0, 1e6, 1e300, np.inf, np.nan])


def odd_image(rng: np.random.Generator) -> np.ndarray:
    """Return an image of any size, noisy, black, white or of stripes, sometimes not contiguous."""
    height, width = rng.integers(1, 90, 2)
    image = rng.integers(0, 256, (height, width), dtype=np.uint8)
    image = [image, image * 0, image * 0 + 255, image % 2 * 255][rng.integers(4)]
    return image.T if rng.random() < 0.3 else image


@pytest.mark.parametrize("seed", range(60))
def test_alignments_of_anything_anywhere_come_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image, pattern, template = odd_image(rng), lit_pattern(Variant("dark")), lit_template(Variant("dark"))
    plain = known_pattern("surf-dark", 0.0)
    center = rng.choice(ODD, 2) if rng.random() < 0.4 else rng.uniform(-30, 120, 2)
    size = float(rng.choice([2.0, 2.5, 9.0, 17.9, 18.1, 60.0, 500.0, 2000.0]))
    extra = (*coarse_template("surf-dark", 0.0), shape_grid())
    theta, covariance, _, converged = align(image, center, size, plain.lines, plain.levels, plain.extent, 90.0, *extra)
    assert converged or np.isnan(covariance).all()
    assert theta.shape == (11,)
    place = (center[None], np.array([size]))
    found, fits = np.empty((1, 18)), np.empty((1, 6))
    for stage in (SOFT, SHARP, PARTS, PART):
        if stage in (SOFT, PARTS) or np.isfinite(fits[0, STEP]):
            align_each(image, *place, *pattern, 0.5, 90.0, *template, shape_grid(), 2.0, 1.0, stage, found, fits)
        assert not np.isfinite(fits[0, STEP]) or (np.isfinite(found).all() and fits[0, NOISE] > 0)
        _, covariance = finish_in_light(image, found[0], center, size, *pattern, 0.5, 0.55, 90.0, float(fits[0, CUT]))
        assert covariance.shape == (18, 18)
    score, postures = correlate_candidates(image, *place, *template, shape_grid(), _SHIFTS)
    assert -1.001 <= score[0] <= 1.001
    _, score, views = view_candidates(image, *place, postures, *template, slopes_of(Variant("dark")), VIEWED)
    assert -1.001 <= score[0] <= 1.001
    assert ((views >= 0) & (views <= 255)).all()


@pytest.mark.parametrize("seed", range(60))
def test_measures_of_any_parameters_come_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image, pattern = odd_image(rng), lit_pattern(Variant("light"))
    theta = rng.normal([30, 30, 20, 0, 0, 20, 0, 0, 99, 30, 0.5, 0, 0, 0, 0, 0, 0, 0], 3.0)
    odd = rng.random(18) < 0.15
    theta[odd] = rng.choice(ODD, odd.sum())
    cut = float(rng.choice([0.0, 8.0]))
    place = (np.array([30.0, 30.0]), 20.0)
    figures, sums, counts, inside = measure_alignment(image, theta, *place, *pattern, 0.5, _KNOTS, cut)
    assert (figures.shape, sums.shape) == ((8,), (121,))
    assert ((counts >= 0) & (counts <= inside) & (inside <= image.size)).all()
    height, width = image.shape
    pixels = chosen_pixels(image, theta, pattern[0], 0.5, 300)
    assert ((pixels >= 0) & (pixels < [width, height])).all()
    residual, slopes = lit_residuals(image, pixels, theta, np.array([30.0, 30.0, 20.0]), *pattern)
    assert (len(residual), slopes.shape) == (len(pixels), (18, len(pixels)))
