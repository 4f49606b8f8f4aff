"""AprilTag 36h11 in the same images: by AprilTag's own C library (extra `compare`) and by OpenCV."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.tags import tag_detector
from peakmark.errors import InputError

PEERS = ("AprilTag-C", "OpenCV ArUco")


@dataclass(frozen=True)
class SeenTag:
    """A tag that a peer found."""

    id: int
    xy: NDArray[np.float64]
    """(2,) centre, px."""


Peer = Callable[[NDArray[np.uint8]], list[SeenTag]]


def open_peer(name: str) -> Peer:
    """Return one of `PEERS` as a function of a (H, W) image.

    Raises
    ------
    InputError
        If there is none of that name, or its library is not installed: the line says how.
    """
    if name == "OpenCV ArUco":
        find = tag_detector("DICT_APRILTAG_36h11")
        return lambda gray: [SeenTag(tag.id, tag.center_xy) for tag in find(gray)]
    if name != "AprilTag-C":
        raise InputError(f"peer: expected one of {', '.join(PEERS)}, got {name!r}")
    detector = apriltag_detector()
    return lambda gray: [SeenTag(int(t.tag_id), np.asarray(t.center) - 0.5) for t in detector.detect(gray)]


def apriltag_detector() -> Any:
    """Return AprilTag's own detector of 36h11, on one thread and without decimation; an `InputError` without it.

    Its corners and centres are from the image's corner, half a pixel more than ours.
    """
    try:
        from pupil_apriltags import Detector
    except ImportError as error:
        raise InputError("AprilTag-C needs pupil-apriltags: pip install 'peakmark[compare]'") from error
    return Detector("tag36h11", nthreads=1, quad_decimate=1.0)
