"""The search of `identify(image)` for somebody's image: any polarity, size, tilt and light.

::

    SURF on five copies ─▶ candidates by quotient ─▶ the best by coarse correlation ─▶ alignment in any light
        ─▶ logistic decision (`general.json`) ─▶ non-maximum suppression ─▶ detections
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import COLUMNS, Aligned, align_candidates, correlations, noise_sigma_of
from peakmark.identification.candidates import MarkerCandidates, find_candidates
from peakmark.identification.detection import Detection
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.markers.patterns import Polarity
from peakmark.refine.api import upright_rotation

LEAST_CORRELATION = 0.86
"""Coarse correlation from which a candidate is aligned."""

MOST_ALIGNED = 60
"""Candidates of an image that are aligned, by falling correlation."""

_PREFER_LARGE = 0.02
"""Added to a candidate's correlation for each doubling of its side, in the order of alignment."""

MODEL = Path(__file__).with_name("general.json")


@dataclass(frozen=True)
class MarkerModel:
    """A logistic regression over the columns of an alignment."""

    mean: NDArray[np.float64]
    """(c,) subtracted from the columns."""
    scale: NDArray[np.float64]
    """(c,) by which they are divided then."""
    weights: NDArray[np.float64]
    """(c,)."""
    offset: float
    """Added to the weighted sum: log odds."""

    def probabilities(self, evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) probabilities that alignments are markers."""
        log_odds = (evidence - self.mean) / self.scale @ self.weights + self.offset
        return np.asarray(1 / (1 + np.exp(-np.clip(log_odds, -50, 50))))


@cache
def shipped_model() -> tuple[MarkerModel, float]:
    """Return the model that comes with the package, and the probability from which an alignment is a marker."""
    plain = json.loads(MODEL.read_text(encoding="utf-8"))
    mean, scale, weights = (np.array([plain[key][name] for name in COLUMNS]) for key in ("mean", "scale", "weights"))
    return MarkerModel(mean, scale, weights, float(plain["offset"])), float(plain["threshold"])


@dataclass(frozen=True)
class Alignments:
    """All candidates of an image that could be aligned, with their evidence."""

    candidates: MarkerCandidates
    """(n,) of them."""
    polarities: tuple[Polarity, ...]
    """Of each."""
    aligned: Aligned
    """The alignments."""


def align_image(gray: NDArray[np.uint8], polarities: tuple[Polarity, ...] = ("dark", "light")) -> Alignments:
    """Return what could be aligned with a marker of one of the polarities in a (H, W) image."""
    candidates = find_candidates(gray)
    noise = noise_sigma_of(gray)
    parts: list[tuple[NDArray[np.intp], Polarity, NDArray[np.float64]]] = []
    scores = np.zeros(len(candidates))
    kinds = tuple((1 if polarity == "dark" else -1, polarity) for polarity in polarities)
    for sign, polarity in kinds:
        rows = np.flatnonzero(candidates.signs == sign)
        scores[rows] = correlations(gray, candidates.xy[rows], candidates.sides_px[rows], polarity)
    worth = scores + _PREFER_LARGE * np.log2(np.maximum(candidates.sides_px, 8) / 20)
    listed = [k for k in np.argsort(-worth, kind="stable") if scores[k] >= LEAST_CORRELATION]
    chosen = np.array(_short_list(candidates, listed), dtype=np.intp)
    for sign, polarity in kinds:
        rows = chosen[candidates.signs[chosen] == sign]
        parts.append((rows, polarity, scores[rows]))
    aligned = [
        align_candidates(
            gray, candidates.xy[rows], candidates.sides_px[rows], polarity, candidates.quotients[rows], score, noise
        )
        for rows, polarity, score in parts
    ]
    kept = np.concatenate([rows[one.rows] for (rows, _, _), one in zip(parts, aligned, strict=True)])
    return Alignments(
        candidates[kept],
        tuple(polarity for (_, polarity, _), one in zip(parts, aligned, strict=True) for _ in one.rows),
        Aligned(
            *(
                np.concatenate([getattr(one, name) for one in aligned])
                for name in ("theta", "noise", "evidence", "rows")
            )
        ),
    )


def _short_list(candidates: MarkerCandidates, listed: list[np.intp]) -> list[np.intp]:
    """Return the first `MOST_ALIGNED` of rows, without those near a better one of like size."""
    kept: list[np.intp] = []
    for i in listed:
        before = np.array(kept, dtype=np.intp)
        gaps = np.hypot(*(candidates.xy[before] - candidates.xy[i]).T)
        smaller = np.minimum(candidates.sides_px[before], candidates.sides_px[i])
        like = np.abs(np.log(candidates.sides_px[before] / candidates.sides_px[i])) < np.log(1.25)
        if (like & (gaps < 0.18 * smaller) & (candidates.signs[before] == candidates.signs[i])).any():
            continue
        kept.append(i)
        if len(kept) == MOST_ALIGNED:
            break
    return kept


def detect_markers(
    gray: NDArray[np.uint8], polarities: tuple[Polarity, ...] = ("dark", "light")
) -> tuple[Detection, ...]:
    """Return the markers of a (H, W) image, strongest first."""
    found = align_image(gray, polarities)
    model, threshold = shipped_model()
    likely = model.probabilities(found.aligned.evidence)
    rows = np.flatnonzero(likely > threshold)
    theta, sides, responses = found.aligned.theta, found.aligned.sides_px, found.candidates.responses
    rows = rows[suppress_non_maxima(theta[rows, :2], sides[rows], likely[rows])]
    rows = rows[np.argsort(-responses[rows], kind="stable")]
    affine = theta[:, 2:6].reshape(-1, 2, 2)
    upright = affine @ upright_rotation(affine)
    unexplained = np.exp(-found.aligned.evidence[:, COLUMNS.index("unexplained")])
    return tuple(
        Detection(
            id=number,
            xy=theta[k, :2],
            size=float(sides[k]),
            polarity=found.polarities[k],
            response=float(responses[k]),
            signature_distance=np.nan,
            rank=1 + int((responses > responses[k]).sum()),
            affinity=upright[k],
            explained=float(1 - min(unexplained[k], 1.0)),
            probability=float(likely[k]),
        )
        for number, k in enumerate(rows)
    )
