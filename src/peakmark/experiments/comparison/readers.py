"""Who reads which print, each with its own defaults: ours, and the libraries of the extra `compare`."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peakmark.detectors.tags import crossing, tag_detector
from peakmark.errors import InputError
from peakmark.experiments.comparison.prints import Design, ring_layout
from peakmark.experiments.images.peers import apriltag_detector
from peakmark.found.found import Found, found_in
from peakmark.identification.api import identify
from peakmark.identification.detection import Detection
from peakmark.version import __version__

Gray = NDArray[np.uint8]


@dataclass(frozen=True)
class Seen:
    """One print that was read."""

    id: int | None
    """None where the print carries none, or it was not read."""
    xy: NDArray[np.float64]
    """(2,) centre, px, pixel centres at integers."""
    corners_xy: NDArray[np.float64] | None = None
    """(4, 2) corners of its square, clockwise from the top left; None where only the centre is found."""


@dataclass(frozen=True)
class Reading:
    """What one image holds."""

    seen: tuple[Seen, ...]
    found: Found | None = None
    """Our own result, from which `locate` starts."""
    before_s: float = 0.0
    """Processor time of what another reader of the same image had computed for this one, too."""


Read = Callable[[Gray], Reading]


@dataclass(frozen=True)
class Reader:
    """A way to read one design."""

    name: str
    design: Design
    package: str
    """What pip calls it."""
    open: Callable[[], Read]
    """Raises an `InputError` that says how to install it where it is missing."""
    every: int = 1
    """It reads each n-th frame: slow ones need not see all."""
    has_id: bool = True
    """Whether an answer can be wrong: one that carries no number answers wherever something looks alike."""

    @property
    def version(self) -> str:
        """Of the package; "not installed" without it."""
        if self.package == "peakmark":
            return __version__
        try:
            return version(self.package)
        except PackageNotFoundError:
            return "not installed"


class _Latest:
    """The markers of the latest image, which two readers share."""

    def __init__(self) -> None:
        self._gray: Gray | None = None
        self._markers: tuple[Detection, ...] = ()
        self._cpu_s = 0.0

    def of(self, gray: Gray) -> tuple[tuple[Detection, ...], float]:
        """Return an image's markers, and the processor time that they took before this call."""
        if gray is self._gray:
            return self._markers, self._cpu_s
        start = process_time()
        self._markers = identify(gray)
        self._gray, self._cpu_s = gray, process_time() - start
        return self._markers, 0.0


_latest = _Latest()


def _markers() -> Read:
    def read(gray: Gray) -> Reading:
        markers, before_s = _latest.of(gray)
        seen = tuple(Seen(int(d.polarity == "light"), d.xy) for d in markers)
        return Reading(seen, Found(markers, (), (gray.shape[1], gray.shape[0])), before_s)

    return read


def _identified(**asked: Any) -> Read:
    """Return the reader that calls `identify` with these arguments."""

    def read(gray: Gray) -> Reading:
        markers = identify(gray, **asked)
        size = (gray.shape[1], gray.shape[0])
        return Reading(tuple(Seen(int(d.polarity == "light"), d.xy) for d in markers), Found(markers, (), size))

    return read


def _arrays() -> Read:
    def read(gray: Gray) -> Reading:
        markers, before_s = _latest.of(gray)
        found = found_in(gray, markers)
        return Reading(tuple(Seen(a.code, a.xy) for a in found.arrays if a.code is not None), found, before_s)

    return read


def _opencv(dictionary: str) -> Read:
    find = tag_detector(dictionary)
    return lambda gray: Reading(tuple(Seen(tag.id, tag.center_xy, tag.corners_xy) for tag in find(gray)))


_APRILTAG_ORDER = (1, 0, 3, 2)
"""AprilTag's corners begin at the top right and go against the clock."""


def _apriltag_c() -> Read:
    detector = apriltag_detector()

    def read(gray: Gray) -> Reading:
        found = [(int(t.tag_id), np.asarray(t.corners)[list(_APRILTAG_ORDER)] - 0.5) for t in detector.detect(gray)]
        return Reading(tuple(Seen(number, crossing(corners), corners) for number, corners in found))

    return read


def _locus(family: str) -> Read:
    try:
        import locus
    except ImportError as error:
        raise InputError("locus needs locus-tag: pip install 'peakmark[compare]'") from error
    detector = locus.Detector(threads=1, families=[getattr(locus.TagFamily, family)])

    def read(gray: Gray) -> Reading:
        batch = detector.detect(gray)
        corners = np.asarray(batch.corners, dtype=np.float64) - 0.5
        return Reading(tuple(Seen(int(n), crossing(c), c) for n, c in zip(batch.ids, corners, strict=True)))

    return read


def _rings() -> Read:
    layout = ring_layout()
    import ringgrid

    detector = ringgrid.Detector(ringgrid.DetectConfig(layout))

    def read(gray: Gray) -> Reading:
        rings = detector.detect_adaptive(gray).detected_markers
        return Reading(tuple(Seen(r.id, np.asarray(r.center)) for r in rings if r.id is not None))

    return read


def _corners() -> Read:
    try:
        import chess_corners
    except ImportError as error:
        raise InputError("chess corners need chess-corners: pip install 'peakmark[compare]'") from error
    detector = chess_corners.Detector(chess_corners.DetectorConfig.chess_multiscale().without_orientation())

    def read(gray: Gray) -> Reading:
        corners = detector.detect(np.ascontiguousarray(gray))
        return Reading(tuple(Seen(None, xy) for xy in np.asarray(corners.xy, dtype=np.float64)))

    return read


READERS = (
    Reader("identify", "marker", "peakmark", _markers),
    Reader("identify binary", "binary marker", "peakmark", lambda: _identified(limit="range")),
    Reader("identify SIFT", "SIFT marker", "peakmark", lambda: _identified(detector="sift")),
    Reader("disc by SIFT", "disc", "peakmark", lambda: _identified(detector="sift", limit="range")),
    Reader("disc by SURF", "disc", "peakmark", lambda: _identified(detector="surf-disc")),
    Reader("decode_arrays", "array", "peakmark", _arrays),
    Reader("AprilTag-C", "AprilTag 36h11", "pupil-apriltags", _apriltag_c),
    Reader(
        "OpenCV AprilTag", "AprilTag 36h11", "opencv-contrib-python-headless", lambda: _opencv("DICT_APRILTAG_36h11")
    ),
    Reader("locus AprilTag", "AprilTag 36h11", "locus-tag", lambda: _locus("AprilTag36h11")),
    Reader("OpenCV ArUco", "ArUco 4×4", "opencv-contrib-python-headless", lambda: _opencv("DICT_4X4_50")),
    Reader("locus ArUco", "ArUco 4×4", "locus-tag", lambda: _locus("ArUco4x4_50")),
    Reader("ringgrid", "ring", "ringgrid", _rings, every=3),
    Reader("chess-corners", "chess corner", "chess-corners", _corners, has_id=False),
)
"""All of them, ours first. Libraries run with their defaults, on one thread, without decimation where they have one."""
