"""Metrics: each figure by hand, intervals that hold what they should, and always the same list."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peakmark.regress.frame import ScoredFrame
from peakmark.regress.metrics import Metric, metrics_of
from peakmark.score.statistics import resample_counts
from tests.peakmark.regress.helpers import frame, marker, missed, record, sound

FRAMES = (
    frame(0, marker(error=0.3), missed(60.0), false_xy=((1.0, 2.0), (3.0, 4.0)), drop=4.0, features=100),
    frame(1, marker(error=-0.1, polarity_is_right=False, response=250.0), false_xy=(), drop=1.0, features=300),
    ScoredFrame(2, "2", failure="crash: it ended", markers={"a": missed(300.0)}),
)


def values(*frames: ScoredFrame) -> dict[str, float | None]:
    return {metric.key: metric.value() for metric in metrics_of(frames, {})}


def test_every_figure_is_what_it_is_by_hand() -> None:
    assert values(*FRAMES) == pytest.approx(
        {
            "recall": 2 / 4,
            "recall, side 0…24 px": None,
            "recall, side 24…48 px": 1.0,
            "recall, side 48…96 px": 0.0,
            "recall, side 96…192 px": None,
            "recall, side from 192 px": 0.0,
            "frames without an answer": 1 / 3,
            "false detections": 1.0,
            "wrong polarity": 0.5,
            "error, rms": np.sqrt((0.09 + 0.01) / 2),
            "bias in x": 0.1,
            "bias in y": 0.0,
            "features": 200.0,
            "response of markers": 500.0,
            "drop to clutter": 2.0,
        }
    )


def test_the_list_is_the_same_whatever_was_found() -> None:
    nothing = [ScoredFrame(0, "0")]
    assert list(values(*nothing)) == list(values(*FRAMES))
    assert values(*nothing)["recall"] is None


def test_a_suite_sets_tolerances_by_key() -> None:
    (recall,) = (m for m in metrics_of(FRAMES, {"recall": 0.2}) if m.key == "recall")
    assert recall.tolerance == 0.2


@given(st.lists(st.tuples(st.floats(0, 9), st.floats(0.5, 9)), min_size=1, max_size=9), st.integers(0, 99))
def test_resampling_by_counts_is_resampling_by_hand(pairs: list[tuple[float, float]], seed: int) -> None:
    a, b = np.array(pairs).T
    metric = Metric("m", "", "higher", 0.0, False, "mean", a, b)
    taken = np.random.default_rng(seed).integers(0, len(pairs), len(pairs))
    counts = np.bincount(taken, minlength=len(pairs)).astype(float)
    assert metric.resampled(counts[None])[0] == pytest.approx(a[taken].sum() / b[taken].sum())


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng, counts = np.random.default_rng(1), resample_counts(60)[:1000]
    held = 0
    for _ in range(200):
        errors = rng.normal(0.2, 1.0, 60)
        low, high = Metric("m", "", "same", 0, False, "mean", errors, np.ones(60)).interval(counts) or (9, 9)
        held += low <= 0.2 <= high
    assert 0.88 <= held / 200 <= 0.99


def test_metrics_have_different_keys_and_known_directions() -> None:
    listed = metrics_of(record(*FRAMES).results, {})
    assert len({m.key for m in listed}) == len(listed)
    assert all(m.tolerance >= 0 for m in metrics_of(sound().results, {}))
