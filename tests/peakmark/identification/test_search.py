"""Dark and light markers in one image: found where they are drawn, told apart, nothing where there is nothing."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import decode_arrays, identify
from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.identification.search import detect_features, find_markers, search_image
from peakmark.identification.signature import polarity_by_signature, signature_distances
from tests.peakmark.identification.walls import centers, sheet, wall
from tests.samples import speckled


@settings(max_examples=12)
@given(st.integers(0, 7), st.floats(22, 60), st.floats(0, 360), st.integers(0, 99))
def test_every_array_is_found_marker_by_marker(code: int, side: float, rotation_deg: float, seed: int) -> None:
    gray = wall([(sheet(code), 240.3, 180.6, side, rotation_deg)], seed=seed)
    found = search_image(gray)
    assert len(found.detections) == 3
    angle = np.radians(rotation_deg)
    right, down = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    for (column, row), polarity in centers(code).items():
        center = np.array([240.3, 180.6]) + 0.75 * side * ((2 * column - 1) * right + (2 * row - 1) * down)
        (nearest,) = [d for d in found.detections if np.linalg.norm(d.xy - center) < 0.5]
        assert nearest.polarity == polarity
        assert nearest.size == pytest.approx(side, rel=0.03)
    assert found.features.descriptors is not None
    by_signature = polarity_by_signature(found.features.descriptors[[d.rank - 1 for d in found.detections]])
    assert by_signature == [d.polarity for d in found.detections]
    assert [a.code for a in decode_arrays(found.detections, image=gray)] == [code]


def test_every_marker_of_one_polarity_is_found_once() -> None:
    gray = np.rint(wall([(sheet(5), 160, 180, 40, 10), (sheet(2), 330, 180, 30, 250)])).astype(np.uint8)
    features = detect_features(gray)
    assert features.descriptors is not None
    for polarity, count in (("dark", 3), ("light", 3)):
        distances = signature_distances(features.descriptors, polarity)
        found = find_markers(gray, features, distances, 1.0, polarity)
        assert len(found) == count
        assert [d.id for d in found] == list(range(count))
        assert all(d.polarity == polarity and d.affinity is not None for d in found)


def test_two_calls_lead_from_a_image_to_the_codes() -> None:
    image = wall([(sheet(3), 130, 130, 40, 170), (sheet(4), 350, 200, 30, 40)])
    arrays = decode_arrays(identify(image, polarity="both"), image=image)
    assert [array.code for array in arrays] == [3, 4]
    assert np.linalg.norm(arrays[1].xy - [350, 200]) < 15


def test_detections_are_what_the_features_say() -> None:
    found = search_image(wall([(sheet(5), 240, 180, 40, 10)]))
    assert [d.rank for d in found.detections] == sorted(d.rank for d in found.detections)
    for d in found.detections:
        assert d.response == found.features.response[d.rank - 1]
        assert d.signature_distance == found.evidence[d.rank - 1, 1]
        assert (d.polarity == "dark") == (found.features.laplacian[d.rank - 1] == 1)


@pytest.mark.parametrize("seed", range(3))
def test_discs_squares_and_noise_are_no_markers(seed: int) -> None:
    image = speckled(360, 480, seed)
    cv2.circle(image, (120, 120), 25, 255, -1)
    cv2.circle(image, (300, 120), 25, 0, -1)
    cv2.rectangle(image, (200, 220), (240, 260), 0, -1)
    assert search_image(image).detections == ()


@pytest.mark.parametrize("name", ["coins", "astronaut", "moon", "gravel"])
@pytest.mark.parametrize("share", [1.0, 0.6])
def test_blobs_in_photographs_are_no_markers(name: str, share: float) -> None:
    photograph = cv2.resize(photographs("training")[name], None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    assert search_image(cv2.GaussianBlur(photograph, (0, 0), 0.7)).detections == ()


def test_a_blank_image_and_a_blank_poster_hold_nothing() -> None:
    assert search_image(np.full((100, 100), 128, np.uint8)).detections == ()
    assert search_image(wall([(np.full((288, 288), 255, np.uint8), 240, 180, 40, 5)])).detections == ()


def test_features_at_the_border_are_kept_inside_the_image() -> None:
    features = detect_features(wall([(sheet(1), 30, 30, 40, 0)]))
    assert (features.xy > -0.5).all()
    assert (features.xy < [479.5, 359.5]).all()


def test_what_is_no_image_is_refused_in_one_line() -> None:
    with pytest.raises(InputError):
        identify(np.zeros((4, 4, 7), np.uint8), polarity="both")
    with pytest.raises(InputError, match="polarity: expected one of dark, light, both, got 'grey'"):
        identify(np.zeros((40, 40), np.uint8), polarity="grey")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rule"):
        identify(np.zeros((40, 40), np.uint8), polarity="both", rule="joint")
