"""Dark and light markers in one picture: found where they are drawn, told apart, nothing where there is nothing."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakmark import decode_arrays, identify
from peakmark.errors import InputError
from peakmark.experiments.cave.rooms import photographs
from peakmark.identification.both import LEAST_UNEXPLAINED, WEIGHTS, features_of, identify_both
from peakmark.identification.evidence import aligned_evidence
from peakmark.identification.signature import polarity_by_signature
from peakmark.refine.api import refine
from tests.peakmark.identification.walls import centers, sheet, wall
from tests.samples import speckled


@settings(max_examples=12)
@given(st.integers(0, 7), st.floats(22, 60), st.floats(0, 360), st.integers(0, 99))
def test_every_array_is_found_marker_by_marker(code: int, side: float, turn: float, seed: int) -> None:
    gray = wall([(sheet(code), 240.3, 180.6, side, turn)], seed=seed)
    found = identify_both(gray)
    assert len(found.detections) == 3
    angle = np.radians(turn)
    right, down = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    for (column, row), polarity in centers(code).items():
        place = np.array([240.3, 180.6]) + 0.75 * side * ((2 * column - 1) * right + (2 * row - 1) * down)
        (nearest,) = [d for d in found.detections if np.linalg.norm(d.xy - place) < 0.5]
        assert nearest.polarity == polarity
        assert nearest.size == pytest.approx(side, rel=0.03)
    assert found.features.descriptors is not None
    by_signature = polarity_by_signature(found.features.descriptors[[d.rank - 1 for d in found.detections]])
    assert by_signature == [d.polarity for d in found.detections]
    assert [a.code for a in decode_arrays(found.detections, image=gray)] == [code]


def test_two_calls_lead_from_a_picture_to_the_codes() -> None:
    picture = wall([(sheet(3), 130, 130, 40, 170), (sheet(4), 350, 200, 30, 40)])
    arrays = decode_arrays(identify(picture, polarity="both"), image=picture)
    assert [array.code for array in arrays] == [3, 4]
    assert np.linalg.norm(arrays[1].xy - [350, 200]) < 15


def test_detections_are_what_the_features_say() -> None:
    found = identify_both(wall([(sheet(5), 240, 180, 40, 10)]))
    assert [d.rank for d in found.detections] == sorted(d.rank for d in found.detections)
    for d in found.detections:
        assert d.response == found.features.response[d.rank - 1]
        assert d.signature_distance == found.evidence[d.rank - 1, 1]
        assert (d.polarity == "dark") == (found.features.laplacian[d.rank - 1] == 1)


@pytest.mark.parametrize("seed", range(3))
def test_discs_squares_and_noise_are_no_markers(seed: int) -> None:
    picture = speckled(360, 480, seed)
    cv2.circle(picture, (120, 120), 25, 255, -1)
    cv2.circle(picture, (300, 120), 25, 0, -1)
    cv2.rectangle(picture, (200, 220), (240, 260), 0, -1)
    assert identify_both(picture).detections == ()


@pytest.mark.parametrize("name", ["coins", "astronaut", "moon", "gravel"])
@pytest.mark.parametrize("share", [1.0, 0.6])
def test_blobs_in_photographs_are_no_markers(name: str, share: float) -> None:
    photograph = cv2.resize(photographs("training")[name], None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    assert identify_both(cv2.GaussianBlur(photograph, (0, 0), 0.7)).detections == ()


def test_alignment_that_did_not_converge_explains_nothing() -> None:
    picture = wall([(sheet(5), 240, 180, 40, 10)])
    refined = refine(picture, [[20.0, 20.0]], [30.0], "surf-dark")
    assert not refined.converged.any()
    evidence = aligned_evidence(np.array([0.7]), np.array([0.1]), refined, LEAST_UNEXPLAINED)
    np.testing.assert_array_equal(evidence, [[0.7, 0.1, 0.0, 1.0]])
    assert evidence @ WEIGHTS[:-1] + WEIGHTS[-1] < 0


def test_a_blank_picture_and_a_blank_poster_hold_nothing() -> None:
    assert identify_both(np.full((100, 100), 128, np.uint8)).detections == ()
    assert identify_both(wall([(np.full((288, 288), 255, np.uint8), 240, 180, 40, 5)])).detections == ()


def test_features_at_the_border_are_kept_inside_the_picture() -> None:
    features = features_of(wall([(sheet(1), 30, 30, 40, 0)]))
    assert (features.xy > -0.5).all()
    assert (features.xy < [479.5, 359.5]).all()


def test_no_picture_is_one_line() -> None:
    with pytest.raises(InputError):
        identify(np.zeros((4, 4, 7), np.uint8), polarity="both")
    with pytest.raises(InputError, match="polarity: expected dark, light or both, got 'grey'"):
        identify(np.zeros((40, 40), np.uint8), polarity="grey")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rule"):
        identify(np.zeros((40, 40), np.uint8), polarity="both", rule="paper")
