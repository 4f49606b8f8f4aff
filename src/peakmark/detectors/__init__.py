"""Key-point detectors by name: `surf`, `sift`, OpenCV's, VLFeat's, yours."""

from peakmark.detectors.registry import find_detector

__all__ = ["find_detector"]
