"""Areas of polygons and of their parts in a box, against counted samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.geometry.polygon import clip_polygon, polygon_area

SQUARE = np.array([[1.0, 1], [5, 1], [5, 5], [1, 5]])


@given(st.lists(st.tuples(st.floats(-30, 60), st.floats(-30, 60)), min_size=3, max_size=3))
def test_clipping_keeps_the_area_that_is_inside(corners: list[tuple[float, float]]) -> None:
    """Against counting sub-pixel samples, for triangles."""
    triangle = np.array(corners)
    steps = (np.arange(300) + 0.5) / 10
    x, y = np.meshgrid(steps, steps)
    sides = [(triangle[i], triangle[i - 1]) for i in range(3)]
    signs = np.array([(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in sides])
    inside = (signs > 0).all(axis=0) | (signs < 0).all(axis=0)
    perimeter = sum(np.linalg.norm(a - b) for a, b in sides)
    area = abs(polygon_area(clip_polygon(triangle, (0, 0), (30, 30))))
    assert area == pytest.approx(inside.sum() / 100, abs=0.1 * perimeter + 0.1)


def test_a_polygon_inside_stays_and_one_outside_vanishes() -> None:
    assert np.array_equal(clip_polygon(SQUARE, (0, 0), (10, 10)), SQUARE)
    assert clip_polygon(SQUARE + 20, (0, 0), (10, 10)).shape == (0, 2)
    assert clip_polygon(np.zeros((0, 2)), (0, 0), (10, 10)).tolist() == []


def test_the_area_is_positive_clockwise_on_the_screen() -> None:
    assert polygon_area(SQUARE) == 16
    assert polygon_area(SQUARE[::-1]) == -16
    assert polygon_area(np.zeros((0, 2))) == 0
