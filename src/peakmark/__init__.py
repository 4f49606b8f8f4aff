"""peakmark: maximum detector response markers for SIFT and SURF (Schweiger et al., 2009).

Names are imported when first used, so that `import peakmark` stays quick and compiles nothing.
"""

from typing import TYPE_CHECKING

from peaksim.lazy import lazy_names

if TYPE_CHECKING:
    from peakmark import surf as surf
    from peakmark.arrays.decode import decode_arrays as decode_arrays
    from peakmark.found.absence import why_nothing as why_nothing
    from peakmark.found.found import Found as Found
    from peakmark.found.found import find as find
    from peakmark.identification.api import identify as identify
    from peakmark.identification.detection import Detection as Detection
    from peakmark.identification.from_keypoints import identify_keypoints as identify_keypoints
    from peakmark.keypoints.keypoints import Keypoints as Keypoints
    from peakmark.localise.locate import FloorMap as FloorMap
    from peakmark.maps.files import load_map as load_map
    from peakmark.maps.locate import Location as Location
    from peakmark.maps.locate import locate as locate
    from peakmark.maps.marker_map import MarkerMap as MarkerMap
    from peakmark.markers import patterns as marker  # noqa: F401 — a public name, like all others
    from peakmark.report.picture import overlay as overlay
    from peakmark.version import __version__ as __version__

__all__, __getattr__, __dir__ = lazy_names(
    __name__,
    {
        "__version__": "peakmark.version",
        "Detection": "peakmark.identification.detection",
        "FloorMap": "peakmark.localise.locate",
        "Found": "peakmark.found.found",
        "Keypoints": "peakmark.keypoints.keypoints",
        "Location": "peakmark.maps.locate",
        "MarkerMap": "peakmark.maps.marker_map",
        "decode_arrays": "peakmark.arrays.decode",
        "find": "peakmark.found.found",
        "identify": "peakmark.identification.api",
        "identify_keypoints": "peakmark.identification.from_keypoints",
        "load_map": "peakmark.maps.files",
        "locate": "peakmark.maps.locate",
        "marker": "peakmark.markers.patterns",
        "overlay": "peakmark.report.picture",
        "surf": "peakmark.surf",
        "why_nothing": "peakmark.found.absence",
    },
)
