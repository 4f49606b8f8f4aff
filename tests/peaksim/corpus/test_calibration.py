"""Calibration files: OpenCV reads them back and projects as the camera does."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from peaksim.camera.camera import Camera
from peaksim.corpus.calibration import opencv_yaml

POINTS = np.random.default_rng(0).uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 2], (50, 3))


@pytest.mark.parametrize(
    ("distortion", "model", "name"),
    [
        ((), "brown", "plumb_bob"),
        ((-0.2, 0.05, 0.001, -0.002), "brown", "plumb_bob"),
        ((-0.2, 0.05, 0.001, -0.002, 0.01), "brown", "plumb_bob"),
        ((-0.2, 0.05, 0.001, -0.002, 0.01, 0.1, 0.02, 0.003), "brown", "rational_polynomial"),
        ((-0.2, 0.05, 0.001, -0.002, 0, 0, 0, 0, 0.01, 0, 0, 0.02), "brown", "rational_polynomial"),
        ((-0.2, 0.05, 0.001, -0.002, 0, 0, 0, 0, 0.01, 0, 0, 0.02, 0.1, -0.05), "brown", "rational_polynomial"),
        ((), "fisheye", "equidistant"),
        ((0.02, -0.01, 0.003, 0.001), "fisheye", "equidistant"),
    ],
)
def test_opencv_reads_the_camera_back(tmp_path: Path, distortion: tuple[float, ...], model: str, name: str) -> None:
    camera = Camera(640, 480, 501.25, 499.5, 320.125, 238.0, distortion, model)  # type: ignore[arg-type]
    (tmp_path / "c.yaml").write_text(opencv_yaml(camera, "left 'eye'"), encoding="utf-8")
    storage = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FileStorage_READ)
    assert storage.getNode("camera_name").string() == "left 'eye'"
    assert storage.getNode("distortion_model").string() == name
    assert [storage.getNode(f"image_{side}").real() for side in ("width", "height")] == [640, 480]
    matrix, k = storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat()
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    xy = project(POINTS[:, None], np.zeros(3), np.zeros(3), matrix, k)[0].reshape(-1, 2)
    assert np.allclose(xy, camera.project(POINTS), atol=1e-9)
