"""Speed and memory of SURF against OpenCV's and mahotas's: `make bench`.

Every figure is a ratio, their time over ours, of medians of runs that alternate in one process: processor time and wall
time, on as many threads as `PEAKMARK_THREADS` says. Ratios of processor time are compared with `baseline.json`;
`--update` writes them there. OpenCV's own SURF takes part where cv2 was built with it.
"""

import argparse
import subprocess
import sys
import tempfile
from itertools import chain
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import cv2
import numpy as np
from baseline import Ratios, compare
from images import Image, benchmark_images
from rich.console import Console
from rich.table import Table
from rivals import ROWS, Job, jobs
from stages import time_stages

from peakmark.detectors.registry import has_opencv_surf
from peakmark.parallel import thread_count

TARGETS = {"detect": 8.0, "detect + describe": 8.0, "strongest 200": 60.0}
"""Least ratio to OpenCV's SURF on the floor."""
CLOCKS = {"processor time": process_time, "wall time": perf_counter}
Times = dict[str, dict[str, list[float]]]
"""Row → library → seconds of each run."""


def main() -> None:
    """Measure, print, compare with the baseline."""
    arguments = parse()
    console = Console(width=120)
    cv2.setNumThreads(thread_count())
    ratios: Ratios = {}
    for name, gray in benchmark_images().items():
        if arguments.only not in name:
            continue
        clocks = measure(jobs(gray), arguments.seconds)
        processor = ratios_of(clocks["processor time"])
        ratios |= {f"{name} | {row} | {library}": value for (row, library), value in processor.items()}
        for clock, times in clocks.items():
            console.print(speed_table(f"{name}, {thread_count()} threads: median ms of {clock}, (× ours)", times))
        console.print(stage_table(name, gray))
        console.print(memory_line(name, gray))
    compare(console, ratios, update=arguments.update)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="per table row, all libraries together")
    parser.add_argument("--only", default="", help="images whose names hold this")
    parser.add_argument("--update", action="store_true", help="write the ratios to the baseline")
    return parser.parse_args()


def measure(every: dict[str, dict[str, Job]], seconds: float) -> dict[str, Times]:
    """Clock → row → library → seconds of each run; a row's libraries alternate, ours before each of theirs."""
    clocks: dict[str, Times] = {clock: {} for clock in CLOCKS}
    for row, libraries in every.items():
        runs = alternate(libraries, seconds)
        for index, clock in enumerate(CLOCKS):
            clocks[clock][row] = {library: [run[index] for run in measured] for library, measured in runs.items()}
    return clocks


def alternate(libraries: dict[str, Job], seconds: float) -> dict[str, list[tuple[float, ...]]]:
    """Run all alternately until the time is up, three times at least, after one run that does not count."""
    times: dict[str, list[tuple[float, ...]]] = {library: [] for library in libraries}
    order = list(chain.from_iterable(("peakmark", library) for library in libraries if library != "peakmark"))
    for library in libraries:
        libraries[library]()
    end = perf_counter() + seconds
    while perf_counter() < end or min(map(len, times.values())) < 3:
        for library in order:
            starts = [clock() for clock in CLOCKS.values()]
            libraries[library]()
            times[library].append(tuple(clock() - start for clock, start in zip(CLOCKS.values(), starts, strict=True)))
    return times


def ratios_of(times: Times) -> dict[tuple[str, str], float]:
    """(row, library) → median of its time over the median of ours."""
    return {
        (row, library): round(median(runs) / median(libraries["peakmark"]), 2)
        for row, libraries in times.items()
        for library, runs in libraries.items()
        if library != "peakmark"
    }


def speed_table(title: str, times: Times) -> Table:
    """Milliseconds, and how often ours fits into theirs."""
    libraries = [library for library in times[ROWS[0]] if library != "peakmark"]
    table = Table(title=title, title_justify="left")
    for column in ("", "peakmark", *libraries, "target"):
        table.add_column(column, justify="right")
    ratios = ratios_of(times)
    for row, runs in times.items():
        cells = [f"{1e3 * median(runs[library]):.1f} (×{ratios[row, library]:.2f})" for library in libraries]
        table.add_row(row, f"{1e3 * median(runs['peakmark']):.1f}", *cells, f"×{TARGETS[row]:g} opencv SURF")
    return table


def stage_table(name: str, gray: Image) -> Table:
    """Where our time goes, beside what memory bandwidth would allow."""
    table = Table(title=f"{name}: stages", title_justify="left")
    for column in ("", "ms", "MB to touch", "ms to copy as many", "×"):
        table.add_column(column, justify="right")
    for stage in time_stages(gray, rounds=7):
        times = stage.ms / stage.copy_ms
        table.add_row(stage.name, f"{stage.ms:.2f}", f"{stage.megabytes:.1f}", f"{stage.copy_ms:.2f}", f"{times:.1f}")
    return table


def memory_line(name: str, gray: Image) -> str:
    """Peak memory of ours and OpenCV's, each in its own process."""
    libraries = ["peakmark", "opencv"] if has_opencv_surf() else ["peakmark"]
    peaks = {library: peak_memory(library, gray) for library in libraries}
    said = [f"{library} {loaded:.0f} MB ({call:.0f} MB of it by the call)" for library, (loaded, call) in peaks.items()]
    return f"{name}: peak memory above the interpreter and the image: {', '.join(said)}\n"


def peak_memory(library: str, gray: Image) -> tuple[float, float]:
    """MB with and without the libraries that were loaded, see `peak_memory.py`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.npy"
        np.save(path, gray)
        script = str(Path(__file__).with_name("peak_memory.py"))
        run = subprocess.run([sys.executable, script, library, str(path)], capture_output=True, text=True, check=True)
    loaded, call = map(float, run.stdout.split())
    return loaded, call


if __name__ == "__main__":
    main()
