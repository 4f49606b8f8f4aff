"""Processor time of each stage of SURF beside that of copying as many bytes as it must touch."""

from collections.abc import Callable
from statistics import median
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peakmark.parallel import bands, map_parallel, thread_count
from peakmark.surf.descriptor import describe_windows, window_side
from peakmark.surf.hessian import find_interest_points, strongest_first
from peakmark.surf.integral import padded_integral
from peakmark.surf.orientation import measure_angles
from peakmark.surf.window import interleave_rows

HAAR_SAMPLES, HAAR_CORNERS = 113, 8


class Stage(NamedTuple):
    """One stage on one image."""

    name: str
    run: Callable[[], object]
    megabytes: float
    """Bytes that must be read or written at least once, 10⁶."""


class StageTime(NamedTuple):
    """A stage's time and that of copying its bytes."""

    name: str
    ms: float
    megabytes: float
    copy_ms: float


def stages(gray: NDArray[np.uint8]) -> list[Stage]:
    """Stages of `detect_and_describe` on this image, in order."""
    pixels = gray.size
    integral = padded_integral(gray)
    records = find_interest_points(integral, gray.shape, 100.0, 4, 3, None)
    order = np.sort(strongest_first(records))
    xy, size = records[order, :2].copy(), records[order, 3].copy()
    angle = measure_angles(integral, gray.shape, xy, size)
    window_bytes = float((2.0 * window_side(size).astype(np.float64) ** 2).sum())
    haar_bytes = 4.0 * HAAR_SAMPLES * HAAR_CORNERS * len(xy)
    return [
        Stage("integral image", lambda: padded_integral(gray), 5e-6 * pixels),
        Stage(
            "responses and maxima",
            lambda: find_interest_points(integral, gray.shape, 100.0, 4, 3, None),
            4e-6 * sum(pixels / 2**octave for octave in range(4)),
        ),
        Stage("order", lambda: strongest_first(records), 2 * 4e-6 * records.size),
        Stage("orientations", lambda: measure_angles(integral, gray.shape, xy, size), 1e-6 * haar_bytes),
        Stage("pixel pairs", lambda: interleave_rows(gray), 3e-6 * pixels),
        Stage(
            "descriptors",
            lambda: describe_windows(gray, xy, size, angle, False, False),
            1e-6 * (window_bytes + 4 * 64 * len(xy)),
        ),
    ]


def time_stages(gray: NDArray[np.uint8], rounds: int) -> list[StageTime]:
    """Medians over rounds of each stage and a copy of its bytes, alternating; "descriptors" includes the pairs."""
    times = []
    for stage in stages(gray):
        source = np.ones(int(stage.megabytes * 1e6 / 2), dtype=np.uint8)  # a copy reads and writes
        target = np.ones_like(source)
        pairs = [(_seconds(stage.run), _seconds(lambda s=source, t=target: _copy(s, t))) for _ in range(rounds)]
        ours, copies = (1e3 * median(column) for column in zip(*pairs, strict=True))
        times.append(StageTime(stage.name, ours, stage.megabytes, copies))
    return times


def _copy(source: NDArray[np.uint8], target: NDArray[np.uint8]) -> None:
    """Copy with as many threads as the stages use."""
    cuts = [slice(*cut) for cut in bands(len(source), thread_count())]
    map_parallel(lambda cut: np.copyto(target[cut], source[cut]), cuts)


def _seconds(run: Callable[[], object]) -> float:
    start = process_time()
    run()
    return process_time() - start
