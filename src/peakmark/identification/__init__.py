"""Key points → markers: `identify`, its searches, evidence and decisions."""

from peakmark.identification.api import Rule, detect_stretched, identify, identify_features
from peakmark.identification.detection import Detection, Identification
from peakmark.identification.search import SearchResult, search_image

__all__ = [
    "Detection",
    "Identification",
    "Rule",
    "SearchResult",
    "detect_stretched",
    "identify",
    "identify_features",
    "search_image",
]
