"""Detectability under distortion (paper, Section 4.1), over random phases: measuring points, in any number of workers.

`run` measures points in worker processes and appends each finished one to a journal.
"""

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache, lru_cache
from hashlib import sha256

import numpy as np

from peakmark.detectors import Detector, find_detector
from peakmark.detectors_outcome import Outcome, run_detector
from peakmark.errors import InputError
from peakmark.experiments.detectability_journal import Journal, Row
from peakmark.experiments.detectability_points import Config, Point, points, undistorted
from peakmark.experiments.trials import Reference, Trial, judge, reference_of, summary
from peakmark.experiments.views import Condition, Drawing, draw, photograph

_REFERENCE_TRIALS = 25
_KEPT_DRAWINGS = 128


def measure(point: Point, trials: int, seed: int) -> list[Row]:
    """Return one row a detector: the point's name and figures."""
    found: dict[str, list[Trial]] = {name: [] for name in point.detectors}
    outcomes: dict[str, list[Outcome]] = {name: [] for name in point.detectors}
    references = {name: _reference(point.condition.marker, name, seed) for name in point.detectors}
    for trial in range(trials):
        drawing = _drawing(point.condition.scenery, seed, trial)
        view = photograph(drawing, point.condition, _stream(seed, point.name, trial))
        for name in point.detectors:
            outcome = run_detector(_detector(name), view.image)
            outcomes[name].append(Outcome(outcome.keypoints[:0], outcome.not_finite, outcome.outside, outcome.failure))
            found[name].append(judge(view, outcome, references[name]))
    head = {"experiment": point.experiment, "marker": point.condition.marker, "series": point.series, "x": point.x}
    return [
        {**head, "detector": name, **summary(found[name], outcomes[name], references[name])} for name in point.detectors
    ]


@lru_cache(maxsize=_KEPT_DRAWINGS)
def _drawing(scenery: Condition, seed: int, trial: int) -> Drawing:
    """Return one trial's drawing; points that change the camera alone look at the same ones."""
    return draw(scenery, _stream(seed, repr(scenery), trial))


@cache
def _reference(kind: str, detector_name: str, seed: int) -> Reference | None:
    """Return what a detector gives for the undistorted marker of the paper's size."""
    condition = undistorted(kind)
    trials = []
    for trial in range(_REFERENCE_TRIALS):
        stream = _stream(seed, f"reference/{kind}", trial)
        view = photograph(_drawing(condition, seed, trial), condition, stream)
        trials.append(judge(view, run_detector(_detector(detector_name), view.image), None))
    return reference_of(trials)


@cache
def _detector(name: str) -> Detector:
    return find_detector(name, describe=False)


def _stream(seed: int, name: str, trial: int) -> np.random.Generator:
    """Return the generator of one trial: the same in any worker and any order."""
    key = int.from_bytes(sha256(name.encode()).digest()[:8], "big")
    return np.random.default_rng([seed, key, trial])


def run(
    config: Config,
    journal: Journal,
    workers: int | None = None,
    on_point: Callable[[int, int], None] = lambda done, of: None,
) -> list[Row]:
    """Measure all points that the journal lacks; return all rows in the order of the points.

    `on_point` is called with the numbers of finished and of all points. `workers` is one a core unless given.
    """
    wanted = points(config)
    journal.open()
    missing = together([point for point in wanted if point.name not in journal.rows])
    done = len(wanted) - len(missing)
    on_point(done, len(wanted))
    context = multiprocessing.get_context("spawn")
    count = workers or len(os.sched_getaffinity(0))
    with ProcessPoolExecutor(count, mp_context=context, initializer=_one_thread) as pool:
        trials = 1 if config.is_paper else config.trials
        tasks = {pool.submit(measure, point, trials, config.seed): point for point in missing}
        try:
            for task in as_completed(tasks):
                journal.add(tasks[task].name, task.result())
                done += 1
                on_point(done, len(wanted))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [row for point in wanted for row in journal.rows[point.name]]


def together(wanted: list[Point]) -> list[Point]:
    """Return points in an order in which those that look at the same drawings are neighbours."""
    first: dict[Condition, int] = {}
    for number, point in enumerate(wanted):
        first.setdefault(point.condition.scenery, number)
    return sorted(wanted, key=lambda point: first[point.condition.scenery])


def finished(config: Config, journal: Journal) -> list[Row]:
    """Return the rows of the points that the journal holds, in the order of the points.

    Raises
    ------
    InputError
        If it holds none.
    """
    journal.open()
    rows = [row for point in points(config) for row in journal.rows.get(point.name, ())]
    if not rows:
        raise InputError(f"{journal.path}: expected finished points, found none")
    return rows


def _one_thread() -> None:
    """Leave parallelism to the processes."""
    import cv2

    from peakmark.parallel import set_thread_count

    os.environ["PEAKSIM_THREADS"] = "1"
    cv2.setNumThreads(1)
    set_thread_count(1)
