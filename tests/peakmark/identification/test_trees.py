"""Boosted trees as arrays give what scikit-learn's own give, and survive JSON."""

import json

import numpy as np
import pytest

from peakmark.identification.trees import Trees, from_boosting, from_plain

ensemble = pytest.importorskip("sklearn.ensemble")


def test_sums_are_those_of_scikit_learn() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=(800, 5))
    is_one = values[:, 0] * values[:, 1] + values[:, 2] > 0
    learner = ensemble.HistGradientBoostingClassifier(max_iter=20, max_leaf_nodes=6).fit(values, is_one)
    trees = from_boosting(learner)
    unseen = rng.normal(size=(500, 5))
    assert np.allclose(trees.sums(unseen), learner.decision_function(unseen), atol=1e-12)
    kept = from_plain(json.loads(json.dumps(trees.to_plain())))
    assert np.allclose(kept.sums(unseen), trees.sums(unseen), atol=1e-6)
    assert trees.sums(unseen[:0]).shape == (0,)


def test_a_stump_goes_left_up_to_its_threshold() -> None:
    stump = Trees(np.array([1, -1, -1]), np.array([2.0, -5.0, 7.0]), np.array([1, 0, 0]), np.array([0]), baseline=0.5)
    assert stump.sums(np.array([[9.0, 2.0], [9.0, 2.1], [9.0, np.nan]])).tolist() == [-4.5, 7.5, 7.5]
