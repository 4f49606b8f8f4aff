"""The jobs of `bench_gate.py`, by public names alone: prints JSON, job → least processor seconds of a few runs."""

import json
import sys
from collections.abc import Callable
from time import process_time

import numpy as np
from peaksim import load_scene, render
from peaksim.camera.camera import resized

import peakmark
from peakmark import surf
from peakmark.markers.patterns import surf_marker

RUNS = 3


def main() -> None:
    """Run each job once without counting, then `RUNS` times."""
    scene, camera, trajectory = load_scene("floor")
    small, pose = resized(camera, 640 / camera.width), trajectory.at(0.0)
    frame = np.asarray(render(scene, small, pose, "exact").image)
    wall = np.full((480, 640), 200, np.uint8)
    for k in range(60):
        row, column = divmod(k, 10)
        wall[20 + 76 * row : 56 + 76 * row, 20 + 62 * column : 56 + 62 * column] = surf_marker(36)
    jobs: dict[str, Callable[[], object]] = {
        "identify, floor 640×480": lambda: peakmark.identify(frame),
        "identify, 60 markers": lambda: peakmark.identify(wall),
        "surf.detect_and_describe": lambda: surf.detect_and_describe(frame),
        "render exact, floor 640×480": lambda: render(scene, small, pose, "exact"),
    }
    json.dump({name: least(job) for name, job in jobs.items()}, sys.stdout)


def least(job: Callable[[], object]) -> float:
    """Return the least time of some runs: what else the machine does only adds."""
    job()
    times = []
    for _ in range(RUNS):
        start = process_time()
        job()
        times.append(process_time() - start)
    return min(times)


if __name__ == "__main__":
    main()
