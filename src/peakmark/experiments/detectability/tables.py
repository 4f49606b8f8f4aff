"""What the rows of the detectability run say: the operating envelope, its map, and the range-limited markers' gains."""

from collections.abc import Callable, Sequence
from itertools import groupby, product

import numpy as np
from numpy.typing import NDArray

from peakmark.experiments.detectability.envelope import COLUMNS, REQUIRED
from peakmark.experiments.detectability.points import MAP_NOISES, MAP_TILTS_DEG, sides_away
from peakmark.experiments.detectability.points import map_series as series_of_map
from peakmark.experiments.detectability.trials import Row
from peakmark.report.page import Table
from peakmark.score.statistics import Rate, wilson

PRESETS = {"surf-dark": "surf-paper", "sift-dark": "sift"}
"""The paper's markers and the detectors that stand for its own."""

CLAIMED = (*PRESETS.items(), ("sift-dark", "vlfeat"))
"""The same, and VLFeat's SIFT, which the paper used, where it was measured."""

DITCH = 0.8
"""A response below this share of the strongest ones on both sides is a ditch; chosen by hand."""


def select(rows: Sequence[Row], experiment: str, marker: str, detector: str, series: str = "") -> list[Row]:
    """Return one curve's rows by rising x."""
    key = (experiment, marker, detector, series)
    found = [row for row in rows if (row.experiment, row.marker, row.detector, row.series) == key]
    return sorted(found, key=lambda row: row.x)


