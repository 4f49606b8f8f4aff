"""Markers of both polarities against truth, on key points made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from samples import some_keypoints
from test_score import detection, truth

from peakmark.identification_both import Both
from peakmark.score_both import is_wanted, score_both
from peakmark.signature import reference_descriptor


def both(*places: tuple[float, float], polarity: str = "dark", signature: str = "dark") -> Both:
    features = some_keypoints(max(len(places), 1), 64)
    descriptors = np.tile(reference_descriptor(signature, is_on_paper=True), (len(features), 1))  # type: ignore[arg-type]
    found = tuple(replace(detection(k, x, y, k + 1), polarity=polarity) for k, (x, y) in enumerate(places))  # type: ignore[arg-type]
    empty = np.zeros((len(features), 4))
    return Both(replace(features, descriptors=descriptors), empty, empty[:, 0], np.arange(len(features)), found)


def test_found_missed_and_false() -> None:
    markers = [truth("a", 100, 100), truth("b", 200, 100), truth("cut", 300, 100, 0.5)]
    score = score_both(markers, both((101, 100), (9, 9)))
    assert (score.wanted, score.found, score.missed, score.false_detections) == (2, 1, ("b",), 1)
    assert [m.is_in_view for m in score.markers] == [True, True, False]
    assert score.markers[0].error_px == pytest.approx(1.0)
    assert score.markers[1].error_px is None
    assert (score.polarity_errors, score.signature_errors) == (0, 0)


def test_polarity_by_laplacian_and_by_signature_are_judged_apart() -> None:
    wrong_sign = score_both([truth("a", 100, 100)], both((100, 100), polarity="light"))
    assert (wrong_sign.polarity_errors, wrong_sign.signature_errors) == (1, 0)
    wrong_signature = score_both([truth("a", 100, 100)], both((100, 100), signature="light"))
    assert (wrong_signature.polarity_errors, wrong_signature.signature_errors) == (0, 1)
    light = replace(truth("a", 100, 100), kind="surf-light")
    right = score_both([light], both((100, 100), polarity="light", signature="light"))
    assert (right.polarity_errors, right.signature_errors) == (0, 0)


@pytest.mark.parametrize(
    ("change", "wanted"),
    [({}, True), ({"side_px": 19.9}, False), ({"tilt_deg": 45.1}, False), ({"visible_fraction": 0.94}, False)],
)
def test_what_must_be_found(change: dict[str, float], wanted: bool) -> None:
    marker = replace(truth("a", 100, 100), **change)  # type: ignore[arg-type]
    assert is_wanted(marker) == wanted
    score = score_both([marker], both((100, 100), polarity="light"))
    assert score.polarity_errors == wanted
    assert score.false_detections == 0
