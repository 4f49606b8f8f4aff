"""OpenGL's image of face numbers, against the analytic ids at the middles of samples."""

import numpy as np
from peaksim import Camera, Mesh, Quad, Scene, Texture
from peaksim.area.shown import NUMBER_BITS, SAMPLES
from peaksim.camera.camera import resized
from peaksim.camera.shutter import still_camera
from peaksim.geometry.pose import compose, look_at
from peaksim.gl.context import draw_numbers
from peaksim.gl.tiles import split_into_tiles, window_of
from peaksim.truth.surfaces import surfaces
from scipy.ndimage import maximum_filter, minimum_filter

from tests.helpers import needs_gl

pytestmark = needs_gl
CAMERA = Camera(80, 60, 70.0, 70.0, 39.5, 29.5)
POSE = look_at([0, -2.0, 1.5], [0, 0.5, 0])
DEPTHS_M = (0.1, 50.0)


def cards(count: int) -> tuple[Quad, ...]:
    rng = np.random.default_rng(0)
    plain = Texture.from_array(np.zeros((1, 1), np.uint8))
    positions = [compose(look_at([0, 0, 0], rng.normal(size=3))[:3, :3], rng.uniform(-1, 1, 3)) for _ in range(count)]
    return tuple(Quad(f"card{k}", plain, (0.3, 0.2), position) for k, position in enumerate(positions))


def test_samples_show_the_number_of_the_face_at_their_middle() -> None:
    scene = Scene(cards(500))
    (tile,) = split_into_tiles(CAMERA)
    numbers = draw_numbers(scene, POSE, window_of(tile, is_pinhole=True), DEPTHS_M) & NUMBER_BITS
    expected = surfaces(scene, still_camera(resized(CAMERA, SAMPLES), POSE)).quad_ids + 1
    assert len(np.unique(expected)) > 255  # more than one byte holds
    assert set(np.flatnonzero(np.bincount(expected.ravel()) > 9)) <= set(numbers.ravel())
    # away from edges, for outlines are a sample wide; there, they show cards that are thinner than that
    inside = minimum_filter(expected, 3) == maximum_filter(expected, 3)
    assert inside.mean() > 0.5
    assert (numbers != expected)[inside].mean() < 1e-3


def test_triangles_are_numbered_after_the_quads() -> None:
    corners = np.array([[-9.0, 9, 0], [9, 9, 0], [0, -9, 0]])
    scene = Scene(cards(7), (Mesh("a", corners - [0, 0, 2], np.array([[0, 1, 2]])),))
    (tile,) = split_into_tiles(CAMERA)
    numbers = draw_numbers(scene, POSE, window_of(tile, is_pinhole=True), DEPTHS_M) & NUMBER_BITS
    assert numbers.max() == 8


def test_what_is_nearer_or_farther_is_not_drawn() -> None:
    (tile,) = split_into_tiles(CAMERA)
    window = window_of(tile, is_pinhole=True)
    assert not (draw_numbers(Scene(cards(50)), POSE, window, (20.0, 50.0)) & NUMBER_BITS).any()
    assert not (draw_numbers(Scene(cards(50)), POSE, window, (0.01, 0.02)) & NUMBER_BITS).any()
