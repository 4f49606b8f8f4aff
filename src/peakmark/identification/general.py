"""The search of `identify(image)` for somebody's image: any polarity, size, tilt and light.

::

    blobs of five shapes ─▶ candidates by quotient ─▶ the best by coarse correlation ─▶ screen
        ─▶ alignment in any light ─▶ evidence ─▶ boosted trees ─▶ non-maximum suppression ─▶ detections
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import (
    Aligned,
    align_candidates,
    correlations,
    finished,
    noise_sigma_of,
    span_of,
    spread_of,
    start_of,
    together,
)
from peakmark.identification.candidates import MarkerCandidates, distinct_rows, joined
from peakmark.identification.detection import Detection, FitSpread, expected_detection
from peakmark.identification.families import FAMILIES, SOURCES, Family
from peakmark.identification.marker_evidence import COLUMNS, marker_evidence
from peakmark.identification.marker_model import MarkerModel, shipped_model
from peakmark.identification.screening import BETTER, SCREEN_COLUMNS, Screen, has_screen, screen_columns, shipped_screen
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.markers.patterns import Polarity, Variant
from peakmark.refine.api import upright_rotation
from peakmark.refine.round import disc_centers

BATCH, SCREENED_BATCH = 64, 16
"""Candidates that are aligned together, by falling worth; and at first of those that passed a screen, the likeliest,
unless more are likely."""

LEAST_ODDS = -2.0
"""Sum of the screen from which a candidate is likely. Set by hand: of 3369 markers of the training images 5 % are
below, and one candidate an image that is none is above."""

PRODUCTIVE = 1 / 6
"""Share of a batch that must be markers for the next one to be aligned; or one in its latter half, behind which more
may be, as where a sky's stars are as good candidates. And share of a page's candidates, for the next page."""

USUAL = tuple(Variant(polarity) for polarity in get_args(Polarity))
"""The markers that are looked for unless the caller says: those of the paper."""

_BY_QUOTIENT, _ENOUGH = 0.08, 0.6
"""A candidate's worth is its correlation, this times its quotient up to 0.6, and what its family adds."""


_NEAR, _LIKE = 0.18, 1.25
"""Candidates of one sign this near, in sides, and this like in side, are one."""

_SAME, _SAME_SIDE, _SURE = 0.1, 1.15, 0.9
"""And those whose postures are, if one correlates so well; a fit starts from the candidate, so that the one nearest to
the posture counts. Set by hand: of 20 markers that were lost while the one that correlates best counted, in 480 images,
none is lost by it."""


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
    looks: NDArray[np.float64]
    """(n, s) see `SCREEN_COLUMNS`; nan of markers that have no screen."""
    tried: int
    """Candidates that there were, with those of which none could be aligned or that were given up."""

    @property
    def sides_px(self) -> NDArray[np.float64]:
        """(n,) sides of the markers, of which a round one is aligned in part."""
        return np.asarray(self.aligned.sides_px / np.array([span_of(variant) for variant in self.variants]))


Page = tuple[int, Iterator[Alignments]]
"""How many of its candidates are worth a look, and alignments of them in batches."""


@dataclass(frozen=True)
class _Rated:
    """A page of candidates, rated before any is aligned."""

    candidates: MarkerCandidates
    scores: NDArray[np.float64]
    """(n, variants) coarse correlation with each marker, 0 with those of the other polarity."""
    looks: NDArray[np.float64]
    """(n, c) see `SCREEN_COLUMNS`; nan where the correlation is too low, and of markers that have no screen."""
    odds: NDArray[np.float64]
    """(n,) what the screen says of them; ∞ without one."""
    postures: NDArray[np.float64]
    """(n, 6) where the pattern lies, see `refine.posture`; nan as the looks."""


def align_image(gray: NDArray[np.uint8], variants: Sequence[Variant] = USUAL, is_screened: bool = False) -> Alignments:
    """Return what could be aligned with one of the markers in a (H, W) image, of the first batch of candidates.

    The markers are all made for one detector. Unless they are screened, all candidates of the batch are aligned.
    """
    _, batches = next(_pages(gray, variants, FAMILIES[variants[0].made_for].pages(gray), is_screened))
    return next(batches)


