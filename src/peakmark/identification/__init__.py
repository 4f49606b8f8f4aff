"""Key points → markers: `identify`, its evidence and its decision."""

from peakmark.identification.api import identify
from peakmark.identification.detection import Detection, Identification

__all__ = ["Detection", "Identification", "identify"]
