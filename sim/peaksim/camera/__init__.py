"""Cameras: projection and lens, shutter, sensor, and the frame that they take."""

from peaksim.camera.camera import Camera, from_sensor, resized
from peaksim.camera.frame import Ellipse, Frame, MarkerTruth, Surfaces
from peaksim.camera.models import camera_named
from peaksim.camera.presets import sensor_named
from peaksim.camera.sensor import Sensor, apply_sensor, capture_image
from peaksim.camera.shutter import PosedCamera, still_camera

__all__ = [
    "Camera",
    "Ellipse",
    "Frame",
    "MarkerTruth",
    "PosedCamera",
    "Sensor",
    "Surfaces",
    "apply_sensor",
    "camera_named",
    "capture_image",
    "from_sensor",
    "resized",
    "sensor_named",
    "still_camera",
]
