"""The decision of the general search: how likely an alignment is one of a marker."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.marker_evidence import COLUMNS
from peakmark.identification.trees import Trees, from_plain

MODEL = Path(__file__).with_name("general.json")
"""Written by `scripts/train_search.py`."""


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
def shipped_model() -> tuple[MarkerModel, float]:
    """Return the model that comes with the package, and the probability from which an alignment is a marker."""
    plain = json.loads(MODEL.read_text(encoding="utf-8"))
    assert plain["columns"] == list(COLUMNS), "general.json is of other columns: scripts/train_search.py makes it anew"
    return MarkerModel(from_plain(plain["trees"]), plain["slope"], plain["offset"]), float(plain["threshold"])
