"""The renderers' times beside pyrender's plain 4×4 supersampling, in turns in one process; share of memory bandwidth.

`python benchmarks/bench_render.py` prints medians, their ratios and what the kernel reads and writes a second.
"""

import argparse
import json
from collections.abc import Callable
from time import perf_counter

import numpy as np
from peaksim import Scene, load_scene, render_gl
from peaksim.area_integral import integrate
from peaksim.camera import Camera, resized

BYTES_A_PIXEL = 4 * 8 + 4
"""What no renderer of this kind can avoid: the new texels of a summed-area table, and the level written."""


def plain_gl(scene: Scene, camera: Camera, pose: np.ndarray) -> np.ndarray:
    """Return pyrender's picture with 4×4 samples in every pixel."""
    drawn = render_gl._drawn(scene)
    out = np.empty((camera.height, camera.width, 1), np.float32)
    for y in range(0, camera.height, 256):
        for x in range(0, camera.width, 512):
            width, height = min(512, camera.width - x), min(256, camera.height - y)
            fine = render_gl._draw(drawn, camera, pose, (x, y, width, height), (4, 4), 1)
            out[y : y + height, x : x + width] = render_gl.box_means(fine, 4, 4)
    return out


def alternate(works: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the median seconds of each work, run in turns."""
    for work in works.values():
        work()
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            start = perf_counter()
            work()
            seconds[name].append(perf_counter() - start)
    return {name: float(np.median(values)) for name, values in seconds.items()}


def copy_bandwidth() -> float:
    """Return bytes a second that a copy of 200 MB reads and writes."""
    source = np.zeros(25_000_000)
    target = np.zeros_like(source)
    return 2 * source.nbytes / alternate({"copy": lambda: np.copyto(target, source)}, 5)["copy"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    scene, camera, trajectory = load_scene("floor")
    pose, result = trajectory.at(0.0), {}
    bandwidth = copy_bandwidth()
    for name, lens in (("2048x1536", camera), ("640x480", resized(camera, 640 / 2048))):
        works: dict[str, Callable[[], object]] = {"exact": lambda c=lens: integrate(scene, c, pose[None])}
        if render_gl.is_available():
            works["pyrender 4x4"] = lambda c=lens: plain_gl(scene, c, pose)
            works["gl"] = lambda c=lens: render_gl.integrate(scene, c, pose)
        seconds = alternate(works, rounds)
        least = lens.width * lens.height * BYTES_A_PIXEL / bandwidth
        result[name] = {
            "seconds": seconds,
            "ratio_to_pyrender_4x4": {n: s / seconds.get("pyrender 4x4", np.nan) for n, s in seconds.items()},
            "share_of_memory_bandwidth": least / seconds["exact"],
        }
    print(json.dumps({"copy_GB_s": bandwidth / 1e9, **result}, indent=2))


if __name__ == "__main__":
    main()
