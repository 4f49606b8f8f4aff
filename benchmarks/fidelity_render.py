"""Fidelity of the renderers from random poses, against the brute-force integral of the tests: rms, p99.9, seconds.

`PYTHONPATH=. python benchmarks/fidelity_render.py --first 100 --count 30` prints one row a view.
"""

import argparse
from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np
from peaksim.area.integrate import integrate
from peaksim.gl import integrate as render_gl
from peaksim.gl import textured

from tests.peaksim.area.area_reference import area_integral
from tests.peaksim.views import LENSES, random_view, through

PLAIN = 16, 64
"""Samples a pixel of the pyrender renderer."""
NAMES = "exact", "gl", *(f"pyrender {n}" for n in PLAIN)


def figures(draw: Callable[[], np.ndarray], reference: np.ndarray) -> tuple[float, float, float]:
    """Return rms and p99.9 in grey levels after rounding, and the seconds of a second drawing."""
    error = np.abs(np.clip(np.rint(draw()), 0, 255) - reference)
    start = perf_counter()
    draw()
    seconds = perf_counter() - start
    return float(np.sqrt((error**2).mean())), float(np.quantile(error, 0.999)), seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--samples", type=int, default=64, help="per pixel and axis of the reference")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--lenses", action="store_true", help="through six lenses in turn")
    arguments = parser.parse_args()
    rows = []
    for seed in range(arguments.first, arguments.first + arguments.count):
        view = random_view(seed, arguments.width, arguments.width * 3 // 4)
        view = through(view, list(LENSES)[seed % len(LENSES)]) if arguments.lenses else view
        reference = area_integral(view.scene, view.camera, view.pose, arguments.samples)
        exact = figures(lambda v=view: integrate(v.scene, v.camera, v.pose[None]), reference)
        gl = figures(lambda v=view: render_gl.integrate(v.scene, v.camera, v.pose), reference)
        plain = [figures(partial(textured.draw, view.scene, view.camera, view.pose, n), reference) for n in PLAIN]
        rows.append([exact, gl, *plain])
        columns = "  ".join(f"{name} {a:.2f} {b:.1f} {c:.3f}" for name, (a, b, c) in zip(NAMES, rows[-1], strict=True))
        print(f"{view.name:65s} {columns}", flush=True)
    for name, table in zip(NAMES, np.array(rows).swapaxes(0, 1), strict=True):
        good = ((table[:, 0] < 0.5) & (table[:, 1] < 3)).sum()
        print(
            f"{name}: {good} of {len(table)} within rms 0.5 and p99.9 3; median rms {np.median(table[:, 0]):.2f}, "
            f"worst {table[:, 0].max():.2f}; worst p99.9 {table[:, 1].max():.1f}"
        )


if __name__ == "__main__":
    main()
