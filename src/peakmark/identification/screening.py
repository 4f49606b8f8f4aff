"""Which candidates are worth an alignment: boosted trees over how each looks where the pattern correlates best.

An alignment takes a hundred times as long as a correlation, and nine of ten would be of blobs. A few steps of coarse
alignment bring the pattern to within a hundredth of its side of a marker; then the softened levels of its 9 × 9 cells,
and of a ring of cells around them, tell most blobs from markers.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peakmark.identification.alignment import lit_template, template_levels
from peakmark.identification.candidates import MarkerCandidates
from peakmark.identification.stages import STAGE_COLUMNS
from peakmark.identification.trees import Trees, from_plain
from peakmark.markers.patterns import Variant
from peakmark.refine.posture import view_candidates

Values = NDArray[np.float64]

_ORBITS = 15
"""Sets of cells that the symmetries of the square take into each other."""

SCREEN_COLUMNS = (
    *("quotient", "correlation", "better", "side", "moved", "size_ratio", "anisotropy"),
    *("gain_to_noise", "gain", "michelson", "sign", "response"),
    *("template", "non_radial", "beyond_radial", "left", "worst_cell", "one_sided"),
    *("left_right", "up_down", "across", "turned", "part_1", "part_2", "part_3", "part_8"),
    *("ring", "ring_low", "ring_1", "ring_4"),
    *(f"cells_{k + 1}" for k in range(_ORBITS)),
)
"""Of a candidate: quotient, coarse correlation, and that after the steps; logs of the side, and of its ratio to that
after them, distance moved in sides, and anisotropy. Of the light: logs of gain over noise and of gain, Michelson
contrast, sign, and log of the response. Of the cells, a plane taken out and of length 1: correlation with the pattern;
of what is not radial that correlation, and how much it is; what the pattern leaves, the most in a cell, and what has
not the symmetry of the square; differences from mirror images and from the half turn; correlations in eight parts, by
size. Of the ring, over gain: share of white cells, their lower fifth, the lowest and the highest of its four sides. And
the means of the cells that symmetry takes into each other, those of light markers with the other sign."""

BETTER = SCREEN_COLUMNS.index("better")

_LINE = (np.arange(11) - 5) / 9
VIEWED: Values = np.stack(np.meshgrid(_LINE, _LINE), axis=-1).reshape(-1, 2)
"""(121, 2) points of a view, sides from the centre: the middles of the cells, and of those around them."""

_IS_INSIDE = np.abs(VIEWED).max(axis=1) < 0.46
_KNOTS = np.arange(0, 0.6, 0.12)
_STEP, _STIFF = 0.01, np.diag([1e-3] * 2 + [3e-3] * 4)
"""Of differences over the pattern; and what keeps the steps short where the pattern says little."""


@dataclass(frozen=True)
class Gate:
    """What a candidate has to pass."""

    trees: Trees
    """Their sum says how likely an alignment finds a marker."""
    least: float
    """Sum from which a candidate passes."""


@dataclass(frozen=True)
class Screen:
    """When a candidate is aligned, and when its alignment goes on."""

    before: Gate
    """Over `SCREEN_COLUMNS`."""
    after: tuple[Gate, ...]
    """After each of the `stages`, see `gate_columns`."""

    def is_worth(
        self, odds: Values, stage: int, rows: NDArray[np.intp], said: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return (k,) whether rows of candidates pass a stage that said (k, stages, c), given sums (n,) before it."""
        gate = self.after[stage]
        return gate.trees.sums(gate_columns(odds[rows], said)) >= gate.least


def gate_columns(odds: Values, said: NDArray[np.float64]) -> Values:
    """Return (n, c) what the gate behind some stages asks: the sums (n,) of the one before them, and what they said."""
    return np.column_stack([odds, said.reshape(len(odds), said.shape[1] * said.shape[2])])


