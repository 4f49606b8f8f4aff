"""Evidence against what can be computed by hand: variances of boxes, the marker's own quotient, a failed alignment."""

import numpy as np
import pytest

from peakmark.identification.evidence import aligned_evidence, box_variance, response_quotients
from peakmark.identification.model import BOTH, JOINT
from peakmark.keypoints.keypoints import Keypoints
from peakmark.refine.api import refine
from tests.helpers import marker_view
from tests.peakmark.identification.walls import sheet, wall


def test_the_marker_itself_has_nearly_the_largest_quotient() -> None:
    image = marker_view(45)
    at_center = Keypoints([[128, 128]], [45], [0], [90_200], [0], [1], [45])  # type: ignore[arg-type]
    assert response_quotients(image, at_center, 1.0)[0] == pytest.approx(1, abs=0.02)


def test_variances_are_those_of_the_pixels_in_the_boxes() -> None:
    gray = np.random.default_rng(0).integers(0, 256, (60, 80), dtype=np.uint8)
    centers, sizes = np.array([[30, 20], [5, 5], [70, 50]], np.float32), np.array([[9, 5], [3, 7], [1, 1.0]])
    expected = [gray[18:23, 26:35].var(), gray[2:9, 4:7].var(), 0.0]
    assert np.allclose(box_variance(gray, centers, sizes), expected)


def test_alignment_that_did_not_converge_explains_nothing() -> None:
    image = wall([(sheet(5), 240, 180, 40, 10)])
    refined = refine(image, [[20.0, 20.0]], [30.0], "surf-dark")
    assert not refined.converged.any()
    evidence = aligned_evidence(np.array([0.7]), np.array([0.1]), refined, BOTH.least_unexplained)
    np.testing.assert_array_equal(evidence, [[0.7, 0.1, 0.0, 1.0]])
    for decision in (BOTH, JOINT):
        assert not decision.are_markers(np.array([0.7]), np.array([0.1]), refined).any()
