"""Detectability under distortion (paper, Section 4.1), over random phases: points, in any number of workers."""

from collections.abc import Sequence
from functools import cache, lru_cache, partial
from hashlib import sha256
from pathlib import Path

import numpy as np
from peaksim.threads import processor_count

from peakmark.detectors.outcome import Outcome, run_detector
from peakmark.detectors.registry import Detector, find_detector
from peakmark.errors import InputError
from peakmark.experiments.detectability.conditions import Condition, Drawing, draw_marker, expose_drawing
from peakmark.experiments.detectability.points import DetectabilityConfig, Point, points, undistorted
from peakmark.experiments.detectability.trials import (
    ReferenceResponse,
    Row,
    Trial,
    reference_response,
    score_image,
    summarise_trials,
)
from peakmark.experiments.journal import Journal
from peakmark.experiments.run import OnStep, run_items
from peakmark.plain import from_plain

_REFERENCE_TRIALS = 25
"""Undistorted images whose medians are the reference."""

_VERSION = 3
"""Of what is drawn and measured: a journal of another one is not resumed."""

_KEPT_DRAWINGS = 128
"""Drawings that a process keeps: the default 100 trials of one scenery, 1 MB each."""


def measure_point(point: Point, trials: int, seed: int) -> list[Row]:
    """Return one row a detector: the point's name and figures."""
    found: dict[str, list[Trial]] = {name: [] for name in point.detectors}
    outcomes: dict[str, list[Outcome]] = {name: [] for name in point.detectors}
    references = {name: _reference(point.condition.marker, name, seed) for name in point.detectors}
    for trial in range(trials):
        drawing = _drawing(point.condition.scenery, seed, trial)
        view = expose_drawing(drawing, point.condition, _stream(seed, point.name, trial))
        for name in point.detectors:
            outcome = run_detector(_detector(name), view.image)
            outcomes[name].append(Outcome(outcome.keypoints[:0], outcome.not_finite, outcome.outside, outcome.failure))
            found[name].append(score_image(view, outcome, references[name]))
    return [
        Row(
            experiment=point.experiment,
            marker=point.condition.marker,
            series=point.series,
            x=point.x,
            detector=name,
            found=summarise_trials(found[name], outcomes[name], references[name]),
        )
        for name in point.detectors
    ]


@lru_cache(maxsize=_KEPT_DRAWINGS)
def _drawing(scenery: Condition, seed: int, trial: int) -> Drawing:
    """Return one trial's drawing; points that differ in the camera alone share it."""
    return draw_marker(scenery, _stream(seed, repr(scenery), trial))


@cache
def _reference(kind: str, detector_name: str, seed: int) -> ReferenceResponse | None:
    """Return what a detector gives for the undistorted marker of the paper's size."""
    condition = undistorted(kind)
    trials = []
    for trial in range(_REFERENCE_TRIALS):
        stream = _stream(seed, f"reference/{kind}", trial)
        view = expose_drawing(_drawing(condition, seed, trial), condition, stream)
        trials.append(score_image(view, run_detector(_detector(detector_name), view.image), None))
    return reference_response(trials)


@cache
def _detector(name: str) -> Detector:
    return find_detector(name, describe=False)


def _stream(seed: int, name: str, trial: int) -> np.random.Generator:
    """Return the generator of one trial: the same in any worker and any order."""
    key = int.from_bytes(sha256(name.encode()).digest()[:8], "big")
    return np.random.default_rng([seed, key, trial])


def open_journal(config: DetectabilityConfig, out: str | Path) -> Journal:
    """Open the journal of finished points; what is measured of a point depends on these fields alone."""
    settings = {name: getattr(config, name) for name in ("trials", "seed", "extra", "is_paper")}
    return Journal.open(out, {**settings, "version": _VERSION})


def measure_points(
    config: DetectabilityConfig, journal: Journal, workers: int | None = None, on_point: OnStep = lambda done, of: None
) -> list[Row]:
    """Measure all points that the journal lacks; return all rows in the order of the points.

    `on_point` is called with the numbers of finished and of all points. `workers` is one a core unless given.
    """
    ordered = grouped_by_drawing(points(config))
    trials = 1 if config.is_paper else config.trials
    work = partial(_measured, ordered, trials, config.seed)
    run_items(journal, [point.name for point in ordered], work, workers or processor_count(), on_point)
    return _rows(config, journal)


def _measured(ordered: Sequence[Point], trials: int, seed: int, index: int) -> list[Row]:
    return measure_point(ordered[index], trials, seed)


def _rows(config: DetectabilityConfig, journal: Journal) -> list[Row]:
    plain = (journal.records.get(point.name, ()) for point in points(config))
    return [from_plain(Row, row) for rows in plain for row in rows]


def grouped_by_drawing(listed: Sequence[Point]) -> list[Point]:
    """Return points in an order in which those that share drawings are neighbours."""
    first: dict[Condition, int] = {}
    for number, point in enumerate(listed):
        first.setdefault(point.condition.scenery, number)
    return sorted(listed, key=lambda point: first[point.condition.scenery])


def finished_rows(config: DetectabilityConfig, journal: Journal) -> list[Row]:
    """Return the rows of the points that the journal holds, in the order of the points; none is an `InputError`."""
    rows = _rows(config, journal)
    if not rows:
        raise InputError(f"{journal.path}: expected finished points, found none")
    return rows
