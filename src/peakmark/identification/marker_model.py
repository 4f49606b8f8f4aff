"""The decision of the general search: how likely an alignment is one of a marker."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.families import FAMILIES
from peakmark.identification.trees import Trees, from_plain
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Made


@dataclass(frozen=True)
class MarkerModel:
    """Boosted trees over `marker_evidence`, calibrated on images that they did not learn from."""

    trees: Trees
    """Their sum is an uncalibrated log odds."""
    slope: float
    """By which the sum is multiplied, then."""
    offset: float
    """Added: log odds."""

    def probabilities(self, evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) probabilities that alignments are markers."""
        log_odds = self.slope * self.trees.sums(evidence) + self.offset
        return np.asarray(1 / (1 + np.exp(-np.clip(log_odds, -50, 50))))


@cache
def shipped_model(made_for: Made = "surf", limit: Limit = "energy") -> tuple[MarkerModel, float]:
    """Return the model that comes with the package, and the probability from which an alignment is a marker.

    `scripts/train_search.py` makes it.
    """
    family = FAMILIES[made_for]
    plain = json.loads(Path(__file__).with_name(family.model).read_text(encoding="utf-8"))
    assert plain["columns"] == list(family.columns), f"{family.model} is of other columns: make it anew"
    threshold = plain.get(f"{limit}_threshold", plain["threshold"])
    return MarkerModel(from_plain(plain["trees"]), plain["slope"], plain["offset"]), float(threshold)
