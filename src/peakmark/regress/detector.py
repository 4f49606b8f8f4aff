"""What can be tested: anything that finds points in an image, under one name and with one form of result.

| name | what it finds |
|---|---|
| identify | SURF markers, light and dark, by `peakmark.identify(image)`, which searches everywhere |
| markers | the same in one stretch of a floor, by its rule "joint" |
| cave-markers | the same by the classifier of the CAVE, for dense posters |
| aruco, aruco:DICT_… | ArUco tags of OpenCV, 4×4 with 50 codes or another dictionary |
| apriltag | AprilTag 36h11, by OpenCV |
| surf, surf-paper, surf-opencv, sift, sift-opencv, vlfeat | key points, see `peakmark.detectors` |
| cv2:NAME | key points of any `cv2.Feature2D`, such as cv2:ORB or cv2:xfeatures2d.StarDetector |
| module:function | your function of an image, in a process of its own |
| exec:PROGRAM ARGUMENTS | your program, which gets images and answers in JSON lines; see `regress.detector_protocol` |

The last three run in a process that is stopped when it takes longer than the time limit.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from peakmark.detectors.registry import NAMES, find_detector, settings_of
from peakmark.detectors.tags import Tag, tag_detector
from peakmark.errors import InputError
from peakmark.identification import api as identification
from peakmark.identification.detection import Detection
from peakmark.identification.search import search_image
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import Polarity
from peakmark.regress.detector_process import open_process
from peakmark.regress.detector_protocol import Found

FrameDetector = Callable[[NDArray[np.uint8]], Found]
"""Takes a (H, W) uint8 image. Raises DetectorFailure where it failed on this image and may answer the next."""

TAGS = {"aruco": "DICT_4X4_50", "apriltag": "DICT_APRILTAG_36h11"}


Parameter = Annotated[float, Field(allow_inf_nan=False)] | int | bool | str


@dataclass(frozen=True)
class DetectorSettings:
    """Which detector, and its settings."""

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)

    name: str = "markers"
    """See the table above."""
    stretch: float = 2.0
    """Vertical stretch of the image before "markers" searches it; 0.25…8."""
    parameters: dict[str, Parameter] = field(default_factory=dict)
    """Of the detector: threshold, octaves, layers, … ; for "markers" those of SURF."""
    time_limit_s: float = 10.0
    """For one image, where the detector is a process."""
    start_limit_s: float = 60.0
    """For its start, and once more on top of the time limit of the first image, on which much code warms up; a
    detector that hangs there does not get it again before it has answered."""

    def __post_init__(self) -> None:
        if not 0.25 <= self.stretch <= 8:
            raise InputError(f"stretch: expected 0.25…8, got {self.stretch}")
        for name, limit_s in (("time limit", self.time_limit_s), ("start limit", self.start_limit_s)):
            if not 0 < limit_s <= 86_400:
                raise InputError(f"{name}: expected more than 0 and at most 86400 s, got {limit_s}")


@contextmanager
def open_detector(settings: DetectorSettings) -> Iterator[FrameDetector]:
    """Give a detector; one in a process of its own is started and stopped with the block.

    Raises
    ------
    InputError
        If there is no such detector, or it cannot be started.
    """
    name = settings.name
    if name.startswith("exec:") or (":" in name and not name.startswith("aruco:")):
        with open_process(name, settings.parameters, settings.time_limit_s, settings.start_limit_s) as detector:
            yield detector
    else:
        yield built_in_detector(settings)


def built_in_detector(settings: DetectorSettings) -> FrameDetector:
    """Return one of our own or of OpenCV's detectors.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    name, _, dictionary = settings.name.partition(":")
    if name == "markers":
        return partial(_find_markers, settings.stretch, settings.parameters)
    if settings.parameters and (name in ("identify", "cave-markers") or name in TAGS):
        raise InputError(f"detector {name}: expected no parameters, got {', '.join(settings.parameters)}")
    if name == "identify":
        return lambda image: Found(Keypoints.empty(), identification.identify(image))
    if name == "cave-markers":
        return _find_by_classifier
    if name in TAGS:
        return _tag_detector(dictionary or TAGS[name])
    if name in NAMES:
        settings_of(name, settings.parameters)  # refuses those that it does not take
        detector = find_detector(name)
        return lambda image: Found(strongest_first(detector(image, **settings.parameters)), None)
    known = ", ".join(("identify", "markers", "cave-markers", *TAGS, *NAMES, "cv2:NAME", "module:function"))
    raise InputError(f"detector: expected one of {known} or exec:PROGRAM, got {name!r}")


def _find_markers(stretch: float, parameters: dict[str, Any], image: NDArray[np.uint8]) -> Found:
    """Find light and dark markers among the features of one stretched image."""
    features = identification.detect_stretched(image, stretch, **parameters)
    both = [
        d
        for polarity in get_args(Polarity)
        for d in identification.identify_features(image, features, polarity, stretch=stretch).detections
    ]
    ordered = sorted(both, key=lambda detection: -detection.response)
    return Found(features, tuple(replace(detection, id=i) for i, detection in enumerate(ordered)))


def _find_by_classifier(image: NDArray[np.uint8]) -> Found:
    """Find light and dark markers by the classifier of the CAVE."""
    both = search_image(image)
    return Found(both.features, both.detections)


def _tag_detector(dictionary: str) -> FrameDetector:
    find_tags = tag_detector(dictionary)
    return lambda image: Found(Keypoints.empty(), tuple(_tag(i, tag) for i, tag in enumerate(find_tags(image))))


def _tag(i: int, tag: Tag) -> Detection:
    """Return a tag as a detection, its number as the rank."""
    return Detection(i, tag.center_xy, tag.side_px, None, 1.0, 0.0, tag.id)


def strongest_first(features: Keypoints) -> Keypoints:
    """Return key points by falling response, as scoring expects them."""
    order = np.argsort(-features.response, kind="stable")
    return features if np.array_equal(order, np.arange(len(features))) else features[order]
