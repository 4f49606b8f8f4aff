"""Stretching: rows go where the mapping says, features come back, a floor's markers look square under its stretch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.camera.camera import Camera

from peakmark.errors import InputError
from peakmark.identification.stretch import floor_stretch, stretched, unstretched
from peakmark.keypoints.keypoints import Keypoints
from tests.floor_views import pose_at, view, winding_map

WIDE = Camera(1024, 768, 500.0, 500.0, 511.5, 383.5, distortion=(-0.1, 0.01, 0.0, 0.0))


def point(x: float, y: float, size: float = 20.0) -> Keypoints:
    return Keypoints([[x, y]], [size], [0], [1], [0], [1], [size])  # type: ignore[arg-type]


def test_features_are_mapped_back_through_the_stretch() -> None:
    back = unstretched(Keypoints.concatenate([point(10, 4.5), point(0, -0.5)]), 2.0, 240)
    assert np.allclose(back.xy, [[10, 2.0], [0, -0.5]])
    assert np.allclose(back.size, 20 / np.sqrt(2))


def test_stretched_rows_are_where_the_mapping_says() -> None:
    ramp = np.repeat(np.arange(0, 200, 2, dtype=np.uint8)[:, None], 8, axis=1)
    tall = stretched(ramp, 2.0)
    rows = np.arange(2, 198)
    assert np.abs(tall[rows, 3] - 2 * ((rows + 0.5) / 2 - 0.5)).max() <= 0.5


@settings(max_examples=40, deadline=None)
@given(factors=st.lists(st.floats(0.5, 4), min_size=30, max_size=200))
def test_every_rows_own_stretch_and_back_is_the_identity(factors: list[float]) -> None:
    height = len(factors)
    ramp = np.repeat(np.linspace(0, 255, height)[:, None], 6, axis=1)
    tall = stretched(np.rint(ramp).astype(np.uint8), np.array(factors))
    assert abs(len(tall) - sum(factors)) <= 0.5
    rows = np.arange(0, len(tall), 7)
    back = unstretched(Keypoints.concatenate([point(3, row) for row in rows]), np.array(factors), height)
    inside = (back.xy[:, 1] > 0) & (back.xy[:, 1] < height - 1)
    seen = tall[rows, 3][inside] / 255 * (height - 1)
    assert np.allclose(seen, back.xy[inside, 1], atol=1.1 * (height - 1) / 255)


def test_one_number_and_the_same_number_for_each_row_agree() -> None:
    rng = np.random.default_rng(0)
    gray = rng.integers(0, 256, (60, 40), dtype=np.uint8)
    one, each = stretched(gray, 2.5), stretched(gray, np.full(60, 2.5))
    assert one.shape == each.shape == (150, 40)
    assert np.abs(one.astype(int) - each).max() <= 1


@settings(max_examples=25, deadline=None)
@given(pitch=st.floats(20, 60), height=st.floats(0.5, 1.5), seed=st.integers(0, 1000))
def test_under_the_floors_stretch_markers_in_the_middle_column_look_square(
    pitch: float, height: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    straight = winding_map(rng, bend=0.0)
    for camera in (Camera(1024, 768, 700.0, 700.0, 511.5, 383.5), WIDE):
        factors = floor_stretch(camera, pitch)
        assert factors.shape == (768,)
        seen = view(camera, pose_at(straight, 5, height, pitch), straight, rng)
        spans = np.linalg.norm(seen.affinity, axis=2)
        expected = spans[:, 0] / spans[:, 1]
        near = (expected > 1.02) & (expected < 3.9)
        assert np.allclose(factors[np.rint(seen.xy[near, 1]).astype(int)], expected[near], rtol=0.02)


def test_above_the_horizon_nothing_is_stretched() -> None:
    camera = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
    horizon = 239.5 - 500 * np.tan(np.radians(10))
    factors = floor_stretch(camera, 10.0)
    assert (factors[: int(horizon) - 1] == 1).all()
    assert (np.diff(factors[int(horizon) + 2 :]) <= 1e-9).all()
    assert factors.max() == 4


@pytest.mark.parametrize("stretch", [0.0, -1.0, float("nan"), 9.0])
def test_a_senseless_stretch_is_refused(stretch: float) -> None:
    with pytest.raises(InputError, match=r"stretch: expected 0\.25…8"):
        stretched(np.zeros((20, 20), np.uint8), stretch)


def test_a_stretch_for_other_rows_is_refused() -> None:
    with pytest.raises(InputError, match=r"stretch: expected one number or 20, one a row, got shape \(19,\)"):
        stretched(np.zeros((20, 20), np.uint8), np.ones(19))


def test_a_single_row_stays_one_image() -> None:
    assert stretched(np.full((1, 5), 9, np.uint8), np.array([3.0])).tolist() == [[9] * 5] * 3
