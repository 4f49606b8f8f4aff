"""Cameras: projection and lens, shutter, sensor, and the frame that they take."""

from peaksim.camera.camera import Camera
from peaksim.camera.frame import Frame, MarkerTruth
from peaksim.camera.models import camera_named
from peaksim.camera.sensor import Sensor

__all__ = ["Camera", "Frame", "MarkerTruth", "Sensor", "camera_named"]
