"""Distance from size: against exact projections, for any lens and viewing direction."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.camera.camera import Camera

from peakmark.localise.distance import distances_at_height, distances_of_shapes, ray_slopes, solid_angles, unit_rays
from tests.floor_views import CAMERA, SIDE_M, pose_at, view, winding_map

WIDE = Camera(1024, 768, 500.0, 520.0, 500.0, 390.0, distortion=(-0.2, 0.05, 0.001, -0.002, 0.0))
heights = st.floats(0.4, 2.0)
pitches = st.floats(20, 60)
rolls = st.floats(-20, 20)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), height=heights, pitch=pitches, roll=rolls, lens=st.sampled_from([CAMERA, WIDE]))
def test_every_rule_gives_the_true_distance_of_a_small_marker(
    seed: int, height: float, pitch: float, roll: float, lens: Camera
) -> None:
    rng = np.random.default_rng(seed)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 5, height, pitch, roll)
    seen = view(lens, pose, floor_map, rng)
    sight = floor_map.centers_m[seen.names] - pose[:3, 3]
    distance = np.linalg.norm(sight, axis=1)
    tilt = np.degrees(np.arccos(height / distance))
    by_shape, tilt_by_shape = distances_of_shapes(lens, seen.xy, seen.affinity, SIDE_M)
    angles = solid_angles(lens, seen.xy, seen.side_px)
    assert np.allclose(by_shape, distance, rtol=1e-4)
    assert np.allclose(tilt_by_shape, tilt, atol=0.05)
    assert np.allclose(distances_at_height(angles, SIDE_M, height), distance, rtol=1e-4)


def test_a_relative_error_of_the_scale_is_two_thirds_as_large_in_the_distance() -> None:
    true, off = (distances_at_height(np.array([1e-3]) * factor**2, SIDE_M, 1.0)[0] for factor in (1.0, 1.03))
    assert np.isclose(true / off, 1.03 ** (2 / 3))


def test_slopes_are_the_derivative_of_the_rays() -> None:
    xy = np.array([[10.0, 20.0], [500.0, 300.0], [1000.0, 700.0]])
    step = np.array([0.1, -0.05])
    moved = unit_rays(WIDE, xy + step) - unit_rays(WIDE, xy - step)
    assert np.allclose(ray_slopes(WIDE, xy) @ step * 2, moved, atol=1e-8)


def test_nothing_seen_gives_empty_results_of_the_right_shape() -> None:
    none = np.empty((0, 2))
    assert unit_rays(CAMERA, none).shape == (0, 3)
    assert solid_angles(CAMERA, none, np.empty(0)).shape == (0,)
    assert [d.shape for d in distances_of_shapes(CAMERA, none, np.empty((0, 2, 2)), SIDE_M)] == [(0,), (0,)]
