"""Super-markers: arrays of light and dark markers that carry a number (paper, Section 4.2, Figures 13 and 15).

Two decoders share one result. `paper` is the paper's: a marker whose two nearest neighbours are similarly far and in
roughly perpendicular directions makes a cluster, which is read as if upright. `robust` needs no upright camera: it lays
a lattice through markers of like size, finds the blank corner, reads from there, and leaves the code open where
something speaks against it. Given the image, it also looks for members that the search has missed (`arrays.look`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.arrays.blank import is_blank
from peakmark.arrays.complete import CLEAR, are_alike, complete, pairs
from peakmark.arrays.lattice import Cell, Lattice, Limits, MarkerShapes, expected, lattices, positions
from peakmark.arrays.paper import decode_upright
from peakmark.errors import InputError, check_choice
from peakmark.identification.detection import Detection
from peakmark.identification.suppression import suppress_non_maxima
from peakmark.keypoints.image import as_gray
from peakmark.markers.array_code import THREE_BIT, Layout, code_of

ORIENTATION_MARGIN = 1.12
"""Of two lattices through a marker the less square one must be this much less so to be dismissed. Set by hand; the
tests hold it to no misread code under noise, with sizes alone as well."""

QUIET_STEPS = 1.2
"""No other marker of like size may be nearer to an array's cells, the blank one included, in steps of its lattice. A
marker of the same grid is one step away; one and a half, at which arrays should hang, stays well outside."""

LIKE_SIZE = 1.6
"""Markers whose sides differ by a larger factor are not of one print: neither doubles nor neighbours. Set by hand, a
little above the ratio up to which markers of one array may differ (`lattice.SIZE_RATIO`)."""


_ROUNDS = 4
"""Times that members are looked for beside those that were seen before: in large arrays one leads to another."""


@dataclass(frozen=True)
class MarkerArray:
    """An array found in an image."""

    code: int | None
    """The number that it carries; None where the decoder is unsure."""
    doubt: str
    """Why it is unsure, otherwise empty."""
    detections: tuple[Detection, ...]
    """Its markers in reading order from the blank corner; in no certain order without a code. Those of rank 0 were not
    among the given ones: they were seen where the others say that they stand."""
    layout: Layout
    """The layout that was looked for."""

    @property
    def xy(self) -> NDArray[np.float64]:
        """(2,) mean of its markers' centres, px."""
        return np.asarray(np.mean([d.xy for d in self.detections], axis=0))

    @property
    def steps_px(self) -> NDArray[np.float64]:
        """(2, 2) px from a marker to the next one in its row, and in its column, as columns; for arrays with a code."""
        cells = np.column_stack([np.array(self.layout.cells, dtype=np.float64), np.ones(len(self.layout.cells))])
        return np.asarray(np.linalg.lstsq(cells, np.array([d.xy for d in self.detections]), rcond=None)[0][:2].T)


def decode_arrays(
    detections: Iterable[Detection],
    layout: Layout = THREE_BIT,
    *,
    rule: Literal["robust", "paper"] = "robust",
    affinity: ArrayLike | None = None,
    image_size: tuple[int, int] | None = None,
    image: ArrayLike | None = None,
) -> tuple[MarkerArray, ...]:
    """Return the arrays among dark and light markers, those without doubt first, then by code.

    Parameters
    ----------
    detections
        Identified markers of both polarities, in any order.
    layout
        What is printed.
    rule
        "robust", or "paper" for the baseline, which knows the upright 2×2 array only and always names a code.
    affinity
        (n, 2, 2) shapes of refined markers, px per side, up to quarter turns; a row of nan where there is none. None
        takes those of the detections. With one for every detection, arrays are read up to steep tilts; without, up to
        about 45°.
    image_size
        (width, height) px. With it an array whose blank corner lies outside the image is unsure: a full block of
        markers that the border cuts looks the same.
    image
        The image itself, grey or RGB, which also tells its size. With it refined markers tell where to look for those
        that the search has missed, an array of which one is covered or missing is returned as unsure, and so is one
        whose blank corner is not as bright and even as bare paper: a full block of markers of which one was missed
        looks the same.

    Raises
    ------
    InputError
        If the rule is unknown, "paper" is asked for another layout, `affinity` has another shape, or the image is none.
    """
    found = tuple(detections)
    check_choice(rule, ("robust", "paper"), "rule")
    if rule == "paper":
        if (layout.rows, layout.columns, layout.parity) != (2, 2, False):
            raise InputError("rule: expected the 2×2 layout without parity for the paper's rule")
        return tuple(_array(found, order, layout, "") for order in decode_upright(found))
    seen = _shapes_of(found, affinity)
    responses = np.array([d.response for d in found])
    chosen = suppress_non_maxima(seen.xy, seen.sizes, responses, by_larger=False, like_size=LIKE_SIZE)
    found = tuple(found[i] for i in chosen)
    markers = MarkerShapes(seen.xy[chosen], seen.shapes[chosen], seen.is_measured[chosen], seen.is_round)
    if image is None:
        return _decode(found, markers, layout, image_size, None)
    return _decode_seen(found, markers, layout, as_gray(image))


