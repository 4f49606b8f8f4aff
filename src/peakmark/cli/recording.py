"""What `peakmark identify` found as a recording for robotics tools."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from peakmark.cli.identify_files import Identified
from peakmark.cli.locating import Locator
from peakmark.cli.sources import SourceImage
from peakmark.found.rows import FoundRow
from peakmark.keypoints.image import as_gray
from peakmark.recording.moment import Moment
from peakmark.recording.recorder import recorder

_APART_S = 1.0
"""From an image, or the end of a film, to the next one."""


@contextmanager
def recording_into(path: Path | None, locator: Locator | None) -> Iterator[Callable[[SourceImage, Identified], None]]:
    """Give a function that adds an image and what was found in it to a recording; it does nothing without a path."""
    if path is None:
        yield lambda each, identified: None
        return
    last_s, start_s = -_APART_S, 0.0
    marker_map = None if locator is None else locator.marker_map
    with recorder(path, None if marker_map is None or marker_map.pages is not None else marker_map) as append:

        def add(each: SourceImage, identified: Identified) -> None:
            nonlocal last_s, start_s
            time_s = start_s + (each.time_s or 0.0)
            if time_s <= last_s:  # another source, whose times begin anew
                start_s += last_s + _APART_S - time_s
                time_s = last_s + _APART_S
            last_s = time_s
            append(_moment(each, identified, time_s, locator))

        yield add


def _moment(each: SourceImage, identified: Identified, time_s: float, locator: Locator | None) -> Moment:
    pose = identified.pose
    return Moment(
        time_s,
        each.image if each.image.dtype == np.uint8 else as_gray(each.image),
        None if locator is None else locator.camera_of(each),
        tuple((_name(row), np.array(row.corners)) for row in identified.rows),
        None if pose is None else pose.world_from_camera,
        None if pose is None else pose.covariance,
    )


def _name(row: FoundRow) -> str:
    if row.kind == "array":
        return "array ?" if row.code is None else f"array {row.code}"
    return str(row.polarity)
