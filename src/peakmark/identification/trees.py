"""Boosted decision trees as plain arrays: what scikit-learn learns, without scikit-learn.

A tree asks one column a node, and goes left where it is at most the node's threshold; the leaves' values of all trees
are summed (Friedman 2001, doi:10.1214/aos/1013203451).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.native import function

_LEAF = -1

_tree_sums = function(
    "void tree_sums(const i8[n] columns, const f8[n] thresholds, const i8[n] left, const i8[trees] roots, f8 baseline, "
    "const f8[rows,fields] evidence, f8[rows] sums)"
)


@dataclass(frozen=True)
class Trees:
    """All nodes of all trees, one after another."""

    columns: NDArray[np.int64]
    """(n,) which column a node asks; −1 of leaves."""
    thresholds: NDArray[np.float64]
    """(n,) up to which it goes left; of leaves, their value."""
    left: NDArray[np.int64]
    """(n,) node on the left; the one on the right comes right behind it."""
    roots: NDArray[np.int64]
    """(t,) first nodes of the trees."""
    baseline: float
    """Sum before the first tree."""

    def sums(self, evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) sums over the trees, of evidence (n, c)."""
        sums = np.empty(len(evidence))
        nodes = (self.columns, self.thresholds, self.left, self.roots)
        _tree_sums(*nodes, self.baseline, np.ascontiguousarray(evidence, dtype=np.float64), sums)
        return sums

    def to_plain(self) -> dict[str, Any]:
        """Return lists for a JSON file; `from_plain` is its inverse."""
        return {
            "columns": self.columns.tolist(),
            "thresholds": [float(f"{value:.9g}") for value in self.thresholds],
            "left": self.left.tolist(),
            "roots": self.roots.tolist(),
            "baseline": self.baseline,
        }


def from_plain(plain: dict[str, Any]) -> Trees:
    """Return the trees of `Trees.to_plain`."""
    columns, left, roots = (np.array(plain[key], dtype=np.int64) for key in ("columns", "left", "roots"))
    return Trees(columns, np.array(plain["thresholds"], dtype=np.float64), left, roots, float(plain["baseline"]))


def from_boosting(fitted: Any) -> Trees:
    """Return the trees of scikit-learn's `HistGradientBoostingClassifier` for two classes, its nodes by breadth."""
    columns: list[int] = []
    thresholds: list[float] = []
    left: list[int] = []
    roots = []
    for (predictor,) in fitted._predictors:
        nodes = predictor.nodes
        roots.append(len(columns))
        order, offset = [0], len(columns)
        for k in order:  # grows while it is read
            is_leaf = bool(nodes[k]["is_leaf"])
            columns.append(_LEAF if is_leaf else int(nodes[k]["feature_idx"]))
            thresholds.append(float(nodes[k]["value"] if is_leaf else nodes[k]["num_threshold"]))
            left.append(0 if is_leaf else offset + len(order))
            order += [] if is_leaf else [int(nodes[k]["left"]), int(nodes[k]["right"])]
    baseline = float(np.ravel(fitted._baseline_prediction)[0])
    return Trees(np.array(columns), np.array(thresholds), np.array(left), np.array(roots), baseline)