def _decode_seen(
    found: Sequence[Detection], markers: MarkerShapes, layout: Layout, gray: NDArray[np.uint8]
) -> tuple[MarkerArray, ...]:
    """Return the arrays of an image, with members that the search missed, and pairs that lack a third marker."""
    size, around = (gray.shape[1], gray.shape[0]), set(range(len(found)))
    for _ in range(_ROUNDS):
        arrays = _decode(found, markers, layout, size, gray)
        read = [array.detections for array in arrays if array.code is not None]
        rows = {id(d): k for k, d in enumerate(found)}
        groups = [[rows[id(d)] for d in members] for members in read]
        known = {k for group in groups if are_alike(markers, group, layout.pitch) for k in group}
        kept, added = complete(gray, found, markers, known, around, layout.pitch)
        if not added:
            break
        found, markers = (*(found[k] for k in kept), *added), _joined(markers, kept, _shapes_of(added, None))
        around = set(range(len(kept), len(found)))
    if len(layout.cells) > 3:
        return arrays
    members = {k for lattice in _lattices(markers, layout) for k in lattice.members}
    open_pairs = pairs(markers, members, layout.pitch)
    return (*arrays, *(_array(found, pair, layout, "a marker is covered or missing") for pair in open_pairs))


def _joined(markers: MarkerShapes, kept: list[int], added: MarkerShapes) -> MarkerShapes:
    return MarkerShapes(
        np.concatenate([markers.xy[kept], added.xy]),
        np.concatenate([markers.shapes[kept], added.shapes]),
        np.concatenate([markers.is_measured[kept], added.is_measured]),
        markers.is_round,
    )


def _shapes_of(found: Sequence[Detection], affinity: ArrayLike | None) -> MarkerShapes:
    xy = np.array([d.xy for d in found], dtype=np.float64).reshape(-1, 2)
    shapes = np.array([d.size for d in found], dtype=np.float64).reshape(-1, 1, 1) * np.eye(2)
    if affinity is None:
        unknown = np.full((2, 2), np.nan)
        affinity = np.array([unknown if d.affinity is None else d.affinity for d in found]).reshape(-1, 2, 2)
    measured = np.asarray(affinity, dtype=np.float64)
    if measured.shape != shapes.shape:
        raise InputError(f"affinity: expected {shapes.shape}, got {measured.shape}")
    known = np.isfinite(measured).all(axis=(1, 2)) & (np.linalg.det(np.nan_to_num(measured)) > 1e-6)
    return MarkerShapes(
        xy, np.where(known[:, None, None], measured, shapes), known, any(d.made_for != "surf" for d in found)
    )


@dataclass(frozen=True)
class _Block(Lattice):
    """A lattice, and how the layout is read from it."""

    order: tuple[int, ...]
    """Indices of the markers that are there in reading order; empty where the layout does not fit."""
    blank: Cell
    """The blank corner's cell; the lattice's first where the layout does not fit."""


def _decode(
    found: Sequence[Detection],
    seen: MarkerShapes,
    layout: Layout,
    image_size: tuple[int, int] | None,
    gray: NDArray[np.uint8] | None,
) -> tuple[MarkerArray, ...]:
    everything = [_block(lattice, layout) for lattice in _lattices(seen, layout)]
    arrays = []
    for candidate in everything:
        rivals = [other for other in everything if _is_rival(other, candidate, seen.limits)]
        if candidate.order and not any(_is_better(rival, candidate, seen.limits) for rival in rivals):
            doubt = _rivalry(candidate, rivals) or _doubt(candidate, seen, image_size)
            if not doubt and any(_is_unclear(found[k]) for k in candidate.order):
                doubt = "a marker is unclear"
            if gray is not None and not doubt and not is_blank(gray, seen, candidate, candidate.blank, layout.pitch):
                doubt = "the blank corner is not blank"
            arrays.append(_array(found, candidate.order, layout, doubt))
    return tuple(sorted(arrays, key=lambda a: (a.code is None, a.code or 0, tuple(a.xy))))


