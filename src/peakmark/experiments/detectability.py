"""Detectability under distortion (paper, Section 4.1), over random phases: conditions, detectors, and the run.

A *point* is one condition and the detectors that look at it; `run` measures points in worker processes and appends
each finished one to a file, so that an interrupted run goes on where it was.
"""

import json
import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from peakmark.detectors import Detector, Outcome, detector
from peakmark.detectors import run as run_detector
from peakmark.errors import InputError
from peakmark.experiments.trials import Reference, Trial, judge, reference_of, summary
from peakmark.experiments.views import SIFT_SIDES, Condition, look

SURF_SIDE_PX = 147.0
"""Side of the SURF marker where it is not the axis (the paper's)."""

SIFT_SIGMA_PX = 15.0
"""σ of the SIFT marker where it is not the axis (the paper's)."""

SURF_KINDS = ("surf-dark", "surf-range-dark")
SIFT_KINDS = ("sift-dark", "sift-range-dark")

_REFERENCE_TRIALS = 25


@dataclass(frozen=True)
class Config:
    """How much to measure."""

    trials: int = 100
    """Random phases and turns a point."""
    every: int = 1
    """Take each n-th value of every axis; 1 takes all."""
    seed: int = 0
    """A point's stream derives from (seed, its name, the trial)."""
    extra: tuple[str, ...] = ()
    """Further detectors by name, such as "vlfeat" or "module:function", that look at every point."""
    only: tuple[str, ...] = ()
    """Experiments to run, by name; none is all."""
    is_paper: bool = False
    """One centred view a point, as the paper's figures have it, instead of random ones."""

    def __post_init__(self) -> None:
        for name, value, low in (("trials", self.trials, 1), ("every", self.every, 1), ("seed", self.seed, 0)):
            if value < low:
                raise InputError(f"--{name}: expected {low} or more, got {value}")
        for name in self.only:
            if name not in EXPERIMENTS:
                raise InputError(f"--only: expected some of {', '.join(EXPERIMENTS)}, got {name!r}")
        for name in self.extra:
            detector(name)


@dataclass(frozen=True)
class Point:
    """One condition and who looks at it."""

    experiment: str
    """Name in `EXPERIMENTS`."""
    x: float
    """Position on the experiment's axis."""
    condition: Condition
    """What is seen."""
    detectors: tuple[str, ...]
    """Names of detectors."""
    series: str = ""
    """What tells this point's curve from others of the same marker, such as "2 sides away"."""

    @property
    def name(self) -> str:
        """Unique among the points of a run; the random stream derives from it."""
        return f"{self.experiment}/{self.condition.marker}/{self.series}/{self.x:g}"


def points(config: Config) -> list[Point]:
    """Return all points of a configuration, experiment by experiment."""
    chosen = [point for name in (config.only or EXPERIMENTS) for point in EXPERIMENTS[name](config.every)]
    return [
        replace(
            point,
            detectors=(*point.detectors, *config.extra),
            condition=replace(point.condition, is_centred=config.is_paper),
        )
        for point in chosen
    ]


def _markers() -> Iterator[tuple[Condition, tuple[str, ...]]]:
    """Yield every marker's undistorted condition and its detectors."""
    for kind in SURF_KINDS:
        yield Condition(kind, SURF_SIDE_PX), ("surf-paper", "surf")
    for kind in SIFT_KINDS:
        yield Condition(kind, SIFT_SIGMA_PX * SIFT_SIDES, image_px=301), ("sift-precise",)


def _along(
    experiment: str, field_name: str, values: "np.ndarray[Any, Any]", series: str = "", **fixed: Any
) -> list[Point]:
    """Return the points of all markers along one field of the condition."""
    return [
        Point(experiment, float(x), replace(condition, **fixed, **{field_name: x.item()}), detectors, series)
        for condition, detectors in _markers()
        for x in values
    ]


def _scale(every: int) -> list[Point]:
    """SURF sides 8…260 px, SIFT σ 1…60 px; the other family's detector looks on too."""
    sides = np.unique(np.rint(np.geomspace(8, 260, 60)))[::every]
    sigmas = np.round(np.geomspace(1, 60, 30), 2)[::every]
    surf_names, sift_names = ("surf-paper", "surf", "sift-precise"), ("sift", "sift-precise", "surf-paper")
    surf = [
        Point("scale", float(s), Condition(kind, float(s), _room(s)), surf_names)
        for kind in (*SURF_KINDS, "surf-light")
        for s in sides
    ]
    return surf + [
        Point("scale", float(s), Condition(kind, SIFT_SIDES * s, _room(SIFT_SIDES * s)), sift_names)
        for kind in SIFT_KINDS
        for s in sigmas
    ]


def _room(side_px: float) -> int:
    """Return an odd picture side that holds a marker and the filters next to its size."""
    return max(129, int(1.4 * side_px) + 24) | 1


def _tilt(every: int) -> list[Point]:
    angles = np.arange(0, 81, 5)[::every]
    return [
        point
        for distance in (1.0, 2.0, 5.0, 20.0)
        for point in _along("tilt", "tilt_deg", angles, f"{distance:g} sides away", distance_sides=distance)
    ]


def _contrast(every: int) -> list[Point]:
    values = np.array([1, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02])[::every]
    return [
        point
        for background in ("uniform", "gravel")
        for point in _along("contrast", "contrast", values, background, background=background)
    ]