def _pages(
    gray: NDArray[np.uint8], variants: Sequence[Variant], pages: Iterator[MarkerCandidates], is_screened: bool = True
) -> Iterator[Page]:
    """Yield pages of candidates, of each how many are worth a look, and their alignments, the best candidates first."""
    sigma, family = noise_sigma_of(gray), FAMILIES[variants[0].made_for]
    screen = shipped_screen() if is_screened and all(has_screen(each) for each in variants) else None
    for candidates in pages:
        rated = _rated(gray, candidates, variants, sigma, screen)
        listed = _short_list(rated, family, gray.shape)
        rows = _screened(rated, listed, screen.before.least) if screen else listed
        yield len(listed), _batches(gray, rated, rows, variants, sigma, screen)


def _batches(
    gray: NDArray[np.uint8],
    rated: _Rated,
    rows: NDArray[np.intp],
    variants: Sequence[Variant],
    sigma: float,
    screen: Screen | None,
) -> Iterator[Alignments]:
    """Yield alignments of rows batch by batch, at least one; all that a screen calls likely are in the first."""
    likely = int((rated.odds[rows] >= LEAST_ODDS).sum())
    first, size = 0, SCREENED_BATCH if screen else BATCH
    while first < max(len(rows), 1):
        end = max(first + size, likely if screen else 0)
        yield _aligned(gray, rated, rows[first:end], variants, sigma, screen)
        first = end


def _rated(
    gray: NDArray[np.uint8],
    candidates: MarkerCandidates,
    variants: Sequence[Variant],
    sigma: float,
    screen: Screen | None,
) -> _Rated:
    """Return how well candidates correlate with each marker, and what the screen says of those that do."""
    scores = np.zeros((len(candidates), len(variants)))
    looks = np.full((len(candidates), len(SCREEN_COLUMNS)), np.nan)
    odds, better = np.full(len(candidates), np.inf), np.full((len(candidates), 6), np.nan)
    least = FAMILIES[variants[0].made_for].least_correlation
    for k, variant in enumerate(variants):
        rows = np.flatnonzero(candidates.signs == (1 if variant.polarity == "dark" else -1))
        sides = candidates.sides_px[rows] * start_of(variant)
        scores[rows, k], postures = correlations(gray, candidates.xy[rows], sides, variant)
        if all(has_screen(each) for each in variants):
            own = scores[rows, k] >= least
            rows, postures = rows[own], postures[own]
            seen = (candidates[rows], postures, scores[rows, k])
            looks[rows], better[rows] = screen_columns(gray, *seen, variant, sigma)
            odds[rows] = screen.before.trees.sums(looks[rows]) if screen else np.inf
    return _Rated(candidates, scores, looks, odds, better)


def _short_list(rated: _Rated, family: Family, shape: tuple[int, ...]) -> NDArray[np.intp]:
    """Return the rows of candidates by falling worth, without those near a better one of like size."""
    candidates, scores = rated.candidates, rated.scores.max(axis=1)
    worth = scores + _BY_QUOTIENT * np.minimum(candidates.quotients, _ENOUGH) + family.more_worth(candidates)
    order = np.argsort(-worth, kind="stable")
    order = order[scores[order] >= family.least_correlation]
    columns = (candidates.sides_px, candidates.responses, candidates.signs, candidates.quotients)
    rows = np.column_stack([candidates.xy, *columns])[order]
    return np.asarray(order[distinct_rows(rows, shape, _NEAR, _LIKE)])


def _screened(rated: _Rated, rows: NDArray[np.intp], least: float) -> NDArray[np.intp]:
    """Return the rows that pass the screen, the likeliest first, of those in a sure one's posture the nearest to it."""
    rows = rows[rated.odds[rows] >= least]
    candidates, postures, is_sure = rated.candidates[rows], rated.postures[rows], rated.looks[rows, BETTER] >= _SURE
    sides = np.sqrt(np.abs(postures[:, 2] * postures[:, 5] - postures[:, 3] * postures[:, 4]))
    gaps = np.hypot(*(postures[:, None, :2] - postures[None, :, :2]).transpose(2, 0, 1))
    smaller, larger = np.minimum.outer(sides, sides), np.maximum.outer(sides, sides)
    is_same = (
        (gaps < _SAME * smaller) & (larger < _SAME_SIDE * smaller) & (candidates.signs[:, None] == candidates.signs)
    )
    off = np.hypot(*(postures[:, :2] - candidates.xy).T) / sides + np.abs(np.log(sides / candidates.sides_px))
    is_again = (is_same & (off < off[:, None]) & is_sure).any(axis=1)
    rows = rows[~is_again]
    return rows[np.argsort(-rated.odds[rows], kind="stable")]


