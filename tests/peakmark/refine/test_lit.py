"""Alignment in any light: derivatives, and parameters put in are parameters found."""

import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.identification.alignment import lit_pattern
from peakmark.markers.patterns import Variant
from peakmark.refine.lit import PARAMETERS, lit_fit, lit_residuals

ANCHOR = np.array([40.0, 40.0, 32.0])
TRUTH = np.array(
    [40.3, 39.6, 30.0, -7.0, 8.0, 27.0, 0.05, -0.08, 150.0, 40.0, 0.6, 0.3, -0.2, 0.1, 0.15, 0.4, 0.3, -0.2]
)
PIXELS = np.array([(x, y) for y in range(30, 51) for x in range(30, 51)], dtype=np.int32)
PATTERN = lit_pattern(Variant("dark"))


def image_of(theta: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return what the model predicts on 80×80 pixels."""
    pixels = np.array([(x, y) for y in range(80) for x in range(80)], dtype=np.int32)
    residual, _ = lit_residuals(np.zeros((80, 80), np.float32), pixels, theta, ANCHOR, *PATTERN)
    return np.asarray(-residual.reshape(80, 80), dtype=np.float32)


def test_the_derivatives_are_those_of_the_prediction() -> None:
    image = np.zeros((80, 80), np.float32)
    _, jacobian = lit_residuals(image, PIXELS, TRUTH, ANCHOR, *PATTERN)
    for k in range(PARAMETERS):
        if k in (2, 3, 4, 5, 6, 7):
            continue  # leave out, as documented, how the shape changes the blur
        step = np.zeros(PARAMETERS)
        step[k] = 1e-3  # in single precision a shorter one says little
        above, _ = lit_residuals(image, PIXELS, TRUTH + step, ANCHOR, *PATTERN)
        below, _ = lit_residuals(image, PIXELS, TRUTH - step, ANCHOR, *PATTERN)
        numeric = (below - above) / 2e-3
        assert np.allclose(jacobian[k], numeric, atol=4e-2 * np.abs(numeric).max() + 1e-2), k


@pytest.mark.parametrize("blur", [0.1, 0.3, 1.0, 4.0])
def test_quick_residuals_are_nearly_the_exact_ones(blur: float) -> None:
    theta, image = TRUTH.copy(), np.zeros((80, 80), np.float32)
    theta[10], theta[16:] = blur, 0.0
    exact, slopes = lit_residuals(image, PIXELS, theta, ANCHOR, *PATTERN)
    quick, quick_slopes = lit_residuals(image, PIXELS, theta, ANCHOR, *PATTERN, is_quick=True)
    assert 0 < np.abs(quick - exact).max() < 0.002 * theta[8]
    near = 0.03 * np.abs(slopes).max(axis=1, keepdims=True)
    near[[10, 16, 17]] *= 5  # by the blur: second derivatives
    assert (np.abs(quick_slopes - slopes) < near).all()


def test_quick_residuals_of_a_sharp_image_are_exact() -> None:
    theta, image = TRUTH.copy(), np.zeros((80, 80), np.float32)
    theta[2:8], theta[10], theta[16:] = [30, 0, 0, 30, 0, 0], 0.05, 0.0
    exact, _ = lit_residuals(image, PIXELS, theta, ANCHOR, *PATTERN)
    assert np.array_equal(lit_residuals(image, PIXELS, theta, ANCHOR, *PATTERN, is_quick=True)[0], exact)


def test_parameters_put_in_are_found_again() -> None:
    start = TRUTH.copy()
    start[:6] += [0.5, -0.4, 1.0, 0.5, -0.6, 0.8]
    start[11:] = 0.0
    precision = np.full(PARAMETERS, 1e-6)
    fitted, noise, converged = lit_fit(image_of(TRUTH), PIXELS, start, ANCHOR, *PATTERN, start, precision, 40, 1e-6)
    assert converged
    assert noise == pytest.approx(1 / 12)  # its floor: nothing is left
    assert np.allclose(fitted[:2], TRUTH[:2], atol=1e-3)
    assert np.allclose(fitted[[8, 9, 15]], TRUTH[[8, 9, 15]], rtol=0.03)


def test_white_pixels_say_nothing() -> None:
    theta = TRUTH.copy()
    theta[8], theta[9] = 300.0, 60.0
    image = np.minimum(image_of(theta), 255).astype(np.float32)
    residual, jacobian = lit_residuals(image, PIXELS, theta, ANCHOR, *PATTERN)
    white = image[PIXELS[:, 1], PIXELS[:, 0]] >= 254
    assert white.sum() > 50
    assert np.abs(residual[white]).max() == 0
    assert np.abs(jacobian[:, white]).max() == 0
    assert np.abs(jacobian[:, ~white]).max() > 0
