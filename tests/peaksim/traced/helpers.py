"""What the tests of traced images share: whether they can be made here, and how far noise may take them."""

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import traced

needs_tracing = pytest.mark.skipif(
    not traced.is_available(), reason=f"the traced renderer {traced.library.fault() or 'is there'}"
)
"""For tests that trace paths: Mitsuba is an extra, and needs LLVM 17 or newer."""


def assert_within_noise(rounds: NDArray[np.floating], expected: NDArray[np.floating], rms: float) -> None:
    """Assert that the mean of (n, h, w) images with independent noise is the expected one.

    The mean over the image may be off by four standard errors and a hundredth of a grey level, its rms error by what
    the scatter of the rounds explains and `rms`, the error budget of the expected image.
    """
    mean = rounds.mean(axis=0)
    errors = rounds.std(axis=0, ddof=1) / np.sqrt(len(rounds))
    difference = mean - expected
    standard_error = np.sqrt((errors**2).sum()) / errors.size
    assert abs(difference.mean()) < 4 * standard_error + 0.01, (difference.mean(), standard_error)
    assert np.sqrt((difference**2).mean()) < np.sqrt(1.1 * (errors**2).mean() + rms**2)
