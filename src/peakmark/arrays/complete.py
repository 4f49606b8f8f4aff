"""Members of arrays that a search missed, seen where their neighbours say that they stand, and pairs that lack one."""

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from peakmark.arrays.lattice import SIZE_RATIO, MarkerShapes, neighbours
from peakmark.arrays.look import AROUND, OF_SURF, Print, Sighting, correlation_at, look_around, probability_of
from peakmark.identification.detection import Detection, expected_detection
from peakmark.identification.general import align_at
from peakmark.markers.patterns import Variant

LIKELY = 0.5
"""Probability from which a marker that was looked for counts as seen."""

CLEAR = 0.99
"""Probability below which it leaves its array's code open."""

SAME_PLACE = 0.2
"""A detection this near to what is seen, in sides, is the same marker."""

OVERLAP = 0.8
"""A marker whose centre is nearer than this to another's, in sides along both its axes, would cover part of it."""

PAIR_RADIUS = 0.12
"""Two markers are a pair of neighbours if one is this near, in sides, to a cell around the other, by both shapes."""

_LIKE_SHAPE = 0.25
"""Largest difference of the two shapes of a pair, modulo quarter turns, in their size."""


def complete(
    gray: NDArray[np.uint8],
    found: Sequence[Detection],
    seen: MarkerShapes,
    known: Set[int],
    around: Set[int],
    pitch: float,
) -> tuple[list[int], tuple[Detection, ...]]:
    """Return the markers that stay, and those that the image shows beside them; what is in the way of these goes.

    Only measured shapes tell where to look; of round ones two neighbours tell the rotation, which neither shows alone.
    `known` are indices beside which nothing is missing, `around` those beside which to look; `pitch` is the distance of
    neighbours in sides. What is added has id −1, rank 0, no response, and its probability.
    """
    beside = [k for k in sorted(around - known) if seen.is_measured[k]]
    turned = _turned(seen, known, set(beside), pitch) if seen.is_round else [(k, seen.shapes[k]) for k in beside]
    sightings = [
        sighting
        for k, shape in turned
        for sighting in look_around(gray, seen.xy[k], shape, pitch, _print_of(found[k])).values()
        if sighting.probability >= LIKELY and not _is_at(sighting, seen)
    ]
    sightings.sort(key=lambda s: -s.correlation)
    places, free = np.array([s.xy for s in sightings]).reshape(-1, 2), np.ones(len(sightings), dtype=bool)
    added: list[Sighting] = []
    for k, sighting in enumerate(sightings):
        if free[k]:
            added.append(sighting)
            free &= ~_overlaps(sighting, places)
    clear = [sighting for sighting in added if sighting.probability >= CLEAR]
    hidden = {int(k) for sighting in clear for k in np.flatnonzero(_overlaps(sighting, seen.xy))}
    kept = [k for k in range(len(seen.xy)) if k in known or k not in hidden]
    return kept, tuple(_detection(gray, sighting) for sighting in added)


def _print_of(found: Detection) -> Print:
    """Return what stands beside a marker; SURF's binary markers are looked for as its others."""
    return OF_SURF if found.made_for == "surf" else Print(found.made_for, found.limit)


def _turned(
    seen: MarkerShapes, known: Set[int], beside: Set[int], pitch: float
) -> list[tuple[int, NDArray[np.float64]]]:
    """Return round markers that have a neighbour, and their shapes (2, 2) with the rotation that this one tells."""
    turned = []
    for i, j in pairs(seen, known, pitch):
        if not {i, j} & beside:
            continue
        for k, towards in ((i, seen.xy[j] - seen.xy[i]), (j, seen.xy[i] - seen.xy[j])):
            u = np.linalg.solve(seen.shapes[k], towards)
            is_diagonal = np.linalg.norm(u) > (1 + np.sqrt(2)) / 2 * pitch
            angle = np.arctan2(u[1], u[0]) - is_diagonal * np.pi / 4
            c, s = np.cos(angle), np.sin(angle)
            turned.append((k, seen.shapes[k] @ np.array([[c, -s], [s, c]])))
    return turned


def _is_at(sighting: Sighting, seen: MarkerShapes) -> bool:
    """Return whether one of the markers is what is seen."""
    gaps = np.linalg.norm(seen.xy - sighting.xy, axis=1)
    return bool((gaps <= SAME_PLACE * np.maximum(seen.sizes, sighting.side_px)).any())


