"""OpenGL's renderer against the exact one, its memory, its errors, and processes side by side."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import needs_gl
from peaksim import Camera, Light, Mesh, Quad, Scene, Texture, render, render_gl
from peaksim.area_integral import integrate
from peaksim.errors import RendererError, SceneError
from peaksim.pose import compose, look_at

sys.path.insert(0, str(Path(__file__).parent))
from views import random_view

pytestmark = needs_gl
ROOT = Path(__file__).resolve().parents[2]
POSE = look_at([0, -2.0, 1.5], [0, 0.5, 0])
CAMERA = Camera(width=160, height=120, fx=140.0, fy=140.0, cx=79.5, cy=59.5)
DRAW = (
    "import hashlib; from views import random_view; from peaksim import render_gl; v = random_view(4, 160, 120);"
    "print(hashlib.sha256(render_gl.integrate(v.scene, v.camera, v.pose).tobytes()).hexdigest())"
)


def chequered_floor() -> Scene:
    chequer = (np.indices((200, 200)) // 20).sum(axis=0) % 2 * 200 + 20
    return Scene((Quad("floor", Texture.from_array(chequer.astype(np.uint8)), (4.0, 4.0), np.eye(4)),))


@pytest.mark.parametrize("seed", [0, 7, 11])
def test_it_agrees_with_the_exact_renderer(seed: int) -> None:
    view = random_view(seed, 240, 180)
    difference = render_gl.integrate(view.scene, view.camera, view.pose) - integrate(
        view.scene, view.camera, view.pose[None]
    )
    assert np.sqrt((difference**2).mean()) < 1


def test_it_draws_meshes_where_the_exact_renderer_does() -> None:
    corners = np.array([[-0.3, 0, 0.1], [0.4, 0, 0.1], [0, 0.2, 0.9]])
    mesh = Mesh("sail", corners, np.array([[0, 1, 2]]), color=(30.0, 30.0, 30.0))
    scene = Scene(chequered_floor().quads, (mesh,))
    gl, exact = (render(scene, CAMERA, POSE, renderer=name).linear for name in ("gl", "exact"))
    assert np.sqrt(((gl - exact) ** 2).mean()) < 1
    assert exact[59, 79] == 30


def test_auto_takes_the_exact_renderer_for_what_opengl_cannot_draw() -> None:
    lit = Scene(chequered_floor().quads, lights=(Light("ambient", 0.5),))
    assert render(lit, CAMERA, POSE).renderer == "exact"
    assert render(chequered_floor(), CAMERA, POSE).renderer == "gl"
    with pytest.raises(SceneError, match='expected "exact" or "auto" for lights, got "gl"'):
        render(lit, CAMERA, POSE, renderer="gl")


def test_an_error_while_drawing_is_told_apart_from_bad_input_and_leaves_a_context_that_works(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = chequered_floor()
    before = render(scene, CAMERA, POSE, renderer="gl").image
    with monkeypatch.context() as broken:
        renderer = render_gl._context()[0]
        broken.setattr(renderer._renderer, "render", lambda *_, **__: (_ for _ in ()).throw(RuntimeError("lost")))
        with pytest.raises(RendererError, match="OpenGL failed while drawing: RuntimeError lost"):
            render(scene, CAMERA, POSE, renderer="gl")
    assert np.array_equal(render(scene, CAMERA, POSE, renderer="gl").image, before)
    assert len(render_gl._drawn(scene).camera_nodes) == 0


def test_two_processes_render_side_by_side_the_same_bytes() -> None:
    paths = os.pathsep.join(str(ROOT / p) for p in ("sim", "src", "tests/peaksim"))
    environment = {**os.environ, "PYTHONPATH": paths}
    both = [subprocess.Popen([sys.executable, "-c", DRAW], env=environment, stdout=subprocess.PIPE) for _ in range(2)]
    view = random_view(4, 160, 120)
    own = hashlib.sha256(render_gl.integrate(view.scene, view.camera, view.pose).tobytes()).hexdigest()
    assert [p.communicate(timeout=300)[0].decode().strip() for p in both] == [own, own]


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["exact", "gl"])
def test_two_thousand_frames_need_no_more_memory_than_fifty(renderer: str) -> None:
    scene, camera = chequered_floor(), Camera()
    resident = []
    for k in range(2000):
        frame = render(scene, camera, POSE @ compose(np.eye(3), [1e-4 * k, 0, 0]), renderer=renderer)  # type: ignore[arg-type]
        resident.append(int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6)
    assert frame.image.shape == (480, 640)
    assert max(resident[50:]) - resident[49] < 20
