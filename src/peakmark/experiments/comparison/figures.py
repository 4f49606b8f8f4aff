"""Figures of a comparison with 95 % intervals, and who wins by them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from peakmark.experiments.comparison.comparison import Measured
from peakmark.experiments.comparison.frames import SWEEPS, View
from peakmark.experiments.comparison.measure import ReaderOutcome
from peakmark.experiments.comparison.readers import READERS, Reader
from peakmark.score.statistics import quantiles, rate


@dataclass(frozen=True)
class Figure:
    """A figure of a reader."""

    reader: str
    value: float | None
    """None without cases."""
    low: float | None
    high: float | None
    """Ends of the 95 % interval: of shares by Wilson, of quantiles by bootstrap."""
    of: int
    """Cases."""


@dataclass(frozen=True)
class Line:
    """One figure of all readers that have it."""

    set: str
    """Which frames: "clean", "traced", "warped", "bare", "render-tag", "folder"."""
    what: str
    """Key of `WHAT`."""
    quantity: str
    value: float | None
    """Of sweeps: which, and at which value; None pools all frames of the set."""
    readers: tuple[Figure, ...]


@dataclass(frozen=True)
class Topic:
    """A question, every reader's figure, and who wins."""

    name: str
    question: str
    unit: str
    """"%", "px", "‰", "°" or "ms"."""
    larger_is_better: bool
    readers: tuple[Figure, ...]
    best: tuple[str, ...]
    """See `best_of`."""


@dataclass(frozen=True)
class ReaderLine:
    """A reader, what it reads, and of which version."""

    name: str
    design: str
    package: str
    version: str
    has_id: bool


@dataclass(frozen=True)
class ComparisonFigures:
    """All figures of a run: data.json."""

    command: str
    seed: int
    frames: tuple[tuple[str, int], ...]
    """Frames of each set."""
    readers: tuple[ReaderLine, ...]
    lines: tuple[Line, ...]
    topics: tuple[Topic, ...]


WHAT = {
    "recall": "found with the right number",
    "error_p50": "centre's error, median",
    "error_p99": "centre's error, 99 %",
    "false": "frames with a false answer",
    "pose": "frames with a pose",
    "position_p50": "camera's position, median",
    "position_p99": "camera's position, 99 %",
    "rotation_p50": "camera's rotation, median",
    "rotation_p99": "camera's rotation, 99 %",
    "inside": "poses whose truth is in the stated 95 % ellipsoid",
    "cpu_p50": "processor time a frame, median",
}
"""Figures of a set, and what they are called; "inside" should be 95 %."""

UNITS = {"error": "px", "position": "‰", "rotation": "°", "cpu": "ms"}
"""Unit of the figures that begin so; the others are shares."""

Outcomes = Sequence[ReaderOutcome]


def _errors(outcomes: Outcomes) -> list[float]:
    return [error for one in outcomes for error in one.errors_px if error is not None]


_VALUES: dict[str, Callable[[Outcomes], list[float]]] = {
    "error": _errors,
    "position": lambda outcomes: [1e3 * one.pose.position for one in outcomes if one.pose],
    "rotation": lambda outcomes: [one.pose.rotation_deg for one in outcomes if one.pose],
    "cpu": lambda outcomes: [1e3 * one.cpu_s for one in outcomes],
}
_SHARES: dict[str, Callable[[Outcomes], tuple[int, int]]] = {
    "recall": lambda outcomes: (len(_errors(outcomes)), sum(len(one.errors_px) for one in outcomes)),
    "false": lambda outcomes: (sum(one.false > 0 for one in outcomes), len(outcomes)),
    "pose": lambda outcomes: (sum(one.pose is not None for one in outcomes), len(outcomes)),
    "inside": lambda outcomes: (
        sum(bool(one.pose and one.pose.is_inside) for one in outcomes),
        sum(one.pose is not None and one.pose.is_inside is not None for one in outcomes),
    ),
}
_OF_DESIGN = ("recall", "error", "pose", "position", "rotation", "inside")
"""Only frames that show the reader's design count for these."""


def figure_of(what: str, reader: str, outcomes: Outcomes) -> Figure:
    """Return one figure of one reader's outcomes."""
    kind, _, percent = what.partition("_p")
    counted = [one for one in outcomes if one.errors_px] if kind in _OF_DESIGN else list(outcomes)
    if kind in _SHARES:
        share = rate(*_SHARES[kind](counted))
        return Figure(reader, share.value, share.low, share.high, share.of)
    found = quantiles(_VALUES[kind](counted), (int(percent),))
    low, high = found.intervals.get(int(percent), (None, None))
    return Figure(reader, found[int(percent)], low, high, found.of)


def line_of(
    set_name: str, what: str, measured: Iterable[Measured], quantity: str = "", value: float | None = None
) -> Line:
    """Return one figure of all readers that have cases."""
    listed = list(measured)
    figures = [
        figure_of(what, reader.name, _of(reader.name, listed)) for reader in READERS if _has(what, reader, listed)
    ]
    return Line(set_name, what, quantity, value, tuple(figure for figure in figures if figure.value is not None))


def _has(what: str, reader: Reader, measured: Sequence[Measured]) -> bool:
    """Return whether a figure says something of a reader: without numbers, answers are false only where no print is."""
    hangs = any(each.outcome.prints for each in measured)
    return reader.has_id or what not in ("false", "pose") or (what == "false" and not hangs)


def _of(reader: str, measured: Sequence[Measured]) -> list[ReaderOutcome]:
    return [one for each in measured for one in each.outcome.readers if one.reader == reader]


