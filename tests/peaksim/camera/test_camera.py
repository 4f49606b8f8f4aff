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


def test_the_focal_length_is_the_mean_of_both_and_none_of_a_fisheye(camera: Camera) -> None:
    assert camera.focal_px == (None if camera.model == "fisheye" else pytest.approx(np.sqrt(camera.fx * camera.fy)))


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


@pytest.mark.parametrize("flags", [0, cv2.CALIB_RATIONAL_MODEL, cv2.CALIB_THIN_PRISM_MODEL, cv2.CALIB_TILTED_MODEL])
def test_a_camera_takes_what_opencvs_calibration_returns(flags: int) -> None:
    board = np.float32(np.indices((9, 6, 1)).reshape(3, -1).T * 0.03)
    truth = CAMERAS["rational8" if flags == cv2.CALIB_RATIONAL_MODEL else "brown5"]
    views = [(np.array([a, b, 0.1 * a]), np.array([-0.13, -0.08, 0.21])) for a in (-0.4, 0.0, 0.4) for b in (-0.4, 0.4)]
    seen = [np.float32(cv2.projectPoints(board, *view, truth.matrix, np.array(truth.distortion))[0]) for view in views]
    _, matrix, distortion, *_ = cv2.calibrateCamera([board] * len(seen), seen, (640, 480), None, None, flags=flags)
    (fx, _, cx), (_, fy, cy), _ = matrix
    assert distortion.shape in ((1, 5), (1, 12), (1, 14))
    camera = Camera(640, 480, fx, fy, cx, cy, distortion)
    assert camera == Camera(640, 480, fx, fy, cx, cy, distortion.T) == Camera(640, 480, fx, fy, cx, cy, distortion[0])
    inside = np.concatenate([3.0 * truth.unproject(xy[:, 0]) for xy in seen])
    expected = cv2.projectPoints(inside, np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)
    assert np.allclose(camera.project(inside), expected, rtol=0, atol=1e-9)


def test_the_rational_models_six_zeros_change_nothing() -> None:
    eight = CAMERAS["rational8"]
    fourteen = replace(eight, distortion=(*eight.distortion, *6 * (0.0,)))
    points = np.random.default_rng(1).uniform([-0.4, -0.3, 1], [0.4, 0.3, 2], (200, 3))
    assert np.array_equal(fourteen.project(points), eight.project(points))
    assert np.array_equal(fourteen.unproject(image_points(eight)), eight.unproject(image_points(eight)))


@pytest.mark.parametrize(
    ("distortion", "message"),
    [
        (np.zeros((2, 4)), r"expected OpenCV's vector, got an array of shape \(2, 4\)"),
        (np.zeros((1, 1, 5)), "expected OpenCV's vector"),
        (("k1", "k2", "p1", "p2"), "expected numbers, got"),
        ((0.1, np.nan, 0, 0), "expected finite numbers"),
        ((0.1,) * 6, r"expected one of \(0, 4, 5, 8, 12, 14\) coefficients for brown, got 6"),
    ],
)
def test_what_is_no_vector_of_opencv_is_refused(distortion: object, message: str) -> None:
    with pytest.raises(SceneError, match=f"camera: distortion: {message}"):
        Camera(distortion=distortion)  # type: ignore[arg-type]


def test_a_prism_shows_nothing_beyond_its_fold() -> None:
    """x − x²/10 comes back to the image's middle at x = 10."""
    camera = Camera(distortion=(*8 * (0.0,), -0.1, 0.0, 0.0, 0.0))
    assert camera.project([[1, 0, 1]])[0] == pytest.approx([319.5 + 500 * 0.9, 239.5])
    assert np.isnan(camera.project([[6, 0, 1], [10, 0, 1]])).all()


def test_what_is_not_given_follows_from_what_is_as_in_scene_files() -> None:
    assert Camera(640, 480, fx=550) == Camera(640, 480, 550.0, 550.0, 319.5, 239.5)
    assert Camera(320, 200, fx=250.0, fy=260.0) == Camera(320, 200, 250.0, 260.0, 159.5, 99.5)
    assert Camera() == Camera(640, 480, 500.0, 500.0, 319.5, 239.5)


@pytest.mark.parametrize("field", ["fx", "fy", "cx", "cy", "row_time_s", "exposure_s"])
@pytest.mark.parametrize("value", [np.nan, np.inf, "wide", [1.0, 2.0], [[1.0], [2.0, 3.0]]])
def test_a_number_that_is_none_is_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(SceneError, match=f"camera: {field}: expected a finite number, got"):
        Camera(**{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("size", "message"), [((0, 10), "width"), ((10, -1), "height"), ((100_000, 1000), "at most")])
def test_cameras_of_no_or_of_monstrous_size_are_refused(size: tuple[int, int], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Camera(*size)


@pytest.mark.parametrize("distortion", [(-1.5, 0, 0, 0), (0.0, -4.0, 0.0, 0.0)])
def test_a_lens_that_folds_the_image_is_refused(distortion: tuple[float, ...]) -> None:
    with pytest.raises(SceneError, match="expected a lens that can be inverted over the whole image"):
        Camera(640, 480, 300.0, 300.0, 319.5, 239.5, distortion)
