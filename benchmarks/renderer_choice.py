"""Which renderer is quicker for how many faces: `python benchmarks/renderer_choice.py` prints it.

Processor time of one thread, median. What "gl" spends outside OpenGL remains where a GPU draws.
"""

import os

os.environ.update(PEAKSIM_THREADS="1", LP_NUM_THREADS="1")  # before OpenGL is loaded

from dataclasses import replace
from importlib import import_module
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from peaksim.area.faces import count_faces
from peaksim.area.integrate import integrate
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose, look_at
from peaksim.gl.context import gl_renderer
from peaksim.scene.build_meshes import build_meshes
from peaksim.scene.file import load_scene
from peaksim.scene.scene import Scene
from peaksim.scene.schema import BoxTable
from rich.console import Console
from rich.table import Table

BOXES = (0, 10, 30, 50, 80, 120, 160, 240)
"""On the lab's floor; twelve triangles each."""
CAMERAS = (Camera(640, 480, 500, 500, 319.5, 239.5), Camera(2048, 1536, 1600, 1600, 1023.5, 767.5))
POSE = look_at((4.0, 3.0, 2.0), (0.0, 0.0, 0.2))
ROUNDS = 5
gl = import_module("peaksim.gl.integrate")


def furnished(boxes: int) -> Scene:
    """Return the lab's floor with so many boxes on it."""
    rng = np.random.default_rng(0)
    tables = tuple(
        BoxTable(
            name=f"box {k}",
            size_m=tuple(rng.uniform(0.1, 0.5, 3)),
            center_m=(*rng.uniform(-1.5, 1.5, 2), 0.0),
            yaw_deg=float(rng.uniform(0, 360)),
            level=90.0,
        )
        for k in range(boxes)
    )
    return replace(load_scene("floor").scene, meshes=build_meshes(tables, ()))


def times(scene: Scene, camera: Camera, pose: Pose) -> tuple[float, float, float]:
    """Return the milliseconds of "exact", of "gl", and of "gl" outside OpenGL."""
    inside, draw_numbers = [0.0], gl.draw_numbers

    def timed(*arguments: Any) -> Any:
        start = process_time()
        drawn = draw_numbers(*arguments)
        inside[0] += process_time() - start
        return drawn

    gl.draw_numbers = timed
    rows = []
    for _ in range(ROUNDS + 1):
        start = process_time()
        integrate(scene, camera, pose[None])
        middle, inside[0] = process_time(), 0.0
        gl.integrate(scene, camera, pose)
        end = process_time()
        rows.append((middle - start, end - middle, end - middle - inside[0]))
    gl.draw_numbers = draw_numbers
    exact, whole, outside = (1e3 * median(values) for values in zip(*rows[1:], strict=True))
    return exact, whole, outside


def main() -> None:
    """Measure and print."""
    table = Table("camera", "faces", "exact, ms", "gl, ms", "outside OpenGL, ms", "gl/exact", title=gl_renderer())
    for camera in CAMERAS:
        for boxes in BOXES:
            scene = furnished(boxes)
            exact, whole, outside = times(scene, camera, POSE)
            numbers = f"{exact:.0f}", f"{whole:.0f}", f"{outside:.0f}", f"{whole / exact:.2f}"
            table.add_row(f"{camera.width}×{camera.height}", str(count_faces(scene)), *numbers)
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
