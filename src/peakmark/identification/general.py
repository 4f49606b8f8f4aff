"""The search of `identify(image)` for somebody's image: any polarity, size, tilt and light.

::

    SURF on five copies ─▶ candidates by quotient ─▶ the best by coarse correlation ─▶ alignment in any light
        ─▶ evidence ─▶ boosted trees (`general.json`) ─▶ non-maximum suppression ─▶ detections
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import (
    Aligned,
    align_candidates,
    correlations,
    finished,
    noise_sigma_of,
    together,
)
from peakmark.identification.candidates import MarkerCandidates, candidate_pages, joined
from peakmark.identification.detection import Detection
from peakmark.identification.marker_evidence import COLUMNS, marker_evidence
from peakmark.identification.marker_model import shipped_model
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity, Variant
from peakmark.refine.api import upright_rotation

LEAST_CORRELATION = 0.81
"""Coarse correlation from which a candidate is aligned: of markers that nothing covers it is above 0.86."""

BATCH = 64
"""Candidates that are aligned together, by falling worth."""

PRODUCTIVE = 1 / 6
"""Share of a batch that must be markers for the next one to be aligned."""

BEHIND: dict[Limit, float] = {"energy": 0.06, "range": 0.01}
"""Coarse correlation by which a pattern may fall short of the other one of its polarity and still be aligned. In any
light the binary pattern's, the simpler one, is up to 0.055 above that of the other, where the other is printed."""

USUAL = tuple(Variant(polarity) for polarity in get_args(Polarity))
"""The markers that are looked for unless the caller says: those of the paper."""

_BY_SIZE, _BY_QUOTIENT, _ENOUGH = 0.02, 0.08, 0.6
"""A candidate's worth: its correlation, this for each doubling of its side, and this times its quotient up to 0.6."""


@dataclass(frozen=True)
class Alignments:
    """Candidates of an image that could be aligned, with their evidence."""

    candidates: MarkerCandidates
    """(n,) of them."""
    variants: tuple[Variant, ...]
    """Of each, the marker that it was aligned with."""
    aligned: Aligned
    """The alignments."""
    evidence: NDArray[np.float64]
    """(n, c) see `marker_evidence`."""


def align_image(gray: NDArray[np.uint8], variants: Sequence[Variant] = USUAL) -> Alignments:
    """Return what could be aligned with one of the markers in a (H, W) image, of the first batch of candidates."""
    return next(_batches(gray, variants))


def _batches(gray: NDArray[np.uint8], variants: Sequence[Variant]) -> Iterator[Alignments]:
    """Yield alignments batch by batch, at least one, the best candidates first."""
    sigma = noise_sigma_of(gray)
    for candidates in candidate_pages(gray):
        scores = _scores(gray, candidates, variants)
        chosen = _short_list(candidates, scores.max(axis=1))
        while True:
            rows = np.array(list(islice(chosen, BATCH)), dtype=np.intp)
            yield _aligned(gray, candidates[rows], scores[rows], variants, sigma)
            if len(rows) < BATCH:
                break


def _scores(gray: NDArray[np.uint8], candidates: MarkerCandidates, variants: Sequence[Variant]) -> NDArray[np.float64]:
    """Return (n, v) coarse correlations of candidates with each of the markers, 0 with those of the other polarity."""
    scores = np.zeros((len(candidates), len(variants)))
    for k, variant in enumerate(variants):
        rows = np.flatnonzero(candidates.signs == (1 if variant.polarity == "dark" else -1))
        scores[rows, k] = correlations(gray, candidates.xy[rows], candidates.sides_px[rows], variant)
    return scores


def _short_list(candidates: MarkerCandidates, scores: NDArray[np.float64]) -> Iterator[np.intp]:
    """Yield the rows of candidates by falling worth, without those near a better one of like size."""
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
        yield i


