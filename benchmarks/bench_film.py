"""Frames a second of `identify` on a 1080p film, and how its memory grows: `python benchmarks/bench_film.py`.

The film pans and zooms over a photograph on which eight arrays and sixteen markers hang, with noise, in H.264. Each
number of workers runs in a process of its own; rows and poses must come out the same, byte for byte.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from peakmark.experiments.comparison.prints import drawn
from peakmark.experiments.photographs import load_photograph
from peakmark.report.film import film

SIZE = (1920, 1080)
WALL = (2880, 1620)
PRINT_PX = (150, 110)
"""Sides on the wall of an array's sheet and of a marker's."""

RATE = 30


def wall() -> NDArray[np.uint8]:
    """Return the photograph with the prints on it."""
    canvas = cv2.resize(load_photograph("china.jpg"), WALL, interpolation=cv2.INTER_CUBIC)
    places = [(x, y) for y in (200, 600, 1000, 1400) for x in (250, 700, 1150, 1600, 2050, 2500)]
    order = np.random.default_rng(0).permutation(len(places))
    for number, place in enumerate(order):
        paper = drawn("array", number) if number < 8 else drawn("marker", number % 2)
        side = PRINT_PX[number >= 8]
        x, y = places[place]
        canvas[y : y + side, x : x + side] = cv2.resize(paper, (side, side), interpolation=cv2.INTER_AREA)
    return np.asarray(canvas, dtype=np.uint8)


def make_film(path: Path, seconds: float) -> int:
    """Write the film; return its number of frames."""
    scene, rng, count = wall(), np.random.default_rng(1), round(seconds * RATE)
    with film(path, RATE, SIZE[0]) as append:
        for k in range(count):
            phase = 2 * np.pi * k / 300
            zoom, turn = 1.0 + 0.2 * np.sin(phase), np.radians(8 * np.sin(2 * phase))
            a = zoom * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
            middle = np.array(WALL) / 2 + [300 * np.cos(phase), 150 * np.sin(phase)]
            shift = np.array(SIZE) / 2 - a @ middle
            image = cv2.warpAffine(scene, np.column_stack([a, shift]), SIZE, flags=cv2.INTER_AREA)
            noisy = image + rng.normal(0, 2, image.shape[:2])
            append(np.repeat(np.clip(noisy, 0, 255).astype(np.uint8)[..., None], 3, axis=2))
    return count


def timed(path: Path, workers: int, out: Path) -> tuple[float, float]:
    """Return the seconds that a run took, and its peak memory in MB."""
    command = [sys.executable, "-m", "peakmark.cli", "identify", str(path), "--workers", str(workers), "--quiet"]
    start = perf_counter()
    with subprocess.Popen([*command, "--out", str(out)]) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"identify ended with {process.returncode}")
    return perf_counter() - start, usage.ru_maxrss / 1000


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, nargs="+", default=[5.0, 15.0], help="lengths of the film")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    asked = parser.parse_args()
    table = Table("film", "workers", "frames/s", "peak MB", title="peakmark identify, 1920×1080, start included")
    with tempfile.TemporaryDirectory() as folder:
        for seconds in asked.seconds:
            path = Path(folder) / f"{seconds:g}.mp4"
            frames, written = make_film(path, seconds), set()
            for workers in asked.workers:
                out = Path(folder) / f"{workers}.csv"
                took_s, peak_mb = timed(path, workers, out)
                written.add(out.read_bytes())
                table.add_row(f"{seconds:g} s", str(workers), f"{frames / took_s:.2f}", f"{peak_mb:.0f}")
            if len(written) > 1:
                raise SystemExit("the rows depend on the number of workers")
    Console().print(table)


if __name__ == "__main__":
    main()