def _overlaps(sighting: Sighting, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (n,) whether a marker of the same size around centres (n, 2) would cover part of what is seen."""
    u = np.linalg.solve(sighting.affinity, (xy - sighting.xy).T)
    return np.asarray(np.abs(u).max(axis=0) <= OVERLAP)


def _detection(gray: NDArray[np.uint8], sighting: Sighting) -> Detection:
    """Return what is seen as a detection, aligned with the printed pattern where that succeeds near."""
    printed = sighting.printed
    fit = align_at(gray, sighting.xy, sighting.side_px, _variant_of(sighting))
    if fit is None or not _is_near(fit, sighting):
        return _unaligned(sighting)
    assert fit.affinity is not None
    if printed.made_for == "sift":  # a round marker shows no rotation
        fit = replace(fit, affinity=_turned_like(fit.affinity, sighting.affinity))
    aligned = correlation_at(gray, fit.xy, np.asarray(fit.affinity), sighting.polarity, printed)
    return replace(fit, probability=probability_of(max(aligned, sighting.correlation), printed))


def _unaligned(sighting: Sighting) -> Detection:
    """Return what is seen as a detection, as it is."""
    return expected_detection(
        _variant_of(sighting),
        xy=sighting.xy,
        size=sighting.side_px,
        affinity=sighting.affinity,
        probability=probability_of(sighting.correlation, sighting.printed),
    )


def _variant_of(sighting: Sighting) -> Variant:
    return Variant(sighting.polarity, sighting.printed.limit, sighting.printed.made_for)


def _is_near(fit: Detection, sighting: Sighting) -> bool:
    ratio = fit.size / sighting.side_px
    return bool(np.linalg.norm(fit.xy - sighting.xy) < SAME_PLACE / 2 * sighting.side_px and 0.5 < ratio < 2)


def _turned_like(shape: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shape (2, 2) of a round marker in that rotation in which it is nearest to another one."""
    left, _, right = np.linalg.svd(np.linalg.solve(shape, other))
    return np.asarray(shape @ left @ right)


def are_alike(seen: MarkerShapes, members: Sequence[int], pitch: float) -> bool:
    """Return whether each of an array's markers is by its shape a neighbour of another one: else one is misaligned."""
    return all(any(_misfit(seen, i, j, pitch) <= PAIR_RADIUS for j in members if j != i) for i in members)


def pairs(seen: MarkerShapes, members: Set[int], pitch: float) -> list[tuple[int, int]]:
    """Return pairs of measured markers, none of them among `members`, that stand like neighbours of one array.

    Each is in one pair at most, the one that fits best.
    """
    if len(seen.xy) < 2:
        return []
    free = {k for k in range(len(seen.xy)) if k not in members and seen.is_measured[k]}
    near = neighbours(seen, pitch)
    beside = {(min(i, j), max(i, j)) for i in free for j in near[i] if j in free}
    fits = sorted((gap, i, j) for i, j in beside if (gap := _misfit(seen, i, j, pitch)) <= PAIR_RADIUS)
    chosen: list[tuple[int, int]] = []
    for _, i, j in fits:
        if not {i, j} & {k for pair in chosen for k in pair}:
            chosen.append((i, j))
    return chosen


def _misfit(seen: MarkerShapes, i: int, j: int, pitch: float) -> float:
    """Return how far, in sides, two markers are from being neighbours; inf where their shapes differ too much."""
    ratio = seen.sizes[i] / seen.sizes[j]
    if abs(np.log(ratio)) > np.log(SIZE_RATIO):
        return np.inf
    turn = np.linalg.solve(seen.shapes[i], seen.shapes[j]) * ratio
    if seen.is_round:
        return _misfit_of_round(seen, i, j, turn, pitch)
    quarters = [turn @ np.linalg.matrix_power([[0, -1], [1, 0]], k) for k in range(4)]
    if min(float(np.abs(q - np.eye(2)).max()) for q in quarters) > _LIKE_SHAPE:
        return np.inf
    gap = seen.xy[j] - seen.xy[i]
    u = (np.linalg.solve(seen.shapes[i], gap) + np.linalg.solve(seen.shapes[j], gap)) / 2  # perspective cancels
    return float(np.linalg.norm(u - pitch * np.array(AROUND), axis=1).min())


def _misfit_of_round(seen: MarkerShapes, i: int, j: int, turn: NDArray[np.float64], pitch: float) -> float:
    """Return the same of round markers, by their distance; `turn` (2, 2) is one shape in terms of the other."""
    longest, shortest = np.linalg.svd(turn, compute_uv=False)
    if max(longest - 1, 1 - shortest) > _LIKE_SHAPE:
        return np.inf
    gap = seen.xy[j] - seen.xy[i]
    away = sum(float(np.linalg.norm(np.linalg.solve(seen.shapes[k], gap))) for k in (i, j)) / 2
    return float(min(abs(away - pitch), abs(away - np.sqrt(2) * pitch)))
