"""pyrender on both of its off-screen platforms, each in a process of its own, on machines that need not have X."""

import os
import subprocess
import sys

from tests.helpers import needs_gl
from tests.places import ROOT, SOURCES

DRAW = """
import hashlib, sys
from peaksim.gl.context import gl_renderer
from peaksim.gl.integrate import integrate
from tests.peaksim.views import random_view
view = random_view(4, 160, 120)
print(hashlib.sha256(integrate(view.scene, view.camera, view.pose).tobytes()).hexdigest())
print(sorted(name for name in sys.modules if name.split(".")[0] == "pyglet" or name == "pyrender.viewer"))
"""


def run(code: str, **environment: str) -> list[str]:
    paths = os.pathsep.join([SOURCES, str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": paths, **environment}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@needs_gl
def test_egl_and_osmesa_draw_the_same_and_import_no_window_toolkit() -> None:
    egl, osmesa = (run(DRAW, PYOPENGL_PLATFORM=platform) for platform in ("egl", "osmesa"))
    assert egl == osmesa
    assert egl[1] == "[]"


def test_auto_says_why_opengl_does_not_open() -> None:
    code = """
import numpy as np
from peaksim import Camera, Mesh, Scene, render
mesh = Mesh("much", np.eye(3), [[0, 1, 2]] * 1001)
print(render(Scene((), (mesh,)), Camera(8, 8, 9.0, 9.0, 3.5, 3.5), np.eye(4)).renderer)
"""
    paths = os.pathsep.join([SOURCES, str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": paths, "PYOPENGL_PLATFORM": "none-such"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=300)
    assert done.stdout.split() == ["exact"]
    assert done.stderr.count("peaksim: no OpenGL context opens: ") == 1
    assert "none-such" in done.stderr
    assert done.stderr.strip().endswith("; drawing with the exact renderer, which needs no OpenGL")
