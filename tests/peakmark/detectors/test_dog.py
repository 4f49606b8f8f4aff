"""The DoG at key points: against blurred images and OpenCV's own response; its sign on rendered markers."""

import cv2
import numpy as np
import pytest
from peaksim import Camera, Scene, render
from peaksim.camera.sensor import Sensor, capture_image
from peaksim.geometry.pose import look_at
from peaksim.image_file import read_image
from peaksim.scene.placing import marker as placed_marker
from peaksim.shipped import ASSETS

from peakmark import marker
from peakmark.detectors.dog import dog_responses
from peakmark.detectors.registry import find_detector


def test_it_is_the_difference_of_blurred_images():
    image = cv2.copyMakeBorder(marker.sift_marker(6.0, 73), 44, 44, 44, 44, cv2.BORDER_REPLICATE)
    wide, narrow = (
        cv2.GaussianBlur(image / 255.0, (0, 0), s, borderType=cv2.BORDER_REPLICATE) for s in (4 * 2 ** (1 / 3), 4)
    )
    xy = np.array([(80, 80), (75, 90), (3, 1)])
    expected = (wide - narrow)[xy[:, 1], xy[:, 0]]
    np.testing.assert_allclose(dog_responses(image, xy, np.full(3, 4.0)), expected, atol=2e-4)


def test_many_at_once_are_those_of_each_alone():
    image = read_image(ASSETS / "textures" / "gravel.png")
    rng = np.random.default_rng(0)
    xy, sigma = rng.uniform(0, 511, (60, 2)), np.repeat([0.8, 2.5, 2.6, 70.0], 15)
    alone = [dog_responses(image, xy[k], sigma[k])[0] for k in range(60)]
    np.testing.assert_array_equal(dog_responses(image, xy, sigma), alone)
    assert dog_responses(image, np.zeros((0, 2)), np.zeros(0)).shape == (0,)


def test_at_opencvs_key_points_it_is_what_opencv_found_but_for_its_sign():
    image = read_image(ASSETS / "textures" / "gravel.png")
    found = find_detector("sift", describe=False)(image)
    ratio = np.abs(dog_responses(image, found.xy, found.size / 2)) / found.response
    assert len(found) > 1000
    assert ratio.min() > 0.8  # the filters differ by the blur that OpenCV takes an image to have
    assert ratio.max() < 1.2
    negative = find_detector("sift", describe=False)(255 - image)
    assert [(negative.laplacian == sign).sum() for sign in (1, 0, -1)] == [
        (found.laplacian == sign).sum() for sign in (-1, 0, 1)
    ]


@pytest.mark.parametrize("kind", ["sift-dark", "sift-light", "sift-range-dark", "sift-range-light"])
@pytest.mark.parametrize("side_px", [20, 36, 60, 100, 180])
def test_the_sign_tells_dark_from_light_at_every_size_and_blur(kind, side_px):
    paper = placed_marker(kind, 0.1, border_m=0.02)
    size, focal = 2 * side_px + 41, side_px / 0.1
    camera = Camera(size, size, focal, focal, size / 2 - 0.3, size / 2 - 0.7)
    frame = render(Scene((paper,), background=90), camera, look_at([0, 0, 1], [0, 0, 0], up=(0, 1, 0)), "exact")
    for blur in (0.0, 0.03, 0.08):
        sensor = Sensor(defocus_px=blur * side_px, read_noise=2.0)
        found = find_detector("sift", describe=False)(capture_image(frame.linear, sensor, np.random.default_rng(0)))
        is_central = np.linalg.norm(found.xy - frame.truth[0].center_xy, axis=1) < 2
        is_central &= np.abs(np.log(found.size / side_px / 0.14)) < np.log(1.5)  # not the paper around it
        assert is_central.any()
        assert set(found.laplacian[is_central]) == {-1 if kind.endswith("light") else 1}
