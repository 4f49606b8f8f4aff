"""Samples and training: labels by hand-made truth, classifiers on samples whose best line is known, files."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peaksim.camera.frame import MarkerTruth

from peakmark.errors import InputError
from peakmark.experiments.cave.samples import (
    Samples,
    collect_samples,
    join_samples,
    label_features,
    load_samples,
    save_samples,
)
from peakmark.experiments.cave.training import (
    CLUTTER,
    SHIPPED,
    TrainingConfig,
    evaluate_classifier,
    must_be_found,
    train,
)
from peakmark.identification.classifier import COLUMNS, shipped_classifier
from peakmark.identification.classifier import SHIPPED as SHIPPED_FILE
from peakmark.identification.search import detect_features
from peakmark.plain import to_plain
from tests.helpers import marker_view


def cloud(seed: int, markers: int = 300, clutter: int = 3000, views: int = 10) -> Samples:
    """Return samples that an oblique line in (log response, VIS distance) parts, and neither column alone."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-1, 1, markers + clutter)
    is_marker = np.arange(markers + clutter) < markers
    across = np.where(is_marker, 0.5, -0.5) + 0.12 * rng.standard_normal(len(along))
    columns = np.column_stack([3.5 + along + across, 0.4 + 0.2 * (along - across), rng.normal(size=(len(along), 2))])
    side = np.where(is_marker, rng.uniform(16, 80, len(along)), np.nan)
    tilt = np.where(is_marker, rng.uniform(0, 50, len(along)), np.nan)
    return Samples(columns, is_marker, np.zeros(len(along), np.int64), side, tilt, 0, views)


def test_the_oblique_line_beats_both_thresholds_where_it_should() -> None:
    classifiers = train(cloud(0))
    scores = {name: evaluate_classifier(c, cloud(1)) for name, c in classifiers.items()}
    assert scores["oblique line"].average_precision > 0.999
    assert scores["linear"].average_precision > 0.999
    assert scores["nonlinear"].average_precision > 0.99
    assert scores["response threshold"].average_precision < 0.8
    assert scores["VIS threshold"].average_precision < 0.8
    weights = classifiers["oblique line"].layers[0].weights.ravel() / classifiers["oblique line"].scale
    assert weights[0] > 0 > weights[1]
    assert -weights[1] / weights[0] == pytest.approx(5.0, rel=0.1)


def test_the_operating_point_lets_the_budget_through() -> None:
    own = cloud(0, views=20)
    for classifier in train(own).values():
        quality = evaluate_classifier(classifier, own)
        assert quality.clutter_per_view == pytest.approx(CLUTTER, abs=0.051)
        assert set(classifier.columns) <= set(COLUMNS)


def test_training_is_deterministic() -> None:
    first, second = train(cloud(3)), train(cloud(3))
    assert to_plain(first) == to_plain(second)


@pytest.mark.slow
def test_the_command_of_its_origin_yields_the_shipped_classifier() -> None:
    """Weights within 1 %: the renderer's rounding has changed since then, and the samples in the third digit."""
    origin = json.loads(SHIPPED_FILE.read_text())["origin"]
    pattern = r"scripts/train_classifier.py --training-rooms (\d+) --views (\d+) --layers (\d+) --seed (\d+): "
    words = re.match(pattern, origin)
    assert words is not None
    rooms, views, layers, seed = map(int, words.groups())
    samples = join_samples([collect_samples("training", room, views, seed, layers) for room in range(rooms)])
    assert f"{must_be_found(samples).sum()} markers, {samples.views} views" in origin
    again, shipped = train(samples)[SHIPPED], shipped_classifier()
    assert again.columns == shipped.columns
    for name in ("mean", "scale", "threshold"):
        np.testing.assert_allclose(getattr(again, name), getattr(shipped, name), rtol=0.01)
    for own, other in zip(vars(again.layers[0]).values(), vars(shipped.layers[0]).values(), strict=True):
        np.testing.assert_allclose(own, other, rtol=0.01)
    is_above = [classifier.scores(samples.evidence) > classifier.threshold for classifier in (again, shipped)]
    assert np.mean(is_above[0] != is_above[1]) < 1e-4


def test_evaluated_are_markers_from_20_px_and_to_45_degrees() -> None:
    samples = cloud(0)
    wanted = must_be_found(samples)
    assert (wanted == (samples.is_marker & (samples.side_px >= 20) & (samples.tilt_deg <= 45))).all()
    assert 0 < wanted.sum() < samples.is_marker.sum()


def marker_at(x: float, y: float, side: float, visible: float = 1.0) -> MarkerTruth:
    center = np.array([x, y])
    corners = center + side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return MarkerTruth("m", "surf-dark", center, corners, side, 1.0, 0.0, visible)


def test_labels_ghosts_are_left_out_and_hidden_markers_too() -> None:
    gray = marker_view(60)
    features = detect_features(gray)
    samples = label_features(gray, features, [marker_at(128, 128, 60)], 7)
    assert samples.is_marker.sum() == 1
    assert samples.side_px[samples.is_marker] == 60
    assert set(samples.room) == {7}
    assert len(samples.evidence) < len(features)
    assert (samples.unseen, samples.views) == (0, 1)
    hidden = label_features(gray, features, [marker_at(128, 128, 60, 0.5)], 7)
    assert not hidden.is_marker.any()
    assert len(hidden.evidence) == len(samples.evidence) - 1
    assert label_features(gray, features, [marker_at(40, 40, 30)], 7).unseen == 1
    assert label_features(gray, features, [marker_at(40, 40, 18)], 7).unseen == 0


def test_samples_survive_a_round_trip_and_faulty_files_are_one_line(tmp_path: Path) -> None:
    samples = join_samples([cloud(0), replace(cloud(1), unseen=3)])
    assert (samples.views, samples.unseen, len(samples.room)) == (20, 3, 6600)
    save_samples(tmp_path / "s.npz", samples)
    again = load_samples(tmp_path / "s.npz")
    for name, value in vars(samples).items():
        np.testing.assert_array_equal(getattr(again, name), value)
    (tmp_path / "text.npz").write_text("none")
    for name in ("text.npz", "missing.npz"):
        with pytest.raises(InputError, match=f"{name}: expected samples"):
            load_samples(tmp_path / name)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"views": 0}, "--views: expected 1…10000, got 0"),
        ({"seed": -1}, "--seed: expected 0 or more"),
        ({"layers": 0}, "--layers: expected 1…20, got 0"),
    ],
)
def test_faulty_configurations(change: dict[str, int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        TrainingConfig(**change)
