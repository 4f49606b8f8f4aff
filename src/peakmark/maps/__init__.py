"""Maps of markers and arrays, from files, sheets and scenes; and where the camera is on them."""

from peakmark.maps.files import load_map, save_map
from peakmark.maps.locate import Location, locate
from peakmark.maps.marker_map import MarkerMap

__all__ = ["Location", "MarkerMap", "load_map", "locate", "save_map"]