def _aligned(
    gray: NDArray[np.uint8],
    rated: _Rated,
    chosen: NDArray[np.intp],
    variants: Sequence[Variant],
    sigma: float,
    screen: Screen | None,
) -> Alignments:
    """Return candidates aligned with the marker that correlates best, and with the other one that does alike, too."""
    parts, kinds, family = [], [], FAMILIES[variants[0].made_for]
    candidates, scores = rated.candidates[chosen], rated.scores[chosen]
    for k, variant in enumerate(variants):
        rows = np.flatnonzero((scores[:, k] > 0) & (scores[:, k] > scores.max(axis=1) - family.behind[variant.limit]))
        sides = candidates.sides_px[rows] * start_of(variant)
        is_worth = partial(screen.is_worth, rated.odds[chosen][rows]) if screen else None
        aligned = align_candidates(gray, candidates.xy[rows], sides, variant, sigma, is_worth)
        parts.append(replace(aligned, rows=rows[aligned.rows]))
        kinds += [k] * len(aligned.rows)
    aligned, kind = together(parts), np.array(kinds, dtype=np.intp)
    rows = aligned.rows
    found, aligned_with = candidates[rows], tuple(variants[k] for k in kind)
    evidence = marker_evidence(gray, aligned, found.quotients, scores[rows, kind], sigma)
    more = family.more_evidence(gray, aligned, aligned_with)
    evidence = np.column_stack([evidence, *(more[name] for name in family.columns[len(COLUMNS) :])])
    return Alignments(found, aligned_with, aligned, evidence, rated.looks[chosen][rows], len(chosen))


def _productive(gray: NDArray[np.uint8], pages: Iterator[Page]) -> Alignments:
    """Return the alignments of as many batches of each page as add markers, and of as many pages."""
    parts: list[Alignments] = []
    count = 0
    for listed, batches in pages:
        before = count
        for batch in batches:
            first, parts = sum(len(part.variants) for part in parts), [_joined([*parts, batch])]
            rows = _markers(gray, parts[0], _likely(parts[0]))
            is_late = parts[0].aligned.rows[rows[rows >= first]] >= batch.tried / 2
            is_productive, count = len(rows) - count >= PRODUCTIVE * batch.tried, len(rows)
            if not (is_productive or is_late.any()):
                break
        if count - before <= PRODUCTIVE * listed:
            break
    return parts[0]


def _likely(found: Alignments) -> NDArray[np.float64]:
    """Return (n,) probabilities that alignments are markers."""
    return _model(found.variants).probabilities(found.evidence)


def _model(variants: Sequence[Variant]) -> MarkerModel:
    """Return what decides for markers that are made for one detector; with none it does not matter which."""
    return shipped_model(variants[0].made_for if variants else "surf")[0]


def _joined(batches: Sequence[Alignments]) -> Alignments:
    return Alignments(
        joined([batch.candidates for batch in batches]),
        tuple(variant for batch in batches for variant in batch.variants),
        together([batch.aligned for batch in batches]),
        np.concatenate([batch.evidence for batch in batches]),
        np.concatenate([batch.looks for batch in batches]),
        sum(batch.tried for batch in batches),
    )