def _aligned(
    gray: NDArray[np.uint8],
    candidates: MarkerCandidates,
    scores: NDArray[np.float64],
    variants: Sequence[Variant],
    sigma: float,
) -> Alignments:
    """Return candidates aligned with the marker that correlates best, and with the other one that does alike, too."""
    parts, kinds = [], []
    for k, variant in enumerate(variants):
        rows = np.flatnonzero((scores[:, k] > 0) & (scores[:, k] > scores.max(axis=1) - BEHIND[variant.limit]))
        aligned = align_candidates(gray, candidates.xy[rows], candidates.sides_px[rows], variant, sigma)
        parts.append(replace(aligned, rows=rows[aligned.rows]))
        kinds += [k] * len(aligned.rows)
    aligned, kind = together(parts), np.array(kinds, dtype=np.intp)
    rows = aligned.rows
    found = candidates[rows]
    evidence = marker_evidence(gray, aligned, found.quotients, scores[rows, kind], sigma)
    return Alignments(found, tuple(variants[k] for k in kind), aligned, evidence)


def _productive(gray: NDArray[np.uint8], batches: Iterator[Alignments]) -> Alignments:
    """Return the alignments of as many batches as add markers."""
    found, count = next(batches), 0
    while (markers := len(_markers(gray, found, _likely(found)))) - count >= PRODUCTIVE * BATCH:
        more = next(batches, None)
        if more is None:
            break
        found, count = _joined((found, more)), markers
    return found


def _likely(found: Alignments) -> NDArray[np.float64]:
    """Return (n,) probabilities that alignments are markers."""
    return shipped_model()[0].probabilities(found.evidence)


def _joined(batches: Sequence[Alignments]) -> Alignments:
    return Alignments(
        joined([batch.candidates for batch in batches]),
        tuple(variant for batch in batches for variant in batch.variants),
        together([batch.aligned for batch in batches]),
        np.concatenate([batch.evidence for batch in batches]),
    )


def _markers(gray: NDArray[np.uint8], found: Alignments, likely: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows of alignments that are markers, those found twice left out."""
    xy, sides = found.aligned.theta[:, :2], found.aligned.sides_px
    is_inside = ((xy > -0.5) & (xy < np.array(gray.shape[::-1]) - 0.5)).all(axis=1)
    rows = np.flatnonzero((likely > shipped_model()[1]) & is_inside)
    return np.asarray(rows[suppress_non_maxima(xy[rows], sides[rows], likely[rows])])


def detect_markers(gray: NDArray[np.uint8], variants: Sequence[Variant] = USUAL) -> tuple[Detection, ...]:
    """Return the markers whose centres lie in a (H, W) image, strongest first."""
    found = _productive(gray, _batches(gray, variants))
    likely = _likely(found)
    rows = _markers(gray, found, likely)
    rows = rows[np.argsort(-found.candidates.responses[rows], kind="stable")]
    return tuple(_detection(gray, found, int(row), number, float(likely[row])) for number, row in enumerate(rows))


def _detection(gray: NDArray[np.uint8], found: Alignments, row: int, number: int, probability: float) -> Detection:
    """Return one alignment as a detection, upright."""
    aligned, responses = found.aligned, found.candidates.responses
    theta, covariance = finished(gray, aligned, row, found.variants[row])
    affine = theta[2:6].reshape(2, 2)
    rotation = upright_rotation(affine[None])[0]
    unexplained = np.exp(-found.evidence[row, COLUMNS.index("unexplained")])
    return Detection(
        id=number,
        xy=theta[:2],
        size=float(np.sqrt(np.abs(np.linalg.det(affine)))),
        polarity=found.variants[row].polarity,
        limit=found.variants[row].limit,
        response=float(responses[row]),
        signature_distance=np.nan,
        rank=1 + int((responses > responses[row]).sum()),
        affinity=affine @ rotation,
        explained=float(1 - min(unexplained, 1.0)),
        probability=probability,
        perspective=rotation.T @ theta[6:8],
        covariance=covariance,
    )
