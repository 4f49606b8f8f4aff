"""The floor from markers alone: exact without noise, near with it, and not fooled by what does not lie on it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.geometry.pose import invert, transform

from peakmark.localise.distance import unit_rays
from peakmark.localise.floor import Floor, floor_from_areas, floor_from_shapes, floor_of_pose, on_floor, tangent_bases
from tests.floor_views import CAMERA, SIDE_M, pose_at, view, winding_map

poses = {
    "seed": st.integers(0, 2**32 - 1),
    "height": st.floats(0.5, 1.5),
    "pitch": st.floats(25, 50),
    "roll": st.floats(-20, 20),
}


def angle_deg(a: Floor, b: Floor) -> float:
    return float(np.degrees(np.linalg.norm(np.cross(a.normal, b.normal))))


@settings(max_examples=60, deadline=None)
@given(**poses)
def test_exact_shapes_and_areas_give_the_exact_floor(seed: int, height: float, pitch: float, roll: float) -> None:
    rng = np.random.default_rng(seed)
    floor_map = winding_map(rng, bend=0.3)
    pose = pose_at(floor_map, 5, height, pitch, roll)
    seen, true = view(CAMERA, pose, floor_map, rng), floor_of_pose(pose)
    by_shape = floor_from_shapes(CAMERA, seen.xy, seen.affinity, SIDE_M)
    assert len(seen.xy) >= 2
    assert by_shape is not None
    assert angle_deg(by_shape, true) < 0.02
    assert by_shape.height_m == pytest.approx(height, rel=5e-4)
    by_area = floor_from_areas(CAMERA, seen.xy, seen.side_px, SIDE_M)
    if len(seen.xy) >= 4 and by_area is not None:
        assert angle_deg(by_area, true) < 1.0
        assert by_area.height_m == pytest.approx(height, rel=5e-3)


@settings(max_examples=30, deadline=None)
@given(**poses)
def test_noise_of_a_fifth_of_a_pixel_and_a_marker_on_a_wall_do_little(
    seed: int, height: float, pitch: float, roll: float
) -> None:
    rng = np.random.default_rng(seed)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 5, height, pitch, roll)
    seen = view(CAMERA, pose, floor_map, rng, noise_px=0.2)
    if len(seen.xy) < 5:
        return
    seen.affinity[0] = 30 * np.eye(2)
    found = floor_from_shapes(CAMERA, seen.xy, seen.affinity, SIDE_M)
    assert found is not None
    assert angle_deg(found, floor_of_pose(pose)) < 4
    assert found.height_m == pytest.approx(height, rel=0.1)


def test_one_marker_takes_the_plane_that_is_below_the_camera() -> None:
    rng = np.random.default_rng(3)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 5)
    seen = view(CAMERA, pose, floor_map, rng).rows(np.array([0]))
    found = floor_from_shapes(CAMERA, seen.xy, seen.affinity, SIDE_M)
    assert found is not None
    assert angle_deg(found, floor_of_pose(pose)) < 0.1


def test_nothing_and_rays_in_a_plane_tell_no_floor() -> None:
    assert floor_from_shapes(CAMERA, np.empty((0, 2)), np.empty((0, 2, 2)), SIDE_M) is None
    straight = np.array([[511.5, 200.0], [511.5, 400.0], [511.5, 600.0]])
    assert floor_from_areas(CAMERA, straight, [20, 30, 40], SIDE_M) is None
    assert floor_from_areas(CAMERA, straight[:2], [20, 30], SIDE_M) is None


def test_points_of_the_floor_are_found_again_through_rays_and_through_the_projection() -> None:
    rng = np.random.default_rng(0)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 5, roll_deg=7)
    seen = view(CAMERA, pose, floor_map, rng)
    floor = floor_of_pose(pose)
    positions = on_floor(floor, unit_rays(CAMERA, seen.xy))
    on_plane = np.column_stack([positions, np.zeros(len(positions))])
    assert np.allclose(CAMERA.project(transform(invert(floor.floor_from_camera), on_plane)), seen.xy)
    true = floor_map.centers_m[seen.names]
    assert np.allclose(
        np.linalg.norm(positions[:, None] - positions[None], axis=2), np.linalg.norm(true[:, None] - true[None], axis=2)
    )


def test_a_ray_above_the_horizon_meets_no_floor() -> None:
    floor = Floor(np.array([0.0, -1.0, 0.0]), 1.0)
    assert np.isnan(on_floor(floor, np.array([[0.0, -0.6, 0.8], [0.0, 0.0, 1.0]]))).all()


def test_the_floor_frame_looks_along_y_and_up_z() -> None:
    frame = Floor(np.array([0.0, -0.8, -0.6]), 1.5).floor_from_camera
    assert np.allclose(frame[:3, :3] @ [0, 0, 1], [0, 0.8, -0.6])
    assert np.allclose(frame[:3, 3], [0, 0, 1.5])
    straight_down = Floor(np.array([0.0, 0.0, -1.0]), 1.0).floor_from_camera
    assert np.allclose(straight_down[:3, :3] @ straight_down[:3, :3].T, np.eye(3))


def test_tangent_bases_are_orthonormal_and_across() -> None:
    rays = np.random.default_rng(0).standard_normal((50, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    full = np.concatenate([tangent_bases(rays), rays[:, None]], axis=1)
    assert np.allclose(full @ np.swapaxes(full, 1, 2), np.eye(3))