_AXES: dict[str, tuple[str, Any, dict[str, Any]]] = {
    "turn": ("turn_deg", np.arange(0, 181, 10), {}),
    "noise": ("noise", np.arange(0, 101, 10), {}),
    "defocus": ("defocus_px", np.array([0, 2, 4, 6, 9, 12, 16, 20, 25, 30, 40]), {}),
    "motion": ("motion_px", np.array([0, 5, 10, 15, 20, 30, 40, 50, 60, 80]), {}),
    "jpeg": ("jpeg_quality", np.array([100, 90, 75, 50, 30, 20, 10, 5, 2]), {}),
    "vignetting": ("vignetting", np.linspace(0, 0.9, 7), {"off_axis_px": 60.0}),
    "exposure": ("exposure", np.array([0.05, 0.1, 0.2, 0.4, 0.7, 1, 1.4, 2, 3, 4]), {}),
}
"""Experiments along one field of the condition: the field, its values, what else is set."""


def _axis(name: str, every: int) -> list[Point]:
    field_name, values, fixed = _AXES[name]
    return _along(name, field_name, values[::every], **fixed)


EXPERIMENTS: dict[str, Callable[[int], list[Point]]] = {
    "scale": _scale,
    "tilt": _tilt,
    "contrast": _contrast,
    **{name: partial(_axis, name) for name in _AXES},
}
"""The experiments by name; each gives its points, of every n-th value."""


def measure(point: Point, trials: int, seed: int) -> list[dict[str, Any]]:
    """Return one row a detector: the point's name and figures."""
    found: dict[str, list[Trial]] = {name: [] for name in point.detectors}
    outcomes: dict[str, list[Outcome]] = {name: [] for name in point.detectors}
    references = {name: _reference(point.condition.marker, name, seed) for name in point.detectors}
    for trial in range(trials):
        view = look(point.condition, _stream(seed, point.name, trial))
        for name in point.detectors:
            outcome = run_detector(_detector(name), view.image)
            outcomes[name].append(Outcome(outcome.keypoints[:0], outcome.not_finite, outcome.outside, outcome.failure))
            found[name].append(judge(view, outcome, references[name]))
    head = {"experiment": point.experiment, "marker": point.condition.marker, "series": point.series, "x": point.x}
    return [
        {**head, "detector": name, **summary(found[name], outcomes[name], references[name])} for name in point.detectors
    ]


@cache
def _reference(kind: str, detector_name: str, seed: int) -> Reference | None:
    """Return what a detector gives for the undistorted marker of the paper's size."""
    side = SURF_SIDE_PX if kind.startswith("surf") else SIFT_SIGMA_PX * SIFT_SIDES
    condition = Condition(kind, side, image_px=301)
    views = [look(condition, _stream(seed, f"reference/{kind}", trial)) for trial in range(_REFERENCE_TRIALS)]
    return reference_of([judge(view, run_detector(_detector(detector_name), view.image), None) for view in views])


@cache
def _detector(name: str) -> Detector:
    return detector(name)


def _stream(seed: int, name: str, trial: int) -> np.random.Generator:
    """Return the generator of one trial: the same in any worker and any order."""
    key = int.from_bytes(sha256(name.encode()).digest()[:8], "big")
    return np.random.default_rng([seed, key, trial])


@dataclass
class Journal:
    """Finished points on disk, one JSON line each, after a first line that holds the configuration."""

    path: Path
    """points.jsonl."""
    config: Config
    """What the points were measured with."""
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    """Point name → its rows."""

    def open(self) -> None:
        """Read what an earlier run left; begin anew if there is nothing.

        Raises
        ------
        InputError
            If the file is of another configuration.
        """
        kept = ("trials", "seed", "extra", "is_paper")
        head = json.dumps({name: value for name, value in asdict(self.config).items() if name in kept})
        if not self.path.exists():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(head + "\n", encoding="utf-8")
            return
        first, *lines = self.path.read_text(encoding="utf-8").splitlines() or [""]
        if first != head:
            raise InputError(f"{self.path}: expected a run of {head}, found one of {first}; give another --out")
        for line in lines:
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue  # a run that was killed while writing leaves half a line
            self.rows[entry["point"]] = entry["rows"]

    def add(self, name: str, rows: list[dict[str, Any]]) -> None:
        """Keep one finished point."""
        self.rows[name] = rows
        with self.path.open("a", encoding="utf-8") as file:
            file.write("\n" * _ends_amid_a_line(self.path) + json.dumps({"point": name, "rows": rows}) + "\n")


def _ends_amid_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def run(
    config: Config,
    journal: Journal,
    workers: int | None = None,
    on_point: Callable[[int, int], None] = lambda done, of: None,
) -> list[dict[str, Any]]:
    """Measure all points that the journal lacks; return all rows in the order of the points.

    `on_point` is called with the numbers of finished and of all points.
    """
    wanted = points(config)
    journal.open()
    missing = [point for point in wanted if point.name not in journal.rows]
    done = len(wanted) - len(missing)
    on_point(done, len(wanted))
    context = multiprocessing.get_context("spawn")
    count = workers or len(os.sched_getaffinity(0))
    with ProcessPoolExecutor(count, mp_context=context, initializer=_one_thread) as pool:
        tasks = {
            pool.submit(measure, point, 1 if config.is_paper else config.trials, config.seed): point
            for point in missing
        }
        try:
            for task in as_completed(tasks):
                journal.add(tasks[task].name, task.result())
                done += 1
                on_point(done, len(wanted))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [row for point in wanted for row in journal.rows[point.name]]


def _one_thread() -> None:
    """Leave parallelism to the processes."""
    import cv2

    from peakmark.parallel import set_thread_count

    cv2.setNumThreads(1)
    set_thread_count(1)
