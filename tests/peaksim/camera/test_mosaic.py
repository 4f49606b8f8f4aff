"""Colour filters and what is computed from them: the layout, exact on ramps, blobs stay where they are."""

import numpy as np
import pytest
from peaksim.camera.mosaic import MOSAICS, behind_filters, demosaic
from peaksim.camera.sensor import Sensor, capture_image

from tests.peaksim.camera.blobs import blobs, centroids

INSIDE = slice(3, -3)


@pytest.mark.parametrize("mosaic", MOSAICS)
def test_photosites_see_the_colours_of_their_name(mosaic: str) -> None:
    light = np.zeros((6, 8, 3), np.float32) + np.array([1, 2, 3], np.float32)
    sites = behind_filters(light, mosaic)
    assert "".join("rgb"[int(v) - 1] for v in sites[:2, :2].ravel()) == mosaic
    assert np.array_equal(sites, np.tile(sites[:2, :2], (3, 4)))


@pytest.mark.parametrize("mosaic", MOSAICS)
def test_ramps_of_one_hue_come_back_exactly(mosaic: str) -> None:
    """The filters are exact where colours differ by a constant and levels are linear."""
    y, x = np.mgrid[:20, :24].astype(np.float32)
    light = (3 * x + 2 * y)[:, :, None] + np.array([10, 40, 5], np.float32)
    found = demosaic(behind_filters(light, mosaic), mosaic)
    assert np.allclose(found[INSIDE, INSIDE], light[INSIDE, INSIDE], atol=1e-3)


@pytest.mark.parametrize("mosaic", MOSAICS)
def test_one_pixel_counts_as_published(mosaic: str) -> None:
    """The response of a lone photosite is the filters themselves, whose columns are symmetric."""
    sites = np.zeros((20, 20), np.float32)
    sites[10, 10] = 16
    found = demosaic(sites, mosaic)
    assert found[10, 10].sum() == pytest.approx({1: 16 + 10 + 10, 0: 16 + 8 + 12, 2: 16 + 8 + 12}[MOSAICS[mosaic][0]])
    assert np.array_equal(found, found[::-1, ::-1][np.ix_(np.arange(-1, 19) % 20, np.arange(-1, 19) % 20)])


def test_raw_levels_are_those_of_the_photosites_and_linear() -> None:
    light = np.random.default_rng(0).uniform(0, 255, (8, 10, 3)).astype(np.float32)
    raw = capture_image(light, Sensor(mosaic="gbrg", output="raw", tone="srgb", bits=12), np.random.default_rng(0))
    assert raw.shape == (8, 10)
    assert np.array_equal(np.rint(raw * (4095 / 65535)), np.rint(behind_filters(light, "gbrg") * (4095 / 255)))


def test_blobs_stay_where_they_are_behind_a_mosaic() -> None:
    phases = np.random.default_rng(1).uniform(-0.5, 0.5, (12, 2))
    centers = np.array([(40 + 50 * (k % 4), 40 + 50 * (k // 4)) for k in range(12)]) + phases
    image = blobs((200, 240), centers, sigma_px=1.5)
    for output in ("grey", "rgb"):
        found = capture_image(image, Sensor(mosaic="rggb", output=output, bits=16), np.random.default_rng(0))
        for channel in np.atleast_3d(found).transpose(2, 0, 1):
            assert np.abs(centroids(channel, centers) - centers).max() < 0.01