@cache
def shipped_screen() -> Screen:
    """Return what comes with the package; `scripts/train_screen.py` makes it."""
    plain = json.loads(Path(__file__).with_name("screen.json").read_text(encoding="utf-8"))
    columns = [list(SCREEN_COLUMNS), list(STAGE_COLUMNS)]
    assert [plain["columns"], plain["stage_columns"]] == columns, "screen.json is of other columns: make it anew"
    before, *after = (Gate(from_plain(gate["trees"]), float(gate["least"])) for gate in plain["gates"])
    return Screen(before, tuple(after))


def has_screen(variant: Variant) -> bool:
    """Return whether candidates for a marker are screened: for SURF's of the paper they are."""
    return variant.made_for == "surf" and variant.limit == "energy"


@cache
def slopes_of(variant: Variant) -> Values:
    """Return (6, k) how levels at the template's points, over their product with it, tell a pattern's small offset."""
    samples, template = lit_template(variant)
    length = np.linalg.norm(_centred(template_levels(variant, samples)))
    by_u, by_v = (
        (template_levels(variant, samples + step) - template_levels(variant, samples - step)) / (2 * _STEP * length)
        for step in (np.array([_STEP, 0.0]), np.array([0.0, _STEP]))
    )
    u, v = samples.T
    slopes = np.column_stack([by_u, by_v, by_u * u, by_u * v, by_v * u, by_v * v])
    light = _basis([np.ones(len(u)), u, v, template])
    slopes = slopes - light @ (light.T @ slopes)
    told = np.linalg.solve(slopes.T @ slopes + _STIFF, slopes.T)
    return np.ascontiguousarray(told - (told @ light) @ light.T)


def screen_columns(
    gray: NDArray[np.uint8],
    candidates: MarkerCandidates,
    postures: Values,
    correlations: Values,
    variant: Variant,
    sigma: float,
) -> tuple[Values, Values]:
    """Return (n, len(SCREEN_COLUMNS)) of candidates for a marker, their postures and coarse correlations given.

    And the postures (n, 6) after a few steps of alignment, see `refine.posture`.
    """
    samples, template = lit_template(variant)
    places = (candidates.xy, candidates.sides_px, postures)
    postures, better, views = view_candidates(gray, *places, samples, template, slopes_of(variant), VIEWED)
    levels = views.astype(np.float64)
    shapes = postures[:, 2:]
    areas = np.maximum(np.abs(shapes[:, 0] * shapes[:, 3] - shapes[:, 1] * shapes[:, 2]), 1e-6)
    sides = candidates.sides_px
    of_shape = [
        *(candidates.quotients, correlations, better, np.log(sides)),
        np.hypot(*(postures[:, :2] - candidates.xy).T) / sides,
        np.log(areas) / 2 - np.log(sides),
        (shapes**2).sum(axis=1) / areas,
    ]
    sign = 1.0 if variant.polarity == "dark" else -1.0
    seen = _Cells(levels[:, _IS_INSIDE], _cell_levels(variant))
    gain, offset = seen.gain_and_offset()
    of_light = [
        *(np.log(gain / sigma), np.log(gain), gain / (gain + 2 * np.maximum(offset, 0))),
        *(np.full(len(gain), sign), np.log(candidates.responses)),
    ]
    ring = ((levels - offset[:, None]) / gain[:, None]).reshape(-1, 11, 11)
    columns = [*of_shape, *of_light, *seen.columns(), *_ring_columns(ring), *(sign * seen.symmetric.T)]
    return np.column_stack(columns), postures


@cache
def _cell_levels(variant: Variant) -> Values:
    """Return (81,) softened levels of a marker's cells."""
    return template_levels(variant, VIEWED[_IS_INSIDE])


def _centred(values: Values) -> Values:
    return np.asarray(values - values.mean())


def _basis(columns: list[Values]) -> Values:
    """Return an orthonormal basis (n, k) of columns, of which some may depend on others."""
    left, sizes, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    return np.asarray(left[:, sizes > 1e-6])


def _orbits() -> NDArray[np.intp]:
    """Return (81,) which set of cells each belongs to."""
    away = np.abs(np.indices((9, 9)) - 4).reshape(2, -1)
    _, orbit = np.unique(np.sort(away, axis=0), axis=1, return_inverse=True)
    return np.asarray(orbit).reshape(-1)


