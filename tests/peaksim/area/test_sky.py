"""The surroundings behind a scene."""

import cv2
import numpy as np
import pytest
from peaksim import Camera, Mesh, Scene, render
from peaksim.area.cells import Rays
from peaksim.area.integrate import band_rays
from peaksim.area.sky import Sky, in_channels, sky_levels, sky_of
from peaksim.geometry.pose import look_at
from peaksim.scene.lamps import Environment

from tests.peaksim.traced.helpers import needs_tracing

IMAGE = np.linspace(0, 1, 8 * 16, dtype=np.float32).reshape(8, 16)


def levels_towards(sky: Sky, target: tuple[float, float, float]) -> np.ndarray:
    """Return what one narrow pixel shows."""
    camera = Camera(1, 1, 1e4, 1e4, 0.0, 0.0)
    up = (0.0, 1.0, 0.0) if target[:2] == (0, 0) else (0.0, 0.0, 1.0)
    rays: Rays = band_rays(camera, slice(0, 1))
    return sky_levels(sky, rays, look_at((0, 0, 0), target, up)[None, :3, :3], 1)[0, 0]


@pytest.mark.parametrize(
    ("target", "row", "columns"),
    [
        ((0, 1, 0), (3, 4), (7, 8)),  # along y: the middle of the image
        ((1, 0, 0), (3, 4), (11, 12)),  # x: a quarter to the right
        ((-1, 0, 0), (3, 4), (3, 4)),
        ((0, -1, 0), (3, 4), (15, 0)),  # where the image closes
    ],
)
def test_directions_show_their_part_of_the_image(
    target: tuple[float, float, float], row: tuple[int, int], columns: tuple[int, int]
) -> None:
    sky = sky_of(Scene(lights=(Environment(0.5, IMAGE),)), is_baked=True)
    expected = 127.5 * IMAGE[np.ix_(row, columns)].mean()
    assert levels_towards(sky, target)[0] == pytest.approx(expected, rel=1e-3)


def test_the_first_row_is_straight_up_and_yaw_turns_counter_clockwise() -> None:
    scene = Scene(lights=(Environment(1.0, np.repeat(IMAGE[:, :1], 16, axis=1)),))
    assert levels_towards(sky_of(scene, is_baked=True), (0, 0, 1))[0] == pytest.approx(255 * IMAGE[0, 0], abs=1e-3)
    turned = sky_of(Scene(lights=(Environment(0.5, IMAGE, 90.0),)), is_baked=True)
    plain = sky_of(Scene(lights=(Environment(0.5, IMAGE),)), is_baked=True)
    assert levels_towards(turned, (-1, 0, 0.1))[0] == pytest.approx(levels_towards(plain, (0, 1, 0.1))[0], abs=1e-6)


@needs_tracing
@pytest.mark.parametrize("channels", [1, 3])
def test_the_background_is_that_of_a_path_traced_image(channels: int) -> None:
    image = cv2.GaussianBlur(np.random.default_rng(0).uniform(0, 1, (32, 64, 3)).astype(np.float32), (0, 0), 2)
    light = Environment(0.9, image if channels == 3 else image[:, :, 0], 30.0)
    red = Mesh("red", np.eye(3), np.array([[0, 1, 2]]), color=(100.0, 0.0, 0.0))  # far below what is seen
    moved = Mesh("red", red.vertices_m - [0, 0, 9], red.faces, color=red.color)
    scene, camera = Scene((), (moved,), (light,)), Camera(48, 36, 45.0, 45.0, 23.5, 17.5)
    pose = look_at((0.3, -1, 0.6), (0, 0, 1.2))
    traced = render(scene, camera, pose, "traced", samples=64).linear
    rays, rotations = band_rays(camera, slice(0, 36)), pose[None, :3, :3]
    assert np.abs(sky_levels(sky_of(scene, is_baked=True), rays, rotations, 3) - traced).max() < 3
    assert np.ptp(traced) > 20


def test_without_baked_light_the_background_is_plain() -> None:
    scene = Scene(lights=(Environment(0.5, IMAGE),), background=37.0)
    assert sky_of(scene, is_baked=False) == Sky(37.0, None, 0.0)
    assert levels_towards(sky_of(scene, is_baked=False), (0, 1, 0)).tolist() == [37.0]


def test_grey_and_colour_are_turned_into_each_other() -> None:
    assert in_channels(np.array([[3.0]]), 3).tolist() == [[3.0, 3.0, 3.0]]
    luma = 0.2126 * 10 + 0.7152 * 20 + 0.0722 * 30
    assert in_channels(np.array([[10.0, 20.0, 30.0]]), 1)[0, 0] == pytest.approx(luma)
