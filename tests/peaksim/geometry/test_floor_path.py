"""Paths by arc length: even steps, exact on lines and circles, straight on beyond the ends."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.geometry.floor_path import FloorPath


def circle(radius: float) -> FloorPath:
    angles = np.linspace(0, np.pi, 40)
    return FloorPath(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def test_a_straight_path_is_exact_also_beyond_its_ends() -> None:
    path = FloorPath(np.array([[1.0, 1.0], [1.0, 3.0], [1.0, 4.0]]))
    assert path.length_m == pytest.approx(3)
    assert np.allclose(path.at([-1, 0, 2.5, 4]), [[1, 0], [1, 1], [1, 3.5], [1, 5]])
    assert np.allclose(path.heading_rad([-1, 1, 4]), np.pi / 2)


def test_a_half_circle_has_its_length_heading_and_distances() -> None:
    path = circle(2.0)
    assert path.length_m == pytest.approx(2 * np.pi, rel=1e-4)
    middle = path.at(np.pi)[0]
    assert np.allclose(middle, [0, 2], atol=1e-3)
    assert abs(path.heading_rad(np.pi)[0]) == pytest.approx(np.pi, abs=1e-3)
    at, left = path.nearest([[0.0, 1.5], [0.0, 2.2]])
    assert np.allclose(at, np.pi, atol=2e-3)
    assert np.allclose(left, [0.5, -0.2], atol=2e-3)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_even_arc_lengths_are_even_steps_and_points_are_nearest_to_themselves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = FloorPath(np.cumsum(rng.uniform([0.3, -0.3], [0.8, 0.3], (8, 2)), axis=0))
    arc = np.linspace(0, path.length_m, 2000)
    steps = np.linalg.norm(np.diff(path.at(arc), axis=0), axis=1)
    assert np.allclose(steps, arc[1], rtol=0.01)
    shifted = np.linspace(-0.5, path.length_m + 0.5, 50)
    at, left = path.nearest(path.at(shifted))
    assert np.allclose(at, shifted, atol=2 * path.length_m / 10_000)
    assert np.abs(left).max() < 1e-3