_U, _V = VIEWED[_IS_INSIDE].T
_PLANE = _basis([np.ones(81), _U, _V])
_RADIAL = _basis([np.ones(81), _U, _V, *(np.maximum(1 - np.abs(np.hypot(_U, _V) - knot) / 0.12, 0) for knot in _KNOTS)])
_ORBIT = _orbits()
_MEANS = (np.arange(_ORBITS)[:, None] == _ORBIT) / np.bincount(_ORBIT)[:, None]
_PARTS = [
    *(_U > 0.01, _U < -0.01, _V > 0.01, _V < -0.01),
    *((sign_u * _U > -0.01) & (sign_v * _V > -0.01) for sign_u in (1, -1) for sign_v in (1, -1)),
]


class _Cells:
    """Levels (n, 81) of cells, beside the pattern's (81,)."""

    def __init__(self, levels: Values, pattern: Values) -> None:
        self.levels, self.pattern = levels, pattern
        flat, wanted = levels - (levels @ _PLANE) @ _PLANE.T, pattern - _PLANE @ (_PLANE.T @ pattern)
        self.length, self.own_length = np.sqrt((flat**2).sum(axis=1)), float(np.sqrt((wanted**2).sum()))
        self.flat, self.wanted = flat / np.maximum(self.length, 1e-6)[:, None], wanted / self.own_length
        self.correlation = self.flat @ self.wanted
        self.symmetric = self.flat @ _MEANS.T

    def gain_and_offset(self) -> tuple[Values, Values]:
        """Return (n,) contrast of the pattern, at least 1, and level of black."""
        gain = np.maximum(self.correlation * self.length / self.own_length, 1.0)
        return gain, self.levels.mean(axis=1) - gain * self.pattern.mean()

    def columns(self) -> list[Values]:
        """Return what the cells say, from "template" to "part_8"."""
        flat, left = self.flat, self.flat - self.correlation[:, None] * self.wanted
        beyond = flat - (flat @ _RADIAL) @ _RADIAL.T
        pattern = self.wanted - _RADIAL @ (_RADIAL.T @ self.wanted)
        amount = (beyond**2).sum(axis=1)
        cells = flat.reshape(-1, 9, 9)
        mirrored = (cells[:, :, ::-1], cells[:, ::-1], cells.transpose(0, 2, 1), cells[:, ::-1, ::-1])
        parts = np.sort([_correlation(flat[:, part], self.wanted[part]) for part in _PARTS], axis=0)
        return [
            self.correlation,
            beyond @ pattern / np.sqrt(np.maximum(amount, 1e-9) * (pattern**2).sum()),
            *(amount, (left**2).sum(axis=1), np.abs(left).max(axis=1, initial=0)),
            ((flat - self.symmetric[:, _ORBIT]) ** 2).sum(axis=1),
            *(((cells - other) ** 2).sum(axis=(1, 2)) for other in mirrored),
            *(parts[0], parts[1], parts[2], parts[7]),
        ]


def _correlation(values: Values, pattern: Values) -> Values:
    """Return (n,) correlations of values (n, k) with a pattern (k,)."""
    values, pattern = values - values.mean(axis=1, keepdims=True), _centred(pattern)
    return np.asarray(values @ pattern / np.sqrt(np.maximum((values**2).sum(axis=1), 1e-9) * (pattern**2).sum()))


def _ring_columns(ring: Values) -> list[Values]:
    """Return how white the cells beside the pattern are, of all cells (n, 11, 11) over gain."""
    sides = (ring[:, 0, 1:-1], ring[:, -1, 1:-1], ring[:, 1:-1, 0], ring[:, 1:-1, -1])
    means = np.sort([side.mean(axis=1) for side in sides], axis=0)
    cells = np.concatenate([ring[:, 0], ring[:, -1], ring[:, 1:-1, 0], ring[:, 1:-1, -1]], axis=1)
    low = np.partition(cells, 8, axis=1)[:, 8]
    return [(cells > 0.85).mean(axis=1), low, means[0], means[3]]
