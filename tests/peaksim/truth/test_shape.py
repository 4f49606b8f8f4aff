"""Affinity and ellipse of a marker against numerical differences, moments of the image, and what is known by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim import Camera, Quad, Scene, Texture, render
from peaksim.camera.shutter import still_camera
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.scene.scene import Mark, rectangle_m
from peaksim.truth.shape import affinities, ellipses, rims_m

CAMERA = Camera(width=320, height=240, fx=250.0, fy=250.0, cx=159.5, cy=119.5)
LENS = Camera(320, 240, 250.0, 250.0, 159.5, 119.5, (-0.25, 0.05, 0.001, 0.0))
GREY = Texture.from_array(np.full((2, 2), 128, np.uint8))


def test_seen_squarely_the_affinity_is_the_side_and_the_ellipse_a_circle() -> None:
    facing = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])
    quad = Quad("q", GREY, (0.4, 0.4), np.eye(4), Mark("m", "any", 0.2))
    truth = render(Scene((quad,)), CAMERA, facing, renderer="exact").truth[0]
    assert np.allclose(truth.affinity, 50 * np.eye(2), atol=1e-6)
    assert truth.ellipse.semi_axes_px == pytest.approx((25, 25), abs=1e-6)
    assert np.allclose(truth.ellipse.center_xy, truth.center_xy)


def corners_and_shot(seed: int, camera: Camera) -> tuple[np.ndarray, object]:
    rng = np.random.default_rng(seed)
    rotation = rotation_about("x", rng.uniform(-60, 60)) @ rotation_about("z", rng.uniform(0, 360))
    quad = Quad("q", GREY, (0.3, 0.3), compose(rotation, [0, 0, 0]))
    pose = look_at([*rng.uniform(-0.4, 0.4, 2), rng.uniform(0.8, 2)], [*rng.uniform(-0.2, 0.2, 2), 0], up=(0, 1, 0.1))
    return rectangle_m(quad, (0, 0), (0.3, 0.3))[None], still_camera(camera, pose)


@pytest.mark.parametrize("camera", [CAMERA, LENS])
@given(st.integers(0, 2**32))
def test_the_affinity_predicts_points_near_the_centre(camera: Camera, seed: int) -> None:
    corners, posed = corners_and_shot(seed, camera)
    (top_left, top_right, _, bottom_left), center = corners[0], corners[0].mean(axis=0)
    step = np.array([0.006, -0.004])
    xy = posed.project([center, center + step[0] * (top_right - top_left) + step[1] * (bottom_left - top_left)])
    assert np.allclose(xy[1] - xy[0], affinities(posed, corners)[0] @ step, atol=0.02)


@given(st.integers(0, 2**32))
def test_the_rim_lies_on_the_ellipse(seed: int) -> None:
    corners, posed = corners_and_shot(seed, CAMERA)
    top_left, top_right, _, bottom_left = corners[0]
    angles = np.linspace(0, 2 * np.pi, 7)[:, None]
    across, down = (top_right - top_left) / 2, (bottom_left - top_left) / 2
    rim = corners[0].mean(axis=0) + np.cos(angles) * across + np.sin(angles) * down
    ellipse = ellipses(posed, rims_m(corners))[0]
    angle = np.radians(ellipse.angle_deg)
    away = (posed.project(rim) - ellipse.center_xy) @ [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    assert np.allclose(np.hypot(*(away / ellipse.semi_axes_px).T), 1, atol=2e-3)
    assert ellipse.semi_axes_px[0] >= ellipse.semi_axes_px[1] > 0
    assert 0 <= ellipse.angle_deg <= 180


def test_behind_the_camera_there_is_no_ellipse() -> None:
    corners, _ = corners_and_shot(1, CAMERA)
    away = still_camera(CAMERA, look_at([0, 0, 1], [0, 0, 2], up=(0, 1, 0)))
    assert np.isnan(ellipses(away, rims_m(corners))[0].center_xy).all()
    assert np.isnan(affinities(away, corners)).all()
