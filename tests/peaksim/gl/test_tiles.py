"""Tiles cover the image once, and a window shows every direction of its tile where its matrix says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim import Camera
from peaksim.area.shown import SAMPLES
from peaksim.gl.tiles import LEAST_COSINE, LONGEST_PX, split_into_tiles, swap_rotation, window_of

CAMERAS = {
    "pinhole": Camera(2300, 700, 900.0, 910.0, 1200.0, 333.0),
    "tall": Camera(3, 1500, 900.0, 910.0, 1.0, 333.0),
    "brown": Camera(160, 120, 140.0, 140.0, 79.5, 59.5, (-0.28, 0.09, 0.001, -0.002, -0.01)),
    "fisheye": Camera(160, 120, 45.0, 45.0, 79.5, 59.5, model="fisheye"),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_tiles_cover_the_image_once(name: str) -> None:
    camera = CAMERAS[name]
    covered = np.zeros((camera.height, camera.width), int)
    for tile in split_into_tiles(camera):
        covered[tile.rows, tile.columns] += 1
        assert max(covered[tile.rows, tile.columns].shape) <= LONGEST_PX
        assert tile.rays.shape == (*(np.array(covered[tile.rows, tile.columns].shape) + 1), 3)
        corner = camera.unproject([[tile.columns.start - 0.5, tile.rows.start - 0.5]])[0]
        assert np.allclose(tile.rays[0, 0], corner)
    assert (covered == 1).all()


@pytest.mark.parametrize("name", CAMERAS)
def test_a_window_shows_the_whole_tile(name: str) -> None:
    camera = CAMERAS[name]
    for tile in split_into_tiles(camera):
        window = window_of(tile, camera.is_pinhole)
        positions = tile.rays @ window.samples_from_camera.T
        assert (positions[:, :, 2] > 0).all()
        columns, rows = np.moveaxis(positions[:, :, :2] / positions[:, :, 2:], 2, 0)
        assert columns.min() == pytest.approx(0, abs=1e-6)
        assert columns.max() == pytest.approx(window.columns)
        assert rows.min() == pytest.approx(0, abs=1e-6)
        assert rows.max() == pytest.approx(window.rows)
        lengths = np.linalg.norm(tile.rays, axis=2)
        assert (positions[:, :, 2] / lengths >= window.slant - 1e-12).all()
        if not camera.is_pinhole:
            assert window.slant > LEAST_COSINE / 1.5


def test_samples_lie_evenly_in_the_pixels_of_a_pinhole() -> None:
    camera = CAMERAS["pinhole"]
    for tile in split_into_tiles(camera):
        positions = tile.rays @ window_of(tile, is_pinhole=True).samples_from_camera.T
        assert np.allclose(positions[0, :, 0], SAMPLES * np.arange(positions.shape[1]), atol=1e-8)
        assert np.allclose(positions[:, 0, 1], SAMPLES * np.arange(positions.shape[0]), atol=1e-8)


@given(st.floats(0, 3.0), st.floats(-4, 4))
def test_a_half_turn_is_a_rotation_that_swaps_two_directions(polar: float, azimuth: float) -> None:
    direction = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    rotation = swap_rotation(direction)
    assert np.allclose(rotation @ rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert np.allclose(rotation[:, 2], direction, atol=1e-9)
