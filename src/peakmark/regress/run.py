"""Running a suite: render each frame or read it, run the detector on it, and score the answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from peakmark.regress.detector import DetectorSettings, FrameDetector, open_detector
from peakmark.regress.detector_protocol import DetectorFailure
from peakmark.regress.frame import ScoredFrame, score_answer, score_failure
from peakmark.regress.record import Record
from peakmark.regress.suite import Suite
from peakmark.score.wanted import Wanted

MOST_FAILURES = 5
"""Frames in a row without an answer after which a run stops: enough for a few unlucky frames, few enough that a
detector that never answers ends within five time limits."""

_CHUNK = 10  # frames that share a started detector: its start is then a tenth of a frame's cost

IMAGE_NAME = "{:08d}.jpg"
"""Name of a frame's image, kept for people to look at."""


@dataclass(frozen=True)
class Task:
    """What a run does with each frame; plain values, so that any process can do it."""

    suite: Suite
    """Whose frames."""
    detector: DetectorSettings
    """What is tested."""
    frames: tuple[int, ...]
    """Indices."""
    seed: int
    """Of the sensor noise."""
    images: Path | None
    """Folder for the frames as JPEG, None to keep none."""


@dataclass(frozen=True)
class SuiteFrame:
    """A frame as the detector gets it."""

    image: NDArray[np.uint8]
    """(H, W)."""
    truth: tuple[MarkerTruth, ...]
    """Of its markers."""
    renderer: str
    """Which drew it."""


@dataclass(frozen=True)
class TimedFrame:
    """One frame's result, and what it cost."""

    result: ScoredFrame
    """What is compared."""
    renderer: str
    """Which drew the image."""
    render_s: float
    """To render or read it."""
    detect_s: float
    """To detect and score."""


@dataclass(frozen=True)
class Run:
    """A finished run."""

    record: Record
    """What is compared."""
    render_s: float
    """Mean seconds a frame to render or read."""
    detect_s: float
    """Mean seconds a frame to detect and score."""


def run_suite(
    suite: Suite,
    detector: DetectorSettings,
    quick: bool = False,
    seed: int | None = None,
    backend: Backend | None = None,
    images: Path | None = None,
    on_frames: Callable[[int], None] = lambda count: None,
) -> Run:
    """Run a suite.

    Parameters
    ----------
    suite, detector
        Whose frames, and what is tested on them.
    quick
        Some of the frames, in even steps.
    seed
        Of the sensor noise, instead of the suite's; views and scenes stay.
    backend
        Where; by default in this process.
    images
        Folder for the frames as JPEG.
    on_frames
        Called with the number of frames finished.

    Raises
    ------
    InputError
        If the suite contradicts itself, or the detector cannot be started or gives no answer `MOST_FAILURES` times in a
        row.
    """
    table = suite.table
    if seed is not None and not 0 <= seed < 2**63:
        raise InputError(f"--seed: expected 0…2⁶³−1, got {seed}")
    if suite.corpus is None:
        check_spec(table.corpus, suite.folder)
    elif seed is not None:
        raise InputError(f"--seed {seed}: expected none for frames that are read from a corpus")
    task = Task(suite, detector, suite.frames(quick), table.corpus.seed if seed is None else seed, images)
    done: list[TimedFrame] = []
    for part in (backend or in_process()).run(partial(measure_chunk, task), range(-(-len(task.frames) // _CHUNK))):
        done += part
        on_frames(len(part))
    done.sort(key=lambda one: one.result.frame)
    results = tuple(one.result for one in done)
    if any(result.false_xy is not None for result in results):
        results = tuple(map(_without_doubt, results))
    record = Record(
        suite=table.name,
        suite_sha256=suite.sha256,
        detector=detector,
        seed=task.seed,
        renderer=done[0].renderer,
        versions=versions(done[0].renderer),
        tolerances=dict(table.tolerances),
        results=results,
    )
    return Run(record, float(np.mean([one.render_s for one in done])), float(np.mean([one.detect_s for one in done])))


def _without_doubt(result: ScoredFrame) -> ScoredFrame:
    """Return the result of a detector that says what it takes for a marker: an empty list is "none" there."""
    is_none = result.false_xy is None and result.failure is None and result.features == 0
    return replace(result, false_xy=()) if is_none else result


def measure_chunk(task: Task, chunk: int) -> list[TimedFrame]:
    """Measure some of a task's frames, with a detector started for them."""
    done: list[TimedFrame] = []
    with open_detector(task.detector) as detector:
        for frame in task.frames[chunk * _CHUNK : (chunk + 1) * _CHUNK]:
            done.append(measure_frame(task, detector, frame))
            _stop_without_answers(task, [one.result for one in done])
    return done


def _stop_without_answers(task: Task, results: Sequence[ScoredFrame]) -> None:
    last = results[-MOST_FAILURES:]
    if len(last) == MOST_FAILURES and all(result.failure for result in last):
        raise InputError(
            f"detector {task.detector.name}: expected answers, got none on {MOST_FAILURES} frames in a row: "
            f"{last[-1].failure}"
        )


def measure_frame(task: Task, detector: FrameDetector, frame: int) -> TimedFrame:
    """Render or read a frame, run the detector on it, and score what it found."""
    table = task.suite.table
    wanted = Wanted(min_side_px=table.min_side_px, kinds=table.kinds)
    start = perf_counter()
    view = load_frame(task.suite, frame, task.seed)
    loaded = perf_counter()
    digest = sha256(view.image.tobytes()).hexdigest()[:16]
    try:
        result = score_answer(frame, digest, view.truth, detector(view.image), wanted, table.tolerance_px)
    except DetectorFailure as failure:
        result = score_failure(frame, digest, view.truth, str(failure), wanted)
    timed = TimedFrame(result, view.renderer, loaded - start, perf_counter() - loaded)
    if task.images is not None:
        Image.fromarray(view.image).save(task.images / IMAGE_NAME.format(frame), quality=85)
    return timed


def load_frame(suite: Suite, frame: int, seed: int) -> SuiteFrame:
    """Return a frame of a suite: rendered with a seed of the noise, or read."""
    if suite.corpus is not None:
        corpus = open_corpus(suite.corpus)
        record = corpus.record(frame)
        truth = tuple(marker_truth(marker) for marker in record["markers"])
        return SuiteFrame(as_gray(corpus.picture(frame)), truth, str(record["renderer"]))
    plan = replace(plan_frame(suite.table.corpus, suite.folder, frame), seed=seed)
    rendered = render_frame(plan, suite.table.corpus.renderer)
    return SuiteFrame(as_gray(rendered.image), rendered.truth, rendered.renderer)


def marker_truth(marker: dict[str, Any]) -> MarkerTruth:
    """Return a marker of a corpus's record as the truth that the renderer gave."""
    points = np.array([[np.nan if value is None else value for value in xy] for xy in marker["points_xy"]])
    side_px = np.nan if marker["side_px"] is None else marker["side_px"]
    names = ("name", "kind", "distance_m", "tilt_deg", "visible_fraction")
    rest = {name: marker[name] for name in names}
    return MarkerTruth(center_xy=points[0], corners_xy=points[1:], side_px=side_px, **rest)
