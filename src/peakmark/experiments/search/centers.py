"""How exact refined centres and sizes are, and whether their covariance says so, by kind, size, tilt and noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from peakmark.errors import InputError
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.experiments.search.center_views import CenterView, render_view
from peakmark.identification.general import detect_markers
from peakmark.refine.api import VARIANTS, refine

KINDS = ("sift-dark", "sift-light", "sift-range-dark", "sift-range-light")
SIDES_PX = (20.0, 28.0, 40.0, 60.0, 100.0, 140.0, 200.0)
TILTS_DEG = (0.0, 15.0, 30.0, 45.0, 60.0)
NOISES = (0.0, 1.0, 2.0, 4.0, 8.0)

_CELLS = tuple(product(KINDS, SIDES_PX, TILTS_DEG))

_AWAY, _OFF = 0.014, 0.15
"""Deviation of the position that a fit starts from, sides an axis, and how far its size is off at most."""


@dataclass(frozen=True)
class CentersConfig:
    """How much."""

    views: int = 10
    """Of each kind, size and tilt, each with every noise."""
    seed: int = 0
    """Of views, noise and starts."""

    def __post_init__(self) -> None:
        if not 1 <= self.views <= 100_000 or self.seed < 0:
            raise InputError(f"expected --views 1…100000 and --seed 0 or more, got {self.views} and {self.seed}")


@dataclass(frozen=True)
class Estimate:
    """What an alignment says of one marker."""

    error_px: float
    """Distance of the centre from the true one, over √2: the error an axis."""
    nearer_px: float
    """The same of the nearer of the two places where a disc's centre may be; else the same."""
    square: float
    """Squared error of the centre over its covariance: 2 on average where that is right."""
    side_off: float
    """Error of the side, share of the true one."""


Start = tuple[NDArray[np.float64], float]


@dataclass(frozen=True)
class Way:
    """A call that tells where a marker is."""

    estimate: Callable[[CenterView, NDArray[np.uint8], str, Start], Estimate | None]
    """From a view, its image, the marker's kind, and a start; None where nothing was found."""
    noises: tuple[float, ...]
    """That it is measured at."""


def _refined(
    view: CenterView, gray: NDArray[np.uint8], kind: str, start: Start, is_focal_told: bool
) -> Estimate | None:
    fit = refine(gray, start[0][None], start[1], kind, focal_px=view.focal_px if is_focal_told else None)
    if not fit.converged[0]:
        return None
    return _estimate(view, fit.xy[0], fit.aside[0], fit.covariance[0, :2, :2], float(fit.side_px[0]))


def _identified(view: CenterView, gray: NDArray[np.uint8], kind: str, start: Start) -> Estimate | None:
    found = detect_markers(gray, (VARIANTS[kind],), (VARIANTS[kind].made_for,), view.focal_px)
    near = [one for one in found if np.linalg.norm(one.xy - view.center_xy) < 0.1 * view.side_px]
    if not near:
        return None
    aside = np.zeros(2) if near[0].aside is None else near[0].aside
    assert near[0].covariance is not None
    return _estimate(view, near[0].xy, aside, near[0].covariance, near[0].size)


def _estimate(
    view: CenterView,
    xy: NDArray[np.float64],
    aside: NDArray[np.float64],
    covariance: NDArray[np.float64],
    side_px: float,
) -> Estimate:
    error = xy - view.center_xy
    nearer = min(float(np.linalg.norm(error + sign * aside)) for sign in (-1, 1))
    square = float(error @ np.linalg.solve(covariance, error))
    return Estimate(float(np.linalg.norm(error)) / np.sqrt(2), nearer / np.sqrt(2), square, side_px / view.side_px - 1)


WAYS: Mapping[str, Way] = {
    "refine, focal length told": Way(partial(_refined, is_focal_told=True), NOISES),
    "refine, focal length guessed": Way(partial(_refined, is_focal_told=False), NOISES),
    "identify, focal length told": Way(_identified, (0.0, 2.0)),
}


def measure_centers(
    config: CentersConfig, journal: Journal, workers: int = 1, on_step: OnStep = lambda done, of: None
) -> list[dict[str, Any]]:
    """Return a row of each kind, way and noise: rms of centres, mean normalised square and its 95 % band, sides."""
    names = [f"{kind} {side:g} px {tilt:g}°" for kind, side, tilt in _CELLS]
    records = run_items(journal, names, partial(_record, config), workers, on_step)
    rows = []
    for kind, (name, way) in product(KINDS, WAYS.items()):
        own = [record[name] for cell, record in zip(_CELLS, records, strict=True) if cell[0] == kind]
        rows += [_row(kind, name, sigma, [each[f"{sigma:g}"] for each in own]) for sigma in way.noises]
    return rows


def _record(config: CentersConfig, index: int) -> dict[str, Any]:
    """Return by way and noise the estimates of one cell, None where there is none."""
    kind, side, tilt = _CELLS[index]
    rng = np.random.default_rng((config.seed, index))
    found: dict[str, Any] = {name: {f"{sigma:g}": [] for sigma in way.noises} for name, way in WAYS.items()}
    for _ in range(config.views):
        view = render_view(rng, VARIANTS[kind], side, tilt)
        for sigma in NOISES:
            gray = view.noisy(rng, sigma)
            start = view.center_xy + _AWAY * side * rng.standard_normal(2), side * rng.uniform(1 - _OFF, 1 + _OFF)
            for name, way in WAYS.items():
                if sigma in way.noises:
                    one = way.estimate(view, gray, kind, start)
                    found[name][f"{sigma:g}"].append(None if one is None else asdict(one))
    return found


def _row(kind: str, way: str, sigma: float, cells: Sequence[Sequence[Mapping[str, float] | None]]) -> dict[str, Any]:
    """Return the figures of the estimates of all sizes and tilts."""
    found = [[one for one in cell if one is not None] for cell in cells]
    squares = _column(found, "square")
    low, high = scipy.stats.chi2.ppf([0.025, 0.975], 2 * max(len(squares), 1)) / max(len(squares), 1)
    return {
        "kind": kind,
        "way": way,
        "noise": sigma,
        "views": sum(len(cell) for cell in cells),
        "found": len(squares),
        "rms_px": _rms(_column(found, "error_px")),
        "largest_cell_rms_px": max(_rms(_column([cell], "error_px")) for cell in found if cell),
        "nearer_rms_px": _rms(_column(found, "nearer_px")),
        "largest_cell_nearer_rms_px": max(_rms(_column([cell], "nearer_px")) for cell in found if cell),
        "mean_square": float(squares.mean()),
        "band": [float(low), float(high)],
        "median_square": float(np.median(squares)),
        "side_off_rms": _rms(_column(found, "side_off")),
        "largest_cell_side_off": max(abs(float(_column([cell], "side_off").mean())) for cell in found if cell),
    }


def _column(cells: Sequence[Sequence[Mapping[str, float]]], name: str) -> NDArray[np.float64]:
    return np.array([one[name] for cell in cells for one in cell])


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt((values**2).mean()))
