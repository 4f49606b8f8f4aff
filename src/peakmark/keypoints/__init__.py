"""Key points as values and as files, and the grey image that detectors take."""

from peakmark.keypoints.files import load_settings
from peakmark.keypoints.image import as_gray
from peakmark.keypoints.keypoints import Keypoints

__all__ = ["Keypoints", "as_gray", "load_settings"]