def _markers(gray: NDArray[np.uint8], found: Alignments, likely: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows of alignments that are markers, those found twice left out."""
    xy, sides = found.aligned.theta[:, :2], found.sides_px
    thresholds = np.array([shipped_model(variant.made_for, variant.limit)[1] for variant in found.variants])
    is_inside = ((xy > -0.5) & (xy < np.array(gray.shape[::-1]) - 0.5)).all(axis=1)
    rows = np.flatnonzero((likely > thresholds) & is_inside)
    return np.asarray(rows[suppress_non_maxima(xy[rows], sides[rows], likely[rows])])


def detect_markers(
    gray: NDArray[np.uint8],
    variants: Sequence[Variant] = USUAL,
    detectors: Sequence[str] = ("surf",),
    focal_px: float | None = None,
) -> tuple[Detection, ...]:
    """Return the markers whose centres lie in a (H, W) image, strongest first, those of each detector by themselves.

    Of the variants each detector finds those that are made for it, see `SOURCES`. What is found as a marker of two is
    the likelier one. The focal length tells where discs' centres may be; about the longer side unless given.
    """
    found: list[Detection] = []
    for detector in detectors:
        made_for, pages = SOURCES[detector]
        own = [variant for variant in variants if variant.made_for == made_for]
        own = [variant for variant in own if detector != "surf-disc" or variant.limit == "range"]
        if own:
            found += _detect_family(gray, own, pages(gray), focal_px)
    if len(detectors) > 1 and found:
        columns = (np.array([getattr(one, name) for one in found]) for name in ("xy", "size", "probability"))
        found = [found[row] for row in sorted(suppress_non_maxima(*columns))]
    return tuple(replace(detection, id=number) for number, detection in enumerate(found))


def _detect_family(
    gray: NDArray[np.uint8], variants: Sequence[Variant], pages: Iterator[MarkerCandidates], focal_px: float | None
) -> Iterator[Detection]:
    """Yield the markers that are made for one detector, strongest first."""
    found = _productive(gray, _pages(gray, variants, pages))
    likely = _likely(found)
    rows = _markers(gray, found, likely)
    for number, row in enumerate(rows[np.argsort(-found.candidates.responses[rows], kind="stable")]):
        one = _detection(gray, found, int(row), number, float(likely[row]), focal_px)
        yield _at_disc_center(one, gray.shape, focal_px) if found.variants[row].is_disc else one


def _at_disc_center(one: Detection, shape: tuple[int, ...], focal_px: float | None) -> Detection:
    """Return a disc that was found as an ellipse where its centre may be seen."""
    assert one.affinity is not None
    assert one.covariance is not None
    places = disc_centers(one.xy[None], one.affinity[None], shape, focal_px)
    return replace(one, xy=places.xy[0], aside=places.aside[0], covariance=one.covariance + places.covariance[0])


def _detection(
    gray: NDArray[np.uint8], found: Alignments, row: int, number: int, probability: float, focal_px: float | None
) -> Detection:
    """Return one alignment as a detection, upright."""
    responses, variant = found.candidates.responses, found.variants[row]
    unexplained = np.exp(-found.evidence[row, COLUMNS.index("unexplained")])
    return Detection(
        id=number,
        polarity=variant.polarity,
        limit=variant.limit,
        made_for=variant.made_for,
        response=float(responses[row]),
        signature_distance=float(found.evidence[row, len(COLUMNS)]) if variant.made_for == "sift" else np.nan,
        rank=1 + int((responses > responses[row]).sum()),
        explained=float(1 - min(unexplained, 1.0)),
        probability=probability,
        **_measured(gray, found.aligned, row, variant, focal_px),
    )


def _measured(
    gray: NDArray[np.uint8], aligned: Aligned, row: int, variant: Variant, focal_px: float | None = None
) -> dict[str, Any]:
    """Return what a last fit measures, as fields of a `Detection`, upright."""
    theta, covariance, precision = finished(gray, aligned, row, variant, focal_px)
    span = span_of(variant)
    affine = theta[2:6].reshape(2, 2) / span
    rotation = upright_rotation(affine[None])[0]
    spread = spread_of(covariance, precision)
    turn = np.kron(np.eye(4), rotation.T / span)
    turn[:2, :2] = np.eye(2)
    upright = FitSpread(turn @ spread.covariance @ turn.T, turn @ spread.drawn @ rotation * span)
    return {
        "xy": theta[:2],
        "size": float(np.sqrt(np.abs(np.linalg.det(affine)))),
        "affinity": affine @ rotation,
        "perspective": rotation.T @ theta[6:8] / span,
        "covariance": covariance[:2, :2],
        "spread": upright if variant.made_for == "surf" and np.isfinite(upright.covariance).all() else None,
    }


def align_at(gray: NDArray[np.uint8], xy: NDArray[np.float64], side_px: float, variant: Variant) -> Detection | None:
    """Return the marker near a position where one is known to stand, aligned as those of a search; None without one.

    It has id −1, rank 0, no response and no probability.
    """
    aligned = align_candidates(gray, xy[None], np.array([side_px * span_of(variant)]), variant, noise_sigma_of(gray))
    if not len(aligned.rows):
        return None
    after_plane, after_pattern = aligned.figures[0, 1], aligned.figures[0, 3]
    explained = float(1 - min(after_pattern / max(after_plane, 1e-9), 1.0))
    return expected_detection(variant, explained=explained, **_measured(gray, aligned, 0, variant))
