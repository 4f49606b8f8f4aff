"""Detectors by name: each finds what it is for, in one form; foolish names and settings are one line."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints
from peakmark.markers.patterns import surf_marker
from peakmark.regress.detector import DetectorSettings, built_in_detector, open_detector, strongest_first

SIZE = (240, 320)


def page(pattern: NDArray[np.uint8], x: int, y: int) -> NDArray[np.uint8]:
    """Return a white page with a pattern whose top-left pixel is at (x, y)."""
    image = np.full(SIZE, 255, np.uint8)
    image[y : y + pattern.shape[0], x : x + pattern.shape[1]] = pattern
    return image


@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_markers_of_both_polarities_are_told_apart(polarity: str) -> None:
    image = np.full(SIZE, 128, np.uint8)
    image[80:135, 130:185] = surf_marker(55, polarity)  # type: ignore[arg-type]
    found = built_in_detector(DetectorSettings(stretch=1.0))(image)
    (detection,) = found.detections or ()
    assert detection.polarity == polarity
    assert detection.id == 0
    assert detection.xy == pytest.approx([157, 107], abs=0.2)
    assert np.isclose(found.features.response, detection.response).any()


def test_parameters_reach_the_detector() -> None:
    noise = np.random.default_rng(0).integers(0, 255, SIZE).astype(np.uint8)
    low, high = (
        built_in_detector(DetectorSettings(parameters={"threshold": t}))(noise).features for t in (100.0, 4000.0)
    )
    assert len(low) > len(high)
    assert high.response.min() > 4000


@pytest.mark.parametrize(
    ("name", "dictionary"),
    [
        ("aruco", cv2.aruco.DICT_4X4_50),
        ("aruco:DICT_6X6_250", cv2.aruco.DICT_6X6_250),
        ("apriltag", cv2.aruco.DICT_APRILTAG_36h11),
    ],
)
def test_a_tag_is_found_with_its_number_at_its_centre(name: str, dictionary: int) -> None:
    tag = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(dictionary), 17, 80)
    (detection,) = built_in_detector(DetectorSettings(name))(page(tag, 100, 60)).detections or ()
    assert detection.rank == 17
    assert detection.xy == pytest.approx([139.5, 99.5], abs=0.5)
    assert detection.size == pytest.approx(80, abs=2)


def test_no_tag_is_no_detection() -> None:
    assert built_in_detector(DetectorSettings("aruco"))(np.full(SIZE, 255, np.uint8)).detections == ()


@pytest.mark.parametrize("name", ["surf", "surf-paper", "sift"])
def test_detectors_that_do_not_identify_say_so(name: str) -> None:
    found = built_in_detector(DetectorSettings(name))(page(surf_marker(55), 130, 80))
    assert found.detections is None
    assert len(found.features) > 0
    assert (np.diff(found.features.response) <= 0).all()


def test_opencvs_own_surf_works_or_says_what_is_missing() -> None:
    try:
        found = built_in_detector(DetectorSettings("surf-opencv"))(page(surf_marker(55), 130, 80))
    except InputError as error:
        assert str(error) == "detector surf-opencv: this OpenCV was built without SURF; surf gives the same key points"  # noqa: PT017
    else:
        assert len(found.features) > 0


def test_markers_by_the_classifier_of_the_cave() -> None:
    image = np.full(SIZE, 128, np.uint8)
    image[80:135, 70:125], image[80:135, 190:245] = surf_marker(55, "dark"), surf_marker(55, "light")
    found = built_in_detector(DetectorSettings("cave-markers"))(image)
    positions = {detection.polarity: tuple(np.round(detection.xy)) for detection in found.detections or ()}
    assert positions == {"dark": (97, 107), "light": (217, 107)}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"name": "yolo"}, "detector: expected one of identify, markers, .* got 'yolo'"),
        ({"name": "aruco:4X4"}, "expected a dictionary of cv2.aruco such as DICT_4X4_50, got '4X4'"),
        ({"name": "aruco:DICT_NONE"}, "expected a dictionary of cv2.aruco"),
        ({"name": "cave-markers", "parameters": {"octaves": 2}}, "cave-markers: expected no parameters, got octaves"),
        ({"name": "aruco", "parameters": {"threshold": 2}}, "aruco: expected no parameters, got threshold"),
        (
            {"name": "sift", "parameters": {"octaves": 2}},
            "detector sift: unknown parameter octaves, expected some of threshold",
        ),
        ({"start_limit_s": float("nan")}, "start limit: expected more than 0"),
        ({"stretch": 0.1}, "stretch: expected 0.25…8, got 0.1"),
        ({"stretch": float("nan")}, "stretch: expected 0.25…8, got nan"),
        ({"time_limit_s": 0}, "time limit: expected more than 0"),
    ],
)
def test_foolish_settings_are_one_line(settings: dict[str, object], words: str) -> None:
    def start() -> None:
        with open_detector(DetectorSettings(**settings)):  # type: ignore[arg-type]
            pass

    with pytest.raises(InputError, match=words) as caught:
        start()
    assert "\n" not in str(caught.value)


def test_key_points_are_ordered_by_response() -> None:
    points = [cv2.KeyPoint(float(i), 0.0, 1.0, -1.0, response) for i, response in enumerate((1.0, 3.0, 2.0))]
    assert strongest_first(Keypoints.from_opencv(points)).xy[:, 0].tolist() == [1, 2, 0]
