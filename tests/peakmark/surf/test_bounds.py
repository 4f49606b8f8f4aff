"""No kernel reads or writes beyond its arrays: random images and parameters, compiled with checks of every index."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from peakmark import surf
from tests.places import ROOT, SOURCES
from tests.samples import speckled

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
def test_kernels_stay_inside_their_arrays(tmp_path: Path) -> None:
    environment = {
        **os.environ,
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([SOURCES, str(ROOT)]),
    }
    code = "from tests.peakmark.surf.test_bounds import detect_on_random_images; detect_on_random_images()"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=1800)
    assert done.returncode == 0, done.stderr
