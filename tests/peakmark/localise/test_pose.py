"""Poses from known positions: exact without noise for any lens, uncertain where the target does not tell them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import invert, look_at, transform

from peakmark.localise.pose import CERTAIN, PoseEstimate, PoseFit, estimate_pose, expected_shapes, moved, refine_pose
from peakmark.localise.residuals import Correspondences, Residuals, refined_sigmas
from tests.floor_views import CAMERA, SIDE_M, apart, pose_at, view, winding_map

WIDE = Camera(1024, 768, 500.0, 520.0, 500.0, 390.0, distortion=(-0.2, 0.05, 0.001, -0.002, 0.0))


def random_view(rng: np.random.Generator, flat: bool) -> tuple[np.ndarray, np.ndarray]:
    points = rng.uniform(-0.5, 0.5, (8, 3)) * ([1, 1, 0] if flat else [1, 1, 1])
    eye = np.array([*rng.uniform(-1.5, 1.5, 2), rng.uniform(1.2, 2.0)])
    return points, look_at(eye, rng.uniform(-0.2, 0.2, 3))


def estimate(camera: Camera, xy: np.ndarray, points: np.ndarray) -> PoseEstimate | None:
    """Return the pose from points alone."""
    return estimate_pose(camera, Correspondences(xy, points, np.zeros((len(points), 3, 2))), xy, points)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans(), lens=st.sampled_from([CAMERA, WIDE]))
def test_the_pose_is_found_again_from_exact_points(seed: int, flat: bool, lens: Camera) -> None:
    points, pose = random_view(np.random.default_rng(seed), flat)
    found = estimate(lens, lens.project(transform(invert(pose), points)), points)
    assert found is not None
    assert found.is_certain
    distance, angle = apart(found.fit.world_from_camera, pose)
    assert distance < 1e-5
    assert angle < 1e-3
    assert np.sqrt((found.fit.errors_px**2).sum(axis=1).mean()) < 1e-3


def test_a_far_square_seen_nearly_squarely_has_two_poses_and_neither_is_certain() -> None:
    points = 0.05 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    pose = look_at([0.5, 0.3, 6.0], [0, 0, 0])
    xy = CAMERA.project(transform(invert(pose), points)) + np.random.default_rng(0).normal(0, 0.1, (4, 2))
    found = estimate(CAMERA, xy, points)
    assert found is not None
    assert found.rival is not None
    assert 0 <= found.margin == found.rival.cost - found.fit.cost < CERTAIN
    assert not found.is_certain


def test_without_a_rival_a_pose_is_certain() -> None:
    alone = PoseEstimate(PoseFit(np.eye(4), np.zeros((4, 2)), 1.0), None)
    assert alone.margin == np.inf
    assert alone.is_certain


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_shapes_hold_what_centres_on_a_line_leave_open(seed: int) -> None:
    rng = np.random.default_rng(seed)
    straight = winding_map(rng, bend=0.0)
    pose = pose_at(straight, 5, roll_deg=rng.uniform(-10, 10))
    seen = view(CAMERA, pose, straight, rng)
    centers = straight.centers_m[seen.names]
    tangents = np.broadcast_to(SIDE_M * np.eye(3)[:, :2], (len(centers), 3, 2))
    start = moved(pose, rng.normal(0, 0.03, 6))
    fit = refine_pose(CAMERA, start, Correspondences(seen.xy, centers, tangents, seen.affinity))
    distance, angle = apart(fit.world_from_camera, pose)
    assert distance < 1e-3
    assert angle < 0.05


def test_weights_by_size_halve_the_error_of_equal_ones() -> None:
    rng = np.random.default_rng(3)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 5)
    seen = view(CAMERA, pose, floor_map, rng)
    centers = floor_map.centers_m[seen.names]
    tangents = np.broadcast_to(SIDE_M * np.eye(3)[:, :2], (len(centers), 3, 2))
    center_sigma, shape_sigma = refined_sigmas(seen.affinity)

    def errors(weights: tuple[object, object]) -> float:
        noise, angles = np.random.default_rng(4), []
        for _ in range(25):
            xy = seen.xy + center_sigma[:, None] * noise.standard_normal((len(centers), 2))
            affinity = seen.affinity + shape_sigma[:, None, None] * noise.standard_normal((len(centers), 2, 2))
            fit = refine_pose(CAMERA, pose, Correspondences(xy, centers, tangents, affinity, None, *weights))  # type: ignore[arg-type]
            angles.append(apart(fit.world_from_camera, pose)[1])
        return float(np.mean(angles))

    assert errors((center_sigma, shape_sigma)) < 0.5 * errors((0.25, 0.25))


def test_the_errors_vanish_at_the_true_pose_and_are_in_sigmas() -> None:
    rng = np.random.default_rng(1)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 5)
    seen = view(CAMERA, pose, floor_map, rng)
    tangents = np.broadcast_to(SIDE_M * np.eye(3)[:, :2], (len(seen.xy), 3, 2))
    centers = floor_map.centers_m[seen.names]
    for shapes, sides, count in ((seen.affinity, None, 5), (None, seen.side_px, 3), (None, None, 2)):
        residuals = Residuals.of(CAMERA, Correspondences(seen.xy, centers, tangents, shapes, sides, sigma_px=0.5))
        errors = residuals.at(pose[None])
        assert errors.shape == (1, count * len(seen.xy))
        assert np.abs(errors).max() < 0.01
    off = Correspondences(seen.xy + np.array([1.0, 0.0]), centers, tangents, sigma_px=0.5)
    assert Residuals.of(CAMERA, off).at(pose[None])[0, 0] == pytest.approx(2.0, rel=1e-3)


def test_expected_shapes_are_those_of_the_projection_and_nan_outside() -> None:
    rng = np.random.default_rng(2)
    floor_map = winding_map(rng)
    pose = pose_at(floor_map, 10)
    seen = view(CAMERA, pose, floor_map, rng)
    tangents = np.broadcast_to(SIDE_M * np.eye(3)[:, :2], (40, 3, 2))
    xy, shapes = expected_shapes(CAMERA, pose, floor_map.centers_m, tangents)
    assert np.allclose(xy[seen.names], seen.xy)
    gram = shapes[seen.names] @ np.swapaxes(shapes[seen.names], 1, 2)
    assert np.allclose(gram, seen.affinity @ np.swapaxes(seen.affinity, 1, 2), rtol=1e-3, atol=0.05)
    assert np.isnan(xy[0]).all()
    assert np.isnan(shapes[0]).all()
