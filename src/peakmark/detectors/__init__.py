"""Key-point detectors by name: `surf`, `sift`, OpenCV's, VLFeat's, yours."""

from peakmark.detectors.outcome import Outcome, run_detector
from peakmark.detectors.registry import NAMES, Detector, find_detector, settings_of

__all__ = ["NAMES", "Detector", "Outcome", "find_detector", "run_detector", "settings_of"]
