"""The kernels' own tests under address and undefined-behaviour sanitizers; `make test-sanitize` runs them."""

import pytest

from tests.sanitized import run_sanitized

FILES = (
    "tests/peaksim/test_native.py",
    "tests/peaksim/test_elementary.py",
    "tests/peaksim/area/test_cells.py",
    "tests/peaksim/area/test_golden.py",
    "tests/peaksim/area/test_light.py",
    "tests/peaksim/area/test_shown.py",
    "tests/peaksim/area/test_texture_sums.py",
    "tests/peaksim/camera/test_camera.py",
    "tests/peaksim/camera/test_optics.py",
    "tests/peaksim/truth/test_markers.py",
    "tests/peakmark/refine/test_golden.py",
    "tests/peakmark/refine/test_model.py",
    "tests/peakmark/refine/test_odd_input.py",
    "tests/peakmark/surf/test_golden.py",
    "tests/peakmark/surf/test_exact.py",
    "tests/peakmark/surf/test_window.py",
    "tests/peakmark/surf/test_orientation.py",
    "tests/peakmark/identification/test_blobs.py",
    "tests/peakmark/identification/test_candidates.py",
    "tests/peakmark/identification/test_correlation.py",
    "tests/peakmark/identification/test_evidence.py",
    "tests/peakmark/identification/test_screening.py",
    "tests/peakmark/identification/test_suppression.py",
)


@pytest.mark.slow
def test_kernels_do_nothing_undefined() -> None:
    run_sanitized(["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *FILES])
