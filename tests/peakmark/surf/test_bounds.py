"""No kernel reads or writes beyond its arrays: random images and parameters, under the sanitizers."""

import numpy as np
import pytest

from peakmark import surf
from tests.samples import speckled
from tests.sanitized import run_sanitized

IMAGES = 400


def detect_on_random_images() -> None:
    rng = np.random.default_rng(0)
    for seed in range(IMAGES):
        gray = speckled(*rng.integers(1, 140, 2), seed)
        octaves, layers = (int(n) for n in rng.integers(1, 6, 2))
        extended, upright = rng.random(2) < 0.3
        mask = rng.random(gray.shape) < 0.7 if rng.random() < 0.3 else None
        surf.detect_and_describe(gray, 0.0, octaves, layers, bool(extended), bool(upright), mask=mask)


@pytest.mark.slow
def test_kernels_stay_inside_their_arrays() -> None:
    code = "from tests.peakmark.surf.test_bounds import detect_on_random_images; detect_on_random_images()"
    run_sanitized(["-c", code])
