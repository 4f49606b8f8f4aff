"""Labels, calibration and threshold of the search's training, and the images that it learns from."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth

from peakmark.errors import InputError
from peakmark.experiments.journal import Journal
from peakmark.experiments.search import training
from peakmark.experiments.search.exposure import moved
from peakmark.experiments.search.grounds import DRAWN, draw_ground
from peakmark.experiments.search.training import CLUTTER, MARKER, UNDECIDED, SearchTrainingConfig, label_of
from peakmark.markers.patterns import Polarity, Variant

SHAPE = (480, 640)
SQUARE = np.array([[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]])


def marker_at(x: float, visible: float = 1.0) -> MarkerTruth:
    center = np.array([x, 200.0])
    return MarkerTruth("m", "surf-dark", center, center + SQUARE, 40.0, 1.0, 0.0, visible)


@pytest.mark.parametrize(
    ("xy", "side_px", "polarity", "truth", "label"),
    [
        ((300.0, 203.0), 42.0, "dark", marker_at(300), MARKER),
        ((300.0, 203.0), 42.0, "light", marker_at(300), UNDECIDED),
        ((300.0, 203.0), 62.0, "dark", marker_at(300), UNDECIDED),
        ((320.0, 203.0), 42.0, "dark", marker_at(300), UNDECIDED),
        ((340.0, 203.0), 42.0, "dark", marker_at(300), CLUTTER),
        ((300.0, 203.0), 42.0, "dark", marker_at(300, 0.6), MARKER),
        ((300.0, 203.0), 42.0, "dark", marker_at(300, 0.4), UNDECIDED),
        ((10.0, 203.0), 42.0, "dark", marker_at(10), UNDECIDED),
    ],
)
def test_labels(xy: tuple[float, float], side_px: float, polarity: Polarity, truth: MarkerTruth, label: int) -> None:
    assert label_of(np.array(xy), side_px, Variant(polarity), [truth], SHAPE) == label


def test_calibration_finds_the_odds_that_made_the_labels() -> None:
    rng = np.random.default_rng(1)
    sums = rng.normal(0, 3, 20_000)
    is_marker = rng.random(20_000) < 1 / (1 + np.exp(-(0.7 * sums - 1.2)))
    slope, offset = training.calibrate(sums, is_marker)
    assert (slope, offset) == (pytest.approx(0.7, abs=0.03), pytest.approx(-1.2, abs=0.06))


def test_the_threshold_counts_images_without_markers_not_alignments() -> None:
    config = SearchTrainingConfig(images=1, empty=25)
    images = np.array([0, 0, *range(1, 26), 5, 5])
    likely = np.array([0.99, 0.98, *np.linspace(0.01, 0.25, 25), 0.9, 0.8])
    threshold = training.choose_threshold(likely, np.array([True, *[False] * 28]), images, config)
    assert threshold == pytest.approx(0.25)  # of twenty-five images one, the fifth, may hold more


def test_reliability_counts_each_alignment_once() -> None:
    likely = np.array([0.005, 0.05, 0.05, 0.55, 0.999, 1.0])
    rows = training.reliability_of(likely, np.array([False, False, True, True, True, True]))
    assert [row["of"] for row in rows] == [1, 2, 1, 2]
    assert [row["markers"] for row in rows] == [0, 1, 1, 2]
    assert rows[1]["mean"] == pytest.approx(0.05)


@pytest.mark.parametrize("kind", DRAWN)
def test_drawn_grounds_depend_on_the_generator_alone(kind: str) -> None:
    one, same, other = (draw_ground(kind, np.random.default_rng(seed), 96) for seed in (1, 1, 2))
    assert one.shape == (96, 96)
    assert (one == same).all()
    assert (one != other).any()
    assert one.std() > 3


def test_motion_spreads_a_point_along_its_path() -> None:
    image: NDArray[np.float64] = np.zeros((41, 41))
    image[20, 20] = 1
    y, x = np.mgrid[:41, :41] - 20
    for angle_deg in (0.0, 30.0, 90.0):
        blurred = moved(image, 6.0, angle_deg)
        along = x * np.cos(np.radians(angle_deg)) + y * np.sin(np.radians(angle_deg))
        across = y * np.cos(np.radians(angle_deg)) - x * np.sin(np.radians(angle_deg))
        assert blurred.sum() == pytest.approx(1)
        assert (blurred * along**2).sum() == pytest.approx(6**2 / 12, abs=0.25)
        assert (blurred * across**2).sum() < 0.3


def test_a_small_training_gives_a_model_that_the_search_reads(tmp_path: Path) -> None:
    """Two images of either kind: rendered, searched, labelled, learned."""
    config = SearchTrainingConfig(images=2, empty=2)
    evidence = training.collect_evidence(config, Journal.open(tmp_path, {}))
    model = training.train(evidence, config)
    assert model["markers"] == (evidence.labels == MARKER).sum() > 3
    assert model["columns"] == list(config.columns)
    assert 0 <= model["threshold"] <= 1
    training.write_model(tmp_path / "model", model)
    written = {path.name for path in (tmp_path / "model").iterdir()}
    assert written == {"general.json", "result.json", "reliability.png"}
    again = training.collect_evidence(config, Journal.open(tmp_path / "again", {}))
    assert np.array_equal(again.columns, evidence.columns)


@pytest.mark.parametrize("field", ["images", "empty", "seed"])
def test_numbers_out_of_range_are_named(field: str) -> None:
    with pytest.raises(InputError, match=f"--{field}"):
        SearchTrainingConfig(**{field: -1})
