"""A moving camera's projection against that of each row's own pose, and against still ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim import Camera, Quad, Scene, Trajectory, render
from peaksim.camera.shutter import PosedCamera, still_camera
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.rendering import count_moments

from tests.peaksim.shapes import plain_texture

CAMERA = Camera(width=160, height=120, fx=140.0, fy=140.0, cx=79.5, cy=59.5)
ROLLING = replace(CAMERA, row_time_s=1e-4)
START = look_at([0, -3.0, 1.0], [0, 0, 1.0])


def sideways(metres: float, turn_deg: float = 0.0) -> Trajectory:
    """Return a second of motion to the right, with a rotation to the right."""
    ends = [START @ compose(rotation_about("y", k * turn_deg / 2), [k * metres / 2, 0, 0]) for k in (-1.0, 1.0)]
    return Trajectory(np.array([-0.5, 0.5]), np.stack(ends))


@given(st.integers(0, 2**32))
def test_each_point_is_seen_by_the_row_it_is_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    posed = PosedCamera(ROLLING, sideways(rng.uniform(-2, 2), rng.uniform(-90, 90)), rng.uniform(-0.2, 0.2))
    points = rng.uniform([-1, -1, 0.2], [1, 1, 1.8], (20, 3))
    for point, xy in zip(points, posed.project(points), strict=True):
        time_s = posed.time_s + (xy[1] - 59.5) * 1e-4
        own = still_camera(CAMERA, posed.trajectory.at(time_s)).project(point)[0]
        assert np.allclose(own, xy, atol=1e-5)


@given(st.integers(0, 2**32))
def test_rays_invert_projection(seed: int) -> None:
    rng = np.random.default_rng(seed)
    posed = PosedCamera(ROLLING, sideways(1.0, 60.0))
    xy = rng.uniform([-0.5, -0.5], [159.5, 119.5], (20, 2))
    poses, _, rays = posed.rays(xy)
    points = poses[:, :3, 3] + rng.uniform(0.5, 5, (20, 1)) * rays
    assert np.allclose(posed.project(points), xy, atol=1e-6)


def test_a_rolling_shutter_leans_upright_edges() -> None:
    white = plain_texture(255)
    board = Quad("board", white, (0.6, 4.0), compose(rotation_about("x", 90), [0, 0, 1]), marker="board")
    frame = render(Scene((board,), background=0.0), ROLLING, sideways(20.0), renderer="exact")
    assert frame.posed_camera.is_rolling
    widths = frame.linear.sum(axis=1) / 255
    first = np.argmax(frame.linear > 0, axis=1)
    left = first + 1 - frame.linear[np.arange(120), first] / 255
    assert np.allclose(widths, 28, atol=1e-3)  # 0.6 m at 3 m
    # 20 m/s for 100 µs a row at 3 m is 0.0933 px a row, to the left for a camera that goes right
    assert np.allclose(np.diff(left), -0.0933, atol=1e-3)


def test_a_blur_is_the_mean_of_its_moments_and_truth_says_how_wide_it_is() -> None:
    dot = Quad("dot", plain_texture(255), (0.06, 0.06), compose(rotation_about("x", 90), [0, 0, 1]), marker="dot")
    camera = replace(CAMERA, exposure_s=0.05)
    trajectory = sideways(5.0)  # 11.67 px in 0.05 s
    frame = render(Scene((dot,), background=0.0), camera, trajectory, renderer="exact")
    sharp = render(Scene((dot,), background=0.0), CAMERA, trajectory.at(0.0), renderer="exact")
    assert frame.linear.sum() == pytest.approx(sharp.linear.sum(), rel=1e-3)
    assert frame.linear.max() < 0.3 * sharp.linear.max()
    truth = frame.truth[0]
    length = 140 * 5.0 * 0.05 / 3
    assert np.allclose(truth.blur_mean_xy, [79.5, 59.5], atol=1e-6)
    # the variance of 32 midpoints is that of the line less (length/32)²/12
    assert truth.blur_covariance_px2[0, 0] == pytest.approx(length**2 / 12, rel=2e-3)
    assert np.allclose(truth.blur_covariance_px2[[0, 1, 1], [1, 0, 1]], 0, atol=1e-9)
    assert not sharp.truth[0].blur_covariance_px2.any()


def test_moments_are_as_many_as_the_motion_asks_for() -> None:
    scene = Scene((Quad("wall", plain_texture(9), (9, 9), compose(rotation_about("x", 90), [0, 0, 1])),))
    camera = replace(CAMERA, exposure_s=0.05)
    assert 16 <= count_moments(scene, PosedCamera(camera, sideways(5.0))) <= 20  # 11.7 px
    assert count_moments(scene, PosedCamera(camera, sideways(1e-6))) == 2


def test_a_camera_that_stands_still_neither_rolls_nor_blurs() -> None:
    posed = still_camera(replace(CAMERA, row_time_s=1e-3, exposure_s=0.1), START)
    assert not posed.is_rolling
    assert not posed.is_blurred
    assert np.allclose(posed.project([[0, 0, 1]]), [[79.5, 59.5]])


def test_the_time_must_be_finite() -> None:
    with pytest.raises(SceneError, match="finite time"):
        render(Scene(), CAMERA, sideways(1.0), renderer="exact", time_s=np.nan)


def test_opengl_does_not_draw_a_rolling_shutter() -> None:
    with pytest.raises(SceneError, match="a rolling shutter"):
        render(Scene(), ROLLING, sideways(1.0), renderer="gl")
    assert render(Scene(), ROLLING, sideways(1.0)).renderer == "exact"
