"""The search of `identify(image)` for somebody's image: any polarity, size, tilt and light.

::

    SURF on five copies ─▶ candidates by quotient ─▶ the best by coarse correlation ─▶ alignment in any light
        ─▶ evidence ─▶ boosted trees (`general.json`) ─▶ non-maximum suppression ─▶ detections
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import (
    Aligned,
    align_candidates,
    center_covariance,
    correlations,
    noise_sigma_of,
    together,
)
from peakmark.identification.candidates import MarkerCandidates, find_candidates
from peakmark.identification.detection import Detection
from peakmark.identification.marker_evidence import COLUMNS, marker_evidence
from peakmark.identification.marker_model import shipped_model
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.markers.patterns import Polarity
from peakmark.refine.api import upright_rotation

LEAST_CORRELATION = 0.81
"""Coarse correlation from which a candidate is aligned: of markers that nothing covers it is above 0.86."""

MOST_ALIGNED = 64
"""Candidates of an image that are aligned, by falling worth."""

_BY_SIZE, _BY_QUOTIENT, _ENOUGH = 0.02, 0.08, 0.6
"""A candidate's worth: its correlation, this for each doubling of its side, and this times its quotient up to 0.6."""


@dataclass(frozen=True)
class Alignments:
    """All candidates of an image that could be aligned, with their evidence."""

    candidates: MarkerCandidates
    """(n,) of them."""
    polarities: tuple[Polarity, ...]
    """Of each."""
    aligned: Aligned
    """The alignments; their rows are those of the candidates here."""
    evidence: NDArray[np.float64]
    """(n, c) see `marker_evidence`."""


def align_image(gray: NDArray[np.uint8], polarities: tuple[Polarity, ...] = ("dark", "light")) -> Alignments:
    """Return what could be aligned with a marker of one of the polarities in a (H, W) image."""
    candidates, sigma = find_candidates(gray), noise_sigma_of(gray)
    kinds = tuple((1 if polarity == "dark" else -1, polarity) for polarity in polarities)
    scores = np.zeros(len(candidates))
    for sign, polarity in kinds:
        rows = np.flatnonzero(candidates.signs == sign)
        scores[rows] = correlations(gray, candidates.xy[rows], candidates.sides_px[rows], polarity)
    chosen = _short_list(candidates, scores)
    parts = []
    for sign, polarity in kinds:
        rows = chosen[candidates.signs[chosen] == sign]
        aligned = align_candidates(gray, candidates.xy[rows], candidates.sides_px[rows], polarity, sigma)
        parts.append(replace(aligned, rows=rows[aligned.rows]))
    aligned = together(parts)
    found, rows = candidates[aligned.rows], aligned.rows
    evidence = marker_evidence(gray, aligned, found.quotients, scores[rows], sigma)
    return Alignments(found, tuple("dark" if sign > 0 else "light" for sign in found.signs), aligned, evidence)


def _short_list(candidates: MarkerCandidates, scores: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows of the candidates worth most, without those near a better one of like size."""
    worth = scores + _BY_SIZE * np.log2(np.maximum(candidates.sides_px, 8) / 20)
    worth += _BY_QUOTIENT * np.minimum(candidates.quotients, _ENOUGH)
    kept: list[np.intp] = []
    for i in np.argsort(-worth, kind="stable"):
        if scores[i] < LEAST_CORRELATION:
            continue
        before = np.array(kept, dtype=np.intp)
        gaps = np.hypot(*(candidates.xy[before] - candidates.xy[i]).T)
        smaller = np.minimum(candidates.sides_px[before], candidates.sides_px[i])
        like = np.abs(np.log(candidates.sides_px[before] / candidates.sides_px[i])) < np.log(1.25)
        if (like & (gaps < 0.18 * smaller) & (candidates.signs[before] == candidates.signs[i])).any():
            continue
        kept.append(i)
        if len(kept) == MOST_ALIGNED:
            break
    return np.array(kept, dtype=np.intp)


def detect_markers(
    gray: NDArray[np.uint8], polarities: tuple[Polarity, ...] = ("dark", "light")
) -> tuple[Detection, ...]:
    """Return the markers whose centres lie in a (H, W) image, strongest first."""
    found = align_image(gray, polarities)
    model, threshold = shipped_model()
    likely = model.probabilities(found.evidence)
    size = np.array(gray.shape[::-1])
    is_inside = ((found.aligned.theta[:, :2] > -0.5) & (found.aligned.theta[:, :2] < size - 0.5)).all(axis=1)
    rows = np.flatnonzero((likely > threshold) & is_inside)
    aligned, responses = found.aligned, found.candidates.responses
    rows = rows[suppress_non_maxima(aligned.theta[rows, :2], aligned.sides_px[rows], likely[rows])]
    rows = rows[np.argsort(-responses[rows], kind="stable")]
    return tuple(_detection(gray, found, int(row), number, float(likely[row])) for number, row in enumerate(rows))


def _detection(gray: NDArray[np.uint8], found: Alignments, row: int, number: int, probability: float) -> Detection:
    """Return one alignment as a detection, upright."""
    aligned, responses, theta = found.aligned, found.candidates.responses, found.aligned.theta[row]
    affine = theta[2:6].reshape(2, 2)
    rotation = upright_rotation(affine[None])[0]
    unexplained = np.exp(-found.evidence[row, COLUMNS.index("unexplained")])
    return Detection(
        id=number,
        xy=theta[:2],
        size=float(aligned.sides_px[row]),
        polarity=found.polarities[row],
        response=float(responses[row]),
        signature_distance=np.nan,
        rank=1 + int((responses > responses[row]).sum()),
        affinity=affine @ rotation,
        explained=float(1 - min(unexplained, 1.0)),
        probability=probability,
        perspective=rotation.T @ theta[6:8],
        covariance=center_covariance(gray, aligned, row, found.polarities[row]),
    )
