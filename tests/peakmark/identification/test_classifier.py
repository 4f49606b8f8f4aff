"""Classifiers: the chain of layers is what it says, files survive a round trip, faulty ones are one line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.errors import InputError
from peakmark.identification.classifier import COLUMNS, Classifier, Layer, load_classifier, shipped_classifier
from peakmark.identification.evidence import feature_evidence
from peakmark.identification.search import detect_features
from peakmark.plain import to_plain
from tests.helpers import marker_view

LINE: dict[str, Any] = {
    "columns": ["vis_distance", "log_response"],
    "mean": [0.5, 3.0],
    "scale": [0.1, 2.0],
    "layers": [{"weights": [[-2.0], [4.0]], "offsets": [1.0]}],
    "threshold": 0.5,
}


def test_one_layer_is_a_line_in_the_standardised_columns() -> None:
    rows = np.array([[3.0, 0.5, 9.0, 9.0], [5.0, 0.3, 0.0, 0.0]])
    assert np.allclose(Classifier.from_plain(LINE).scores(rows), [1.0, 1 + 4 * 1.0 - 2 * -2.0])


@given(st.integers(0, 2**32))
def test_more_layers_have_tanh_between_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second, b1, b2 = rng.normal(size=(4, 3)), rng.normal(size=(3, 1)), rng.normal(size=3), rng.normal(size=1)
    classifier = Classifier(COLUMNS, np.zeros(4), np.ones(4), (Layer(first, b1), Layer(second, b2)), 0.0)
    rows = rng.normal(size=(5, 4))
    expected = [sum(np.tanh(row @ first[:, k] + b1[k]) * second[k, 0] for k in range(3)) + b2[0] for row in rows]
    assert np.allclose(classifier.scores(rows), expected)


def test_files_keep_every_digit(tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    path.write_text(json.dumps(to_plain(shipped_classifier())))
    assert to_plain(load_classifier(path)) == to_plain(shipped_classifier())


@pytest.mark.parametrize(
    "change",
    [
        {"columns": ["colour", "vis_distance"]},
        {"columns": []},
        {"mean": [0.0]},
        {"scale": [0.1, 0.0]},
        {"scale": [0.1, float("nan")]},
        {"layers": []},
        {"layers": [{"weights": [[1.0, 2.0]], "offsets": [0.0]}]},
        {"layers": [{"weights": [[1.0], [2.0]], "offsets": [0.0, 1.0]}]},
        {"threshold": "much"},
        {"mean": None},
        {"layers": [{"weights": [[float("inf")], [2.0]], "offsets": [0.0]}]},
    ],
)
def test_faulty_classifiers_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="classifier: expected"):
        Classifier.from_plain({**LINE, **change})


@pytest.mark.parametrize(
    ("content", "message"),
    [("{", "is not JSON"), ("[" * 100_000, "is not JSON"), ("[]", "expected columns"), ("x" * 1_000_001, "at most")],
)
def test_faulty_files_are_one_line(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "c.json"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        load_classifier(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_classifier(tmp_path / "none.json")


@pytest.mark.parametrize("polarity", ["dark", "light"])
def test_the_shipped_classifier_knows_a_marker_from_its_ghosts(polarity: Any) -> None:
    gray = marker_view(60, 20.0, polarity)
    features = detect_features(gray)
    columns = feature_evidence(gray, features)
    assert columns.shape == (len(features), len(COLUMNS))
    assert columns[0, 0] == pytest.approx(np.log10(features.response[0]))
    classifier = shipped_classifier()
    assert classifier.scores(columns)[0] > classifier.threshold
    away = np.linalg.norm(features.xy - 128, axis=1) > 10
    assert (classifier.scores(columns)[away] < classifier.scores(columns)[0]).all()