def lines_of(measured: Sequence[Measured]) -> tuple[Line, ...]:
    """Return every figure of each set, and the recall at each value of the sweeps."""
    lines = []
    for name in dict.fromkeys(each.frame.set for each in measured):
        those = [each for each in measured if each.frame.set == name]
        lines += [line_of(name, what, those) for what in WHAT]
    for quantity, values in SWEEPS.items():
        for value in values:
            those = [
                e for e in measured if (e.frame.set, e.frame.quantity, e.frame.value) == ("clean", quantity, value)
            ]
            if those:
                lines.append(line_of("clean", "recall", those, quantity, value))
    return tuple(line for line in lines if line.readers)


# --- who wins -----------------------------------------------------------------------------------------------


LEAST_CASES = 10
"""A figure of fewer says nothing of who wins: the 99 % quantile of two poses is the worse of them."""


def ranked_of(figures: Sequence[Figure]) -> list[Figure]:
    """Return the figures that are compared: of readers with numbers, and of enough cases."""
    unranked = {reader.name for reader in READERS if not reader.has_id}
    return [f for f in figures if f.value is not None and f.of >= LEAST_CASES and f.reader not in unranked]


def best_of(figures: Sequence[Figure], larger_is_better: bool) -> tuple[str, ...]:
    """Return who wins: the best value, and with it all whose interval reaches into that of the best, best first.

    Readers without numbers are not ranked: they answer wherever something looks alike. Nor are figures of fewer than
    `LEAST_CASES`.
    """
    sign = -1.0 if larger_is_better else 1.0
    ranked = sorted(ranked_of(figures), key=lambda f: sign * (f.value or 0.0))
    if not ranked:
        return ()
    first = ranked[0]
    return tuple(f.reader for f in ranked if _reaches(f, first, larger_is_better))


def _reaches(figure: Figure, first: Figure, larger_is_better: bool) -> bool:
    end, start = (figure.high, first.low) if larger_is_better else (first.high, figure.low)
    return figure is first or (end is not None and start is not None and end >= start)


Chosen = Callable[[Measured], bool]


def _hard(quantity: str, is_hard: Callable[[float], bool]) -> Chosen:
    return lambda each: each.frame.set == "clean" and each.frame.quantity == quantity and is_hard(each.frame.value)


def _set(*names: str) -> Chosen:
    return lambda each: each.frame.set in names


_DEFAULT = View()
TOPICS: tuple[tuple[str, str, str, bool, Chosen], ...] = (
    ("small", "found at sides of 10…20 px", "recall", True, _hard("side_px", lambda v: v <= 20)),
    ("tilt", "found at tilts of 60…80°", "recall", True, _hard("tilt_deg", lambda v: v >= 60)),
    ("noise", "found in noise of σ 10…40", "recall", True, _hard("noise", lambda v: v >= 10)),
    ("blur", "found in blur of σ 2…6 px", "recall", True, _hard("blur_px", lambda v: v >= 2)),
    ("shadow", "found under stripes of shadow of 30…85 %", "recall", True, _hard("shadow", lambda v: v > 0)),
    ("dark", "found at a half to an eighth of the light", "recall", True, _hard("exposure", lambda v: v < 1)),
    ("covered", "found with 5…30 % of the width covered", "recall", True, _hard("covered", lambda v: v > 0)),
    ("traced", "found in path-traced frames", "recall", True, _set("traced")),
    ("warped", "found when warped into photographs", "recall", True, _set("warped")),
    ("recipe", "found by render-tag's recipe", "recall", True, _set("render-tag")),
    ("folder", "found in the folder's images", "recall", True, _set("folder")),
    ("false", "photographs without prints with a false answer", "false", False, _set("bare")),
    ("wrong", "frames with other prints, with a false answer", "false", False, _set("clean", "traced", "warped")),
    ("centre", "centre's error, median", "error_p50", False, _set("traced", "warped")),
    ("pose", "frames that tell the camera's pose", "pose", True, _set("traced", "warped")),
    ("position", "camera's position over its distance, median", "position_p50", False, _set("traced", "warped")),
    ("position 99", "camera's position over its distance, 99 %", "position_p99", False, _set("traced", "warped")),
    (
        "one print",
        "camera's position from one print, by render-tag's recipe",
        "position_p50",
        False,
        _set("render-tag"),
    ),
    ("processor", "processor time a VGA frame, median", "cpu_p50", False, _set("clean")),
)
"""Name, question, figure, whether more of it is better, and the frames that count."""


def topics_of(measured: Sequence[Measured]) -> tuple[Topic, ...]:
    """Return the questions that these frames answer."""
    topics = []
    for name, question, what, larger, chosen in TOPICS:
        line = line_of("", what, [each for each in measured if chosen(each)])
        if line.readers:
            unit = UNITS.get(what.partition("_")[0], "%")
            topics.append(Topic(name, question, unit, larger, line.readers, best_of(line.readers, larger)))
    return tuple(topics)


def figures_of(measured: Sequence[Measured], command: str, seed: int) -> ComparisonFigures:
    """Return all figures of a run."""
    names = [each.frame.set for each in measured]
    return ComparisonFigures(
        command,
        seed,
        tuple((name, names.count(name)) for name in dict.fromkeys(names)),
        tuple(ReaderLine(r.name, r.design, r.package, r.version, r.has_id) for r in READERS),
        lines_of(measured),
        topics_of(measured),
    )


def value_at(line: Line, reader: str) -> float:
    """Return a reader's value on a line, nan where it has none."""
    values = [figure.value for figure in line.readers if figure.reader == reader]
    return float(np.nan) if not values or values[0] is None else values[0]
