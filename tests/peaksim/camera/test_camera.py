"""The projection against OpenCV's, its inverse, and cameras of another size."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from peaksim import Camera
from peaksim.camera.camera import resized
from peaksim.errors import SceneError

from tests.peaksim.views import LENSES

CAMERAS = {"pinhole": Camera(fx=500.0, fy=510.0, cx=310.0, cy=250.0), **LENSES}


@pytest.fixture(params=CAMERAS)
def camera(request: pytest.FixtureRequest) -> Camera:
    return CAMERAS[request.param]


def image_points(camera: Camera) -> np.ndarray:
    high = [camera.width - 0.5, camera.height - 0.5]
    return np.random.default_rng(0).uniform(-0.5, high, (300, 2))


def test_points_project_where_opencv_says(camera: Camera) -> None:
    points = np.random.default_rng(1).uniform([-0.4, -0.3, 1], [0.4, 0.3, 2], (200, 1, 3))
    project = cv2.fisheye.projectPoints if camera.model == "fisheye" else cv2.projectPoints
    distortion = np.array(camera.distortion or [0.0] * 4)
    expected = project(points, np.zeros(3), np.zeros(3), camera.matrix, distortion)[0].reshape(-1, 2)
    assert np.allclose(camera.project(points[:, 0]), expected, atol=1e-9)


def test_unprojection_is_the_inverse(camera: Camera) -> None:
    xy = image_points(camera)
    assert np.allclose(camera.project(3.0 * camera.unproject(xy)), xy, atol=1e-8)


@pytest.mark.parametrize("scale", [0.5, 2.0, 0.37])
def test_a_resized_camera_has_the_same_field_of_view(camera: Camera, scale: float) -> None:
    other = resized(camera, scale)
    assert (other.width, other.height) == (round(640 * scale), round(480 * scale))
    assert replace(other, width=640, height=480, fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy) == camera
    rays = camera.unproject(image_points(camera))
    shares = (camera.project(rays) + 0.5) / [640, 480]
    assert np.allclose((other.project(rays) + 0.5) / [other.width, other.height], shares)


def test_the_image_reaches_half_a_pixel_beyond_the_outermost_centres() -> None:
    camera = Camera(width=4, height=3, fx=4.0, fy=4.0, cx=1.5, cy=1.0)
    xy = np.array([[-0.5, -0.5], [3.5, 2.5], [-0.51, 0], [0, 2.51], [np.nan, 0]])
    assert camera.contains(xy).tolist() == [True, True, False, False, False]
    centers = camera.pixel_centers()
    assert centers.shape == (3, 4, 2)
    assert centers[2, 1].tolist() == [1, 2]
    assert camera.contains(centers.reshape(-1, 2)).all()


@pytest.mark.parametrize(("size", "message"), [((0, 10), "width"), ((10, -1), "height"), ((100_000, 1000), "at most")])
def test_cameras_of_no_or_of_monstrous_size_are_refused(size: tuple[int, int], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Camera(*size)


@pytest.mark.parametrize("distortion", [(-1.5, 0, 0, 0), (0.0, -4.0, 0.0, 0.0)])
def test_a_lens_that_folds_the_image_is_refused(distortion: tuple[float, ...]) -> None:
    with pytest.raises(SceneError, match="expected a lens that can be inverted over the whole image"):
        Camera(640, 480, 300.0, 300.0, 319.5, 239.5, distortion)