def _lattices(seen: MarkerShapes, layout: Layout) -> list[Lattice]:
    return lattices(seen, layout.pitch) if len(seen.xy) > 2 else []


def _is_rival(other: _Block, candidate: _Block, limits: Limits) -> bool:
    """Return whether another lattice claims some of the markers; sheared parts of a larger array do not count."""
    if other is candidate or not other.members & candidate.members:
        return False
    if other.anisotropy >= max(ORIENTATION_MARGIN * candidate.anisotropy, limits.plain_anisotropy):
        return False
    return bool(other.order) or not other.members <= candidate.members


def _is_better(rival: _Block, candidate: _Block, limits: Limits) -> bool:
    """Return whether a rival explains as many markers so much better that the candidate need not be mentioned."""
    least = max(ORIENTATION_MARGIN * rival.anisotropy, limits.plain_anisotropy)
    return candidate.anisotropy > least and len(rival.members) >= len(candidate.members)


def _rivalry(candidate: _Block, rivals: Sequence[_Block]) -> str:
    """Return what rivals say against a candidate; an empty string if nothing."""
    if any(rival.members == candidate.members for rival in rivals):
        return "orientation is ambiguous"
    return "markers fit other blocks as well" if rivals else ""


def _block(lattice: Lattice, layout: Layout) -> _Block:
    """Return how a lattice is read: rotated so that an empty corner is the upper left one and the box fits."""
    columns, rows = lattice.size
    left, top = np.array(list(lattice.cells)).min(axis=0)
    at = {(x - int(left), y - int(top)): index for (x, y), index in lattice.cells.items()}
    back = {(x, y): (x + int(left), y + int(top)) for x in range(columns) for y in range(rows)}
    for _ in range(4):
        if (columns, rows) == (layout.columns, layout.rows) and (0, 0) not in at:
            order = tuple(at[cell] for cell in layout.cells if cell in at)
            return _Block(lattice.cells, lattice.anisotropy, order, back[0, 0])
        # rotate by a quarter clockwise
        at = {(rows - 1 - y, x): index for (x, y), index in at.items()}
        back = {(rows - 1 - y, x): cell for (x, y), cell in back.items()}
        columns, rows = rows, columns
    return _Block(lattice.cells, lattice.anisotropy, (), back[0, 0])


def _doubt(candidate: _Block, seen: MarkerShapes, image_size: tuple[int, int] | None) -> str:
    """Return what speaks against reading a candidate; an empty string if nothing does."""
    if len(candidate.empty) > 1:
        return "a marker is missing"
    if _is_crowded(candidate, seen):
        return "another marker is too near"
    if image_size is not None:
        (corner,), _ = expected(seen, candidate, np.array([candidate.blank], dtype=np.float64))
        if not (np.all(corner > -0.5) and np.all(corner < np.array(image_size) - 0.5)):
            return "the blank corner lies outside the image"
    return ""


def _is_unclear(member: Detection) -> bool:
    """Return whether a marker that was looked for is not seen well enough to be relied on."""
    return member.rank == 0 and member.probability is not None and member.probability < CLEAR


def _is_crowded(candidate: _Block, seen: MarkerShapes) -> bool:
    others = np.setdiff1d(np.arange(len(seen.xy)), list(candidate.members))
    size = np.median(seen.sizes[list(candidate.members)])
    others = others[np.abs(np.log(seen.sizes[others] / size)) <= np.log(LIKE_SIZE)]
    found = positions(seen, candidate)[others]
    cells = np.array([*candidate.cells, candidate.blank])
    return bool((np.linalg.norm(found[:, None] - cells, axis=2) < QUIET_STEPS).any())


def _array(found: Sequence[Detection], order: Sequence[int], layout: Layout, doubt: str) -> MarkerArray:
    members = tuple(found[i] for i in order)
    polarities = [d.polarity for d in members if d.polarity is not None]
    if len(polarities) < len(members):
        doubt = doubt or "a polarity is unknown"
    code = None if doubt else code_of(polarities, layout)
    return MarkerArray(code, doubt or ("" if code is not None else "parity is wrong"), members, layout)