def pairs(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Return the combinations of marker and detector, in order of appearance."""
    return list(dict.fromkeys((row.marker, row.detector) for row in rows))


def passes(row: Row) -> bool:
    """Return whether the detection rate's lower bound reaches 95 %, or the most that so few trials can show."""
    trials, low = row.found.trials, row.found.detected.low
    return low is not None and low >= min(REQUIRED, wilson(trials, trials)[0])


def span(curve: Sequence[Row], is_good: Callable[[Row], bool] = passes) -> tuple[float, float] | None:
    """Return the smallest and largest x that pass; None if none does."""
    good = [row.x for row in curve if is_good(row)]
    return (good[0], good[-1]) if good else None


def ditches(curve: Sequence[Row], is_good: Callable[[Row], bool] = passes) -> list[tuple[float, float]]:
    """Return the runs of x, first and last, that fail between the smallest and the largest x that pass."""
    whole = span(curve, is_good)
    if whole is None:
        return []
    inside = [row for row in curve if whole[0] <= row.x <= whole[1]]
    runs = [list(run) for good, run in groupby(inside, is_good) if not good]
    return [(run[0].x, run[-1].x) for run in runs]


def weak_sizes(curve: Sequence[Row]) -> list[float]:
    """Return the x of local minima of the median response that lie below `DITCH` of the peaks on both sides."""
    heard = [(row.x, row.found.response.median) for row in curve if row.found.response.median]
    values = np.array([median for _, median in heard])
    return [
        heard[k][0]
        for k in range(1, len(heard) - 1)
        if values[k] < DITCH * min(values[:k].max(), values[k + 1 :].max()) and values[k] <= values[k - 1 : k + 2].min()
    ]


def reach(curve: Sequence[Row], rising: bool = True) -> float | None:
    """Return how far along x all conditions pass, from the mild end on; None if the first one fails."""
    best = None
    for row in curve if rising else reversed(curve):
        if not passes(row):
            break
        best = row.x
    return best


def runs_text(runs: Sequence[tuple[float, float]]) -> str:
    """Return runs of x as text, "none" without any."""
    return ", ".join(f"{a:g}" if a == b else f"{a:g}–{b:g}" for a, b in runs) or "none"


def envelope_table(rows: Sequence[Row]) -> Table:
    """Return the operating envelope of every marker and detector: within it, every point `passes`.

    A pair of which no axis was measured has no line, an axis that was measured for no pair no column.
    """
    head = (
        "marker",
        "detector",
        "side (SURF) or σ (SIFT), px",
        "ditches at",
        "tilt up to, °",
        "noise σ up to",
        "defocus radius up to, px",
        "motion up to, px",
        "JPEG quality down to",
        "contrast down to",
        "exposure",
    )
    table = [_envelope_row(rows, *pair) for pair in pairs(rows) if _is_family(*pair)]
    table = [line for line in table if any(value is not None for value in line[2:])]
    measured = [k for k in range(len(head)) if k < 2 or any(line[k] is not None for line in table)]
    return Table([head[k] for k in measured], [[line[k] for k in measured] for line in table])


_FAMILIES = {
    **dict.fromkeys(("surf", "surf-paper", "surf-opencv"), "surf"),
    **dict.fromkeys(("sift", "vlfeat"), "sift"),
}
"""Whose markers a detector is measured on; the user's own on all."""


def _is_family(marker: str, detector: str) -> bool:
    """Return whether a detector is not just a guest on the other family's marker."""
    return detector != "sift-opencv" and marker[:4] == _FAMILIES.get(detector, marker[:4])


def _envelope_row(rows: Sequence[Row], marker: str, detector: str) -> list[str | float | None]:
    scale = select(rows, "scale", marker, detector)
    whole = span(scale)
    light = span(select(rows, "exposure", marker, detector))
    return [
        marker,
        detector,
        None if whole is None else f"{whole[0]:g}–{whole[1]:g}",
        runs_text(ditches(scale)) if whole else None,
        reach(select(rows, "tilt", marker, detector, sides_away(20))),
        *(reach(select(rows, name, marker, detector)) for name in ("noise", "defocus", "motion")),
        reach(select(rows, "jpeg", marker, detector), rising=False),
        reach(select(rows, "contrast", marker, detector, "uniform"), rising=False),
        None if light is None else f"×{light[0]:g}–×{light[1]:g}",
    ]


def envelope_lines(rows: Sequence[Row]) -> list[str]:
    """Return the lines of envelope.csv, head first: the map's rates for the envelope, where it is complete."""
    lines = [",".join(COLUMNS)]
    for (marker, detector), noise in product(pairs(rows), MAP_NOISES):
        found = {t: select(rows, "map", marker, detector, series_of_map(t, noise)) for t in MAP_TILTS_DEG}
        sides = {tuple(row.x for row in curve) for curve in found.values() if curve}
        if len(sides) == 1:
            lines += [
                f"{marker},{detector},{noise:g},{tilt:g},{row.x:g},{_short(row.found.detected)}"
                for tilt, curve in found.items()
                for row in curve
            ]
    return lines


def _short(detected: Rate) -> str:
    return f"{detected.value:.4g},{detected.low:.4g}"


def gains_table(rows: Sequence[Row]) -> Table:
    """Return how much stronger the range-limited markers answer than the energy-limited ones, and what a disc costs."""
    table: list[list[str | float | None]] = []
    for name, grey, binary, detector in (
        ("SURF", "surf-dark", "surf-range-dark", "surf-paper"),
        ("SIFT", "sift-dark", "sift-range-dark", "sift"),
    ):
        for experiment in ("scale", "turn"):
            ratios = gains(rows, experiment, grey, binary, detector)
            if len(ratios):
                table.append([name, f"{binary} over {grey}, {experiment}", *np.percentile(ratios, [0, 50, 100])])
    for text, one, other, detector in (
        ("surf-range-dark over surf-dark, each at its best size", "surf-range-dark", "surf-dark", "surf-paper"),
        ("plain disc over surf-range-dark, each at its best size", "sift-range-dark", "surf-range-dark", "surf-paper"),
        ("plain disc over surf-dark, each at its best size", "sift-range-dark", "surf-dark", "surf-paper"),
        ("surf-range-dark over plain disc, each at its best size", "surf-range-dark", "sift-range-dark", "sift"),
    ):
        ratio = peak_ratio(rows, one, other, detector)
        if ratio is not None:
            table.append([detector[:4].upper(), text, None, ratio, None])
    return Table(("detector", "response of", "least", "median", "most"), table)


def gains(rows: Sequence[Row], experiment: str, grey: str, binary: str, detector: str) -> NDArray[np.float64]:
    """Return the ratios of median responses at the same x, where both markers are detected in every trial."""
    responses, others = (_sure_responses(select(rows, experiment, kind, detector)) for kind in (binary, grey))
    return np.array([response / others[x] for x, response in responses.items() if x in others])


def _sure_responses(curve: Sequence[Row]) -> dict[float, float]:
    """Return x → median response where the marker is detected in every trial."""
    sure = [(row.x, row.found.response.median) for row in curve if row.found.detected.value == 1]
    return {x: median for x, median in sure if median is not None}


def peak_ratio(rows: Sequence[Row], marker: str, other: str, detector: str) -> float | None:
    """Return one marker's greatest median response over all sizes over another's; None if one is never found."""
    best = [
        max((r.found.response.median or 0.0 for r in select(rows, "scale", kind, detector)), default=0.0)
        for kind in (marker, other)
    ]
    return best[0] / best[1] if best[0] and best[1] else None
