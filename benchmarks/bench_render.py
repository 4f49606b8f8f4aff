"""Times of the renderers and of pyrender's plain 4×4 supersampling, alternating in one process.

`python benchmarks/bench_render.py` prints medians and ratios (pyrender's time over ours) beside `baseline.json`;
`--update` writes them there.
"""

import argparse
from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
from baseline import Ratios, compare
from peaksim import Scene, load_scene
from peaksim.area.integrate import integrate
from peaksim.camera.camera import Camera, resized
from peaksim.gl import integrate as render_gl
from peaksim.gl import textured
from rich.console import Console
from rich.table import Table

RIVAL = "pyrender 4×4"
BYTES_A_PIXEL = 4 * 8 + 4
"""What no renderer of this kind can avoid: the new texels of a summed-area table, and the level written."""
Work = Callable[[], object]


def works_of(scene: Scene, camera: Camera, pose: np.ndarray) -> dict[str, Work]:
    """Return what is timed."""
    return {
        "exact": lambda: integrate(scene, camera, pose[None]),
        "gl": lambda: render_gl.integrate(scene, camera, pose),
        RIVAL: lambda: textured.draw(scene, camera, pose, 16),
    }


def alternate(works: dict[str, Work], rounds: int) -> dict[str, float]:
    """Return the median seconds of each work, alternating: once to refill caches, then timed."""
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            work()
            start = perf_counter()
            work()
            seconds[name].append(perf_counter() - start)
    return {name: median(values) for name, values in seconds.items()}


def copy_bandwidth() -> float:
    """Return bytes a second that a copy of 200 MB reads and writes."""
    source = np.zeros(25_000_000)
    target = np.zeros_like(source)
    return 2 * source.nbytes / alternate({"copy": lambda: np.copyto(target, source)}, 5)["copy"]


def main() -> None:
    """Measure, print, compare with the baseline."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--update", action="store_true", help="write the ratios to the baseline")
    arguments = parser.parse_args()
    scene, camera, trajectory = load_scene("floor")
    bandwidth, ratios = copy_bandwidth(), Ratios()
    table = Table("", "renderer", "ms", f"of {RIVAL}'s", "share of memory bandwidth")
    for lens in (camera, resized(camera, 640 / camera.width)):
        size = f"{lens.width}×{lens.height}"
        seconds = alternate(works_of(scene, lens, trajectory.at(0.0)), arguments.rounds)
        for name, value in seconds.items():
            share = lens.width * lens.height * BYTES_A_PIXEL / bandwidth / value
            table.add_row(size, name, f"{1e3 * value:.0f}", f"{value / seconds[RIVAL]:.2f}", f"{share:.1%}")
            if name != RIVAL:
                ratios[f"floor {size} | render {name} | {RIVAL}"] = round(seconds[RIVAL] / value, 2)
    console = Console(width=120)
    console.print(table)
    console.print(f"a copy reads and writes {bandwidth / 1e9:.1f} GB/s")
    compare(console, ratios, update=arguments.update)


if __name__ == "__main__":
    main()
