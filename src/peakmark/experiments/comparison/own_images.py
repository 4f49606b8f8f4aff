"""Images from a folder as frames of the comparison: markers, arrays and AprilTags where their truth says."""

from functools import cache
from pathlib import Path

import numpy as np

from peakmark.experiments.comparison.boards import TruePrint
from peakmark.experiments.comparison.frames import Shot
from peakmark.experiments.images.outcome import WHOLE, arrays_of, paper_of
from peakmark.experiments.images.truth import ImageSet, TrueImage, TrueMarker, read_set

LEAST_PX = 15.0
"""Smaller prints are left out."""


def shot_of(folder: Path, index: int) -> Shot:
    """Return an image of a folder; prints that are bent, covered, cut or smaller than `LEAST_PX` do not count."""
    known = _opened(folder)
    return Shot(known.read(index), (), tuple(prints_of(known.images[index])), None)


@cache
def _opened(folder: Path) -> ImageSet:
    return read_set(folder)


def prints_of(image: TrueImage) -> list[TruePrint]:
    """Return the prints of an image."""
    found = [_of_marker(marker) for marker in image.markers]
    for members in arrays_of(image.markers):
        parts = [_of_marker(marker) for marker in members]
        x, y = np.mean([part.xy for part in parts], axis=0)
        side, tilt = np.mean([part.side_px for part in parts]), np.mean([part.tilt_deg for part in parts])
        whole = len(parts) == 3 and all(part.is_whole for part in parts)
        code = members[0].code
        assert code is not None
        found.append(TruePrint("array", code, (float(x), float(y)), float(side), float(tilt), whole))
    for tag in image.tags:
        whole = tag.visible >= WHOLE and tag.side_px >= LEAST_PX
        found.append(TruePrint("AprilTag 36h11", tag.id, tag.xy, tag.side_px, tag.tilt_deg, whole))
    return found


def _of_marker(marker: TrueMarker) -> TruePrint:
    design = "binary marker" if marker.limit == "range" else "marker"
    whole = paper_of(marker) == "flat" and marker.side_px >= LEAST_PX
    return TruePrint(design, int(marker.polarity == "light"), marker.xy, marker.side_px, marker.tilt_deg, whole)
