"""The surroundings behind a scene."""

import numpy as np
import pytest
from peaksim import Camera, Scene
from peaksim.area.cells import Rays
from peaksim.area.integrate import band_rays
from peaksim.area.sky import Sky, in_channels, sky_levels, sky_of
from peaksim.geometry.pose import look_at
from peaksim.scene.lamps import Environment

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


def test_without_baked_light_the_background_is_plain() -> None:
    scene = Scene(lights=(Environment(0.5, IMAGE),), background=37.0)
    assert sky_of(scene, is_baked=False) == Sky(37.0, None, 0.0)
    assert levels_towards(sky_of(scene, is_baked=False), (0, 1, 0)).tolist() == [37.0]


def test_grey_and_colour_are_turned_into_each_other() -> None:
    assert in_channels(np.array([[3.0]]), 3).tolist() == [[3.0, 3.0, 3.0]]
    luma = 0.2126 * 10 + 0.7152 * 20 + 0.0722 * 30
    assert in_channels(np.array([[10.0, 20.0, 30.0]]), 1)[0, 0] == pytest.approx(luma)
