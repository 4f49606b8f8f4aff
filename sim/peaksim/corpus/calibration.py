"""A camera as the YAML file that OpenCV's calibration writes and its samples read."""

from dataclasses import asdict

from peaksim.camera.calibration_file import opencv_text
from peaksim.camera.camera import Camera


def opencv_yaml(camera: Camera, name: str) -> str:
    """Return the text of a calibration file; see `peaksim.camera.calibration_file.opencv_text`."""
    return opencv_text(asdict(camera), name)
