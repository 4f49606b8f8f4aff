"""Running a suite: render each frame or read it, put it to the finder, and score the answer."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.frame import MarkerTruth
from peaksim.corpus.backends import Backend, in_process
from peaksim.corpus.check_spec import check_spec
from peaksim.corpus.configuration import versions
from peaksim.corpus.plan import plan_frame
from peaksim.corpus.read import open_corpus
from peaksim.corpus.sample import render_frame
from PIL import Image

from peakmark.errors import InputError
from peakmark.keypoints.image import as_gray
from peakmark.regress.detector import Finder, FinderSettings, open_finder
from peakmark.regress.detector_protocol import FinderFailure
from peakmark.regress.frame import FrameResult, failed, result_of
from peakmark.regress.record import Record
from peakmark.regress.suite import Suite
from peakmark.score.wanted import Wanted

MOST_FAILURES = 5
"""Frames in a row without an answer after which a run stops."""

_CHUNK = 10  # frames that share a started finder

PICTURE = "{:08d}.jpg"
"""Name of a frame's picture, for people to look at."""


@dataclass(frozen=True)
class Task:
    """What a run does with each frame; plain values, so that any process can."""

    suite: Suite
    """Whose frames."""
    finder: FinderSettings
    """What is tested."""
    frames: tuple[int, ...]
    """Indices."""
    seed: int
    """Of the sensor noise."""
    pictures: Path | None
    """Folder for the frames as JPEG, None to keep none."""


@dataclass(frozen=True)
class View:
    """A frame as it is put to the finder."""

    image: NDArray[np.uint8]
    """(H, W)."""
    truth: tuple[MarkerTruth, ...]
    """Of its markers."""
    renderer: str
    """Which drew it."""


@dataclass(frozen=True)
class Done:
    """One frame's result, and what it cost."""

    result: FrameResult
    renderer: str
    render_s: float
    find_s: float


@dataclass(frozen=True)
class Run:
    """A finished run."""

    record: Record
    """What is compared."""
    render_s: float
    """Mean seconds a frame to render or read."""
    find_s: float
    """Mean seconds a frame to find."""


def run_suite(
    suite: Suite,
    finder: FinderSettings,
    *,
    quick: bool = False,
    seed: int | None = None,
    backend: Backend | None = None,
    pictures: Path | None = None,
    on_frames: Callable[[int], None] = lambda count: None,
) -> Run:
    """Run a suite.

    Parameters
    ----------
    suite, finder
        Whose frames, and what is tested on them.
    quick
        Some of the frames, in even steps.
    seed
        Of the sensor noise, instead of the suite's; views and scenes stay.
    backend
        Where; by default in this process.
    pictures
        Folder for the frames as JPEG.
    on_frames
        Called with the number of frames finished.

    Raises
    ------
    InputError
        If the suite contradicts itself, or the finder cannot be started or gives no answer `MOST_FAILURES` times in a
        row.
    """
    table = suite.table
    if suite.corpus is None:
        check_spec(table.corpus, suite.folder)
    elif seed is not None:
        raise InputError(f"--seed {seed}: expected none for frames that are read from a corpus")
    task = Task(suite, finder, suite.frames(quick), table.corpus.seed if seed is None else seed, pictures)
    done: list[Done] = []
    for part in (backend or in_process()).run(partial(run_chunk, task), range(-(-len(task.frames) // _CHUNK))):
        done += part
        on_frames(len(part))
    done.sort(key=lambda one: one.result.frame)
    record = Record(
        suite=table.name,
        suite_sha256=suite.sha256,
        detector={name: value for name, value in asdict(finder).items() if name != "time_limit_s"},
        seed=task.seed,
        renderer=done[0].renderer,
        versions=versions(done[0].renderer),
        tolerances=dict(table.tolerances),
        results=tuple(one.result for one in done),
    )
    return Run(record, float(np.mean([one.render_s for one in done])), float(np.mean([one.find_s for one in done])))


def run_chunk(task: Task, chunk: int) -> list[Done]:
    """Do some of a task's frames, with a finder started for them."""
    done: list[Done] = []
    with open_finder(task.finder) as finder:
        for frame in task.frames[chunk * _CHUNK : (chunk + 1) * _CHUNK]:
            done.append(run_frame(task, finder, frame))
            _stop_if_hopeless(task, [one.result for one in done])
    return done


def _stop_if_hopeless(task: Task, results: Sequence[FrameResult]) -> None:
    last = results[-MOST_FAILURES:]
    if len(last) == MOST_FAILURES and all(result.failure for result in last):
        raise InputError(
            f"detector {task.finder.name}: expected answers, got none on {MOST_FAILURES} frames in a row: "
            f"{last[-1].failure}"
        )


def run_frame(task: Task, finder: Finder, frame: int) -> Done:
    """Render or read a frame, find, score."""
    table = task.suite.table
    wanted = Wanted(min_side_px=table.min_side_px, kinds=table.kinds)
    start = perf_counter()
    view = see(task.suite, frame, task.seed)
    seen = perf_counter()
    picture = sha256(view.image.tobytes()).hexdigest()[:16]
    try:
        result = result_of(frame, picture, view.truth, finder(view.image), wanted, table.tolerance_px)
    except FinderFailure as failure:
        result = failed(frame, picture, view.truth, str(failure), wanted)
    done = Done(result, view.renderer, seen - start, perf_counter() - seen)
    if task.pictures is not None:
        _save(task.pictures / PICTURE.format(frame), view.image)
    return done


def see(suite: Suite, frame: int, seed: int) -> View:
    """Return a frame of a suite: rendered with a seed of the noise, or read."""
    if suite.corpus is not None:
        corpus = open_corpus(suite.corpus)
        record = corpus.record(frame)
        truth = tuple(marker_truth(marker) for marker in record["markers"])
        return View(as_gray(corpus.picture(frame)), truth, str(record["renderer"]))
    plan = replace(plan_frame(suite.table.corpus, suite.folder, frame), seed=seed)
    rendered = render_frame(plan, suite.table.corpus.renderer)
    return View(as_gray(rendered.image), rendered.truth, rendered.renderer)


def marker_truth(marker: dict[str, Any]) -> MarkerTruth:
    """Return a marker of a corpus's record as the truth that the renderer gave."""
    points = np.array([[np.nan if value is None else value for value in xy] for xy in marker["points_xy"]])
    side_px = np.nan if marker["side_px"] is None else marker["side_px"]
    names = ("name", "kind", "distance_m", "tilt_deg", "visible_fraction")
    rest = {name: marker[name] for name in names}
    return MarkerTruth(center_xy=points[0], corners_xy=points[1:], side_px=side_px, **rest)


def _save(path: Path, image: NDArray[np.uint8]) -> None:
    Image.fromarray(image).save(path, quality=85)
