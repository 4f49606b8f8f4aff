"""Orientations against the plain operator and against gradients that are known."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.surf.integral import integral_image
from peakmark.surf.orientation import NO_SAMPLE, circle_samples, fast_atan2, gaussian, measure_angles
from tests.peakmark.surf import reference
from tests.samples import speckled


def angles_of(gray: np.ndarray, xy: np.ndarray, size: np.ndarray) -> np.ndarray:
    integral = np.ascontiguousarray(integral_image(gray))
    return measure_angles(integral, gray.shape, xy.astype(np.float32), size.astype(np.float32))


def test_kernel_agrees_with_the_plain_operator() -> None:
    gray = speckled(200, 240, 4)
    rng = np.random.default_rng(0)
    xy, size = rng.uniform((-5, -5), (245, 205), (400, 2)), rng.integers(9, 70, 400)
    integral = integral_image(gray)
    plain = np.array([reference.orientation(integral, x, y, s) for (x, y), s in zip(xy, size, strict=True)])
    found = angles_of(gray, xy, size)
    np.testing.assert_array_equal(found == NO_SAMPLE, plain == NO_SAMPLE)
    angle = np.abs(found - plain) % 360
    # the kernel's arc tangent is good to 0.01°; now and then that moves a sample into another window
    assert (np.minimum(angle, 360 - angle) < 0.05).mean() > 0.99


@pytest.mark.parametrize("angle_deg", [0, 17, 90, 133, 180, 250, 271, 359])
def test_a_ramp_points_along_its_gradient(angle_deg: float) -> None:
    y, x = np.mgrid[:121, :121] - 60.0
    ramp = np.rint(128 + 1.4 * (x * np.cos(np.deg2rad(angle_deg)) + y * np.sin(np.deg2rad(angle_deg))))
    found = angles_of(ramp.astype(np.uint8), np.array([[60.0, 60.0]]), np.array([20.0]))
    assert abs((found[0] - angle_deg + 180) % 360 - 180) < 1.0


def test_no_sample_inside_gives_no_angle() -> None:
    gray = speckled(30, 30, 0)
    found = angles_of(gray, np.array([[-500.0, 10.0], [15.0, 15.0], [15.0, 15.0]]), np.array([20.0, 400.0, 12.0]))
    assert found[0] == found[1] == NO_SAMPLE
    assert 0 <= found[2] <= 360


def test_a_uniform_image_has_angle_zero() -> None:
    assert angles_of(np.full((60, 60), 7, np.uint8), np.array([[30.0, 30.0]]), np.array([15.0])).tolist() == [0]


@given(st.floats(-1e6, 1e6, width=32), st.floats(-1e6, 1e6, width=32))
def test_fast_arc_tangent_is_good_to_a_hundredth_of_a_degree(y: float, x: float) -> None:
    exact = np.degrees(np.arctan2(y, x)) % 360
    found = float(fast_atan2(np.array([y], np.float32), np.array([x], np.float32))[0])
    angle = abs(found - exact) % 360
    assert min(angle, 360 - angle) < 0.0125 or abs(x) + abs(y) < 1e-12
    assert found == pytest.approx(cv2.fastAtan2(y, x), abs=1e-4)


@pytest.mark.parametrize(("length", "sigma"), [(13, 2.5), (20, 3.3)])
def test_windows_are_opencvs_bit_for_bit(length: int, sigma: float) -> None:
    np.testing.assert_array_equal(gaussian(length, sigma), cv2.getGaussianKernel(length, sigma, cv2.CV_32F)[:, 0])


def test_113_samples_lie_in_the_circle() -> None:
    offsets, weights = circle_samples()
    assert offsets.shape == (113, 2)
    assert len({tuple(o) for o in offsets.tolist()}) == 113
    assert ((offsets**2).sum(axis=1) <= 36).all()
    assert weights.argmax() == 56
    assert offsets[56].tolist() == [0, 0]
