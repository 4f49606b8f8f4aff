"""A camera as the YAML file that OpenCV's calibration writes and its samples read."""

import cv2
import numpy as np

from peaksim.camera.camera import Camera


def opencv_yaml(camera: Camera, name: str) -> str:
    """Return the text of a calibration file: sizes, camera_matrix, distortion_coefficients, distortion_model.

    The distortion is 1×n, one 0 …×5 for a pinhole; the model is named as ROS does: "plumb_bob" up to 5 coefficients,
    "rational_polynomial" for more, "equidistant" for OpenCV's fisheye.
    """
    brown = "rational_polynomial" if len(camera.distortion) > 5 else "plumb_bob"
    empty = 4 if camera.model == "fisheye" else 5
    distortion = np.array([camera.distortion or (0.0,) * empty], dtype=np.float64)
    storage = cv2.FileStorage("calibration.yaml", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    storage.write("camera_name", name)
    storage.write("image_width", camera.width)
    storage.write("image_height", camera.height)
    storage.write("camera_matrix", camera.matrix)
    storage.write("distortion_model", "equidistant" if camera.model == "fisheye" else brown)
    storage.write("distortion_coefficients", distortion)
    return str(storage.releaseAndGetString())
