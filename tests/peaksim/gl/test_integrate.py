"""OpenGL's renderer against the exact one, its memory, its errors, and processes side by side."""

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pyrender
import pytest
import trimesh
from peaksim import Camera, Light, Mesh, Quad, Scene, Texture, Trajectory, render
from peaksim.area.integrate import integrate
from peaksim.errors import RendererError, SceneError
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.gl import integrate as render_gl
from peaksim.rendering import MOST_FACES_EXACT

from tests.helpers import needs_gl
from tests.peaksim.area.area_reference import area_integral
from tests.peaksim.area.test_light import LIGHTS, furniture
from tests.peaksim.shapes import plain_texture
from tests.peaksim.views import LENSES, random_view, through
from tests.places import ROOT, SOURCES

pytestmark = needs_gl

POSE = look_at([0, -2.0, 1.5], [0, 0.5, 0])
CAMERA = Camera(width=160, height=120, fx=140.0, fy=140.0, cx=79.5, cy=59.5)
DRAW = (
    "import hashlib; from tests.peaksim.views import random_view; from peaksim.gl.integrate import integrate;"
    "v = random_view(4, 160, 120);"
    "print(hashlib.sha256(integrate(v.scene, v.camera, v.pose).tobytes()).hexdigest())"
)


def chequered_floor() -> Scene:
    chequer = (np.indices((200, 200)) // 20).sum(axis=0) % 2 * 200 + 20
    return Scene((Quad("floor", Texture.from_array(chequer.astype(np.uint8)), (4.0, 4.0), np.eye(4)),))


def differences(scene: Scene, camera: Camera, pose: np.ndarray) -> np.ndarray:
    """Return how far the two renderers' linear grey levels lie apart."""
    return np.abs(render_gl.integrate(scene, camera, pose) - integrate(scene, camera, pose[None]))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


@pytest.mark.parametrize("seed", [0, 7, 11])
def test_it_agrees_with_the_exact_renderer(seed: int) -> None:
    view = random_view(seed, 240, 180)
    assert rms(differences(view.scene, view.camera, view.pose)) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 130))
def test_it_agrees_with_the_exact_renderer_from_thirty_random_poses(seed: int) -> None:
    view = random_view(seed, 240, 180)
    assert rms(differences(view.scene, view.camera, view.pose)) < 0.01


@pytest.mark.parametrize("seed", [2, 9])
def test_it_is_the_area_integral(seed: int) -> None:
    assert_is_area_integral(seed, 32, 64, 48)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_it_is_the_area_integral_from_thirty_random_poses(seed: int) -> None:
    assert_is_area_integral(seed, 64, 160, 120)


def assert_is_area_integral(seed: int, samples: int, width: int, height: int) -> None:
    view = random_view(seed, width, height)
    reference = area_integral(view.scene, view.camera, view.pose, samples)
    image = np.clip(np.rint(render_gl.integrate(view.scene, view.camera, view.pose)), 0, 255)
    assert rms(image - reference) < 0.5
    assert np.quantile(np.abs(image - reference), 0.999) < 3


@pytest.mark.parametrize("lens", LENSES)
def test_it_sees_through_lenses(lens: str) -> None:
    view = through(random_view(5, 160, 120), lens)
    assert rms(differences(view.scene, view.camera, view.pose)) < 0.1


def test_a_fisheye_sees_past_a_half_space() -> None:
    view = random_view(5, 160, 120)
    camera = Camera(160, 120, 45.0, 45.0, 79.5, 59.5, model="fisheye")
    assert rms(differences(view.scene, camera, view.pose)) < 0.1


@pytest.mark.parametrize("name", ["ambient", "directional", "point"])
def test_light_and_shadow_are_those_of_the_exact_renderer(name: str) -> None:
    plainly = furniture(3)
    scene = Scene(plainly.quads, plainly.meshes, LIGHTS[name], background=30.0)
    assert rms(differences(scene, CAMERA, look_at([1.5, -2.0, 1.4], [0, 0, 0.2]))) < 0.05


def test_a_mesh_of_many_small_triangles_is_drawn_as_by_the_exact_renderer() -> None:
    ball = trimesh.creation.icosphere(2, radius=0.5)
    mesh = Mesh("ball", ball.vertices, ball.faces, compose(np.eye(3), [0, 0, 0.5]), (200.0,) * 3)
    scene = Scene(chequered_floor().quads, (mesh,), (Light("directional", 1.0, direction=(0.3, 0.8, -1.0)),))
    assert rms(differences(scene, Camera(16, 12, 12.0, 12.0, 7.5, 5.5), POSE)) < 1


def test_pixels_of_very_many_quads_are_the_mean_of_their_parts() -> None:
    textures = [plain_texture(level) for level in (20, 90, 250)]
    tiles = tuple(
        Quad(f"{i} {j}", textures[(i + 2 * j) % 3], (0.02, 0.02), compose(np.eye(3), [i / 50, j / 50, 0]))
        for i in range(-8, 8)
        for j in range(25)
    )
    camera, pose = Camera(24, 16, 20.0, 20.0, 11.5, 7.5), look_at([0.003, -0.2, 0.12], [0, 0.8, 0])
    gl, exact = render_gl.integrate(Scene(tiles), camera, pose), integrate(Scene(tiles), camera, pose[None])
    assert rms(gl - exact) < 5
    assert abs((gl - exact).mean()) < 0.5


@pytest.mark.parametrize("width_px", [0.5, 0.1, 0.02])
def test_quads_thinner_than_a_sample_are_not_lost(width_px: float) -> None:
    white = plain_texture(255)
    strips = tuple(
        Quad(f"{k}", white, (width_px / 140, 0.5), compose(np.eye(3), [8.11 * k / 140, 0, 0])) for k in range(-9, 9)
    )
    above = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])
    assert differences(Scene(strips, background=0.0), CAMERA, above).max() < 0.01


def test_of_quads_that_lie_on_each_other_the_later_one_is_seen() -> None:
    floor = chequered_floor().quads
    plain = [plain_texture(20 * k) for k in range(1, 9)]
    cards = tuple(
        Quad(f"card{k}", texture, (0.6, 0.6), compose(rotation_about("z", 20 * k), [0.2 * k - 1, 0.1 * k, 0]))
        for k, texture in enumerate(plain)
    )
    assert set(render_gl.touching_groups(Scene(floor + cards))) == {0}
    assert differences(Scene(floor + cards), CAMERA, POSE).max() < 0.1


def test_quads_side_by_side_do_not_touch() -> None:
    white = plain_texture(255)
    positions = [compose(rotation_about("z", 30), rotation_about("z", 30) @ [0.1 * k, 0, 0]) for k in range(5)]
    row = tuple(Quad(f"{k}", white, (0.1, 0.1), position) for k, position in enumerate(positions))
    above = Quad("above", white, (1.0, 1.0), compose(np.eye(3), [0, 0, 0.002]))
    assert set(render_gl.touching_groups(Scene((*row, above)))) == {-1}


def test_it_draws_meshes_where_the_exact_renderer_does() -> None:
    corners = np.array([[-0.3, 0, 0.1], [0.4, 0, 0.1], [0, 0.2, 0.9]])
    mesh = Mesh("sail", corners, np.array([[0, 1, 2]]), color=(30.0, 30.0, 30.0))
    scene = Scene(chequered_floor().quads, (mesh,))
    assert differences(scene, CAMERA, POSE).max() < 0.1
    assert render_gl.integrate(scene, CAMERA, POSE)[59, 79] == 30


def test_a_scene_of_nothing_is_background() -> None:
    assert (render_gl.integrate(Scene(background=77.0), CAMERA, POSE) == 77).all()


def test_auto_takes_opengl_for_many_faces_that_it_can_draw() -> None:
    rolling = replace(CAMERA, row_time_s=1e-4)
    sail = np.array([[-0.3, 2.0, 0.5], [0.3, 2.0, 0.5], [0.0, 2.2, 1.1]])
    few, many = (
        Scene(chequered_floor().quads, (Mesh("sail", sail, np.tile([[0, 1, 2]], (n, 1))),))
        for n in (MOST_FACES_EXACT - 1, MOST_FACES_EXACT)
    )
    trajectory = Trajectory(np.array([-1.0, 1.0]), np.stack([POSE, POSE @ compose(np.eye(3), [0.1, 0, 0])]))
    assert render(few, CAMERA, POSE).renderer == "exact"
    assert render(many, CAMERA, POSE).renderer == "gl"
    assert render(many, rolling, trajectory).renderer == "exact"
    with pytest.raises(SceneError, match='expected "exact" or "auto" for a rolling shutter, got "gl"'):
        render(chequered_floor(), rolling, trajectory, renderer="gl")


def test_an_error_while_drawing_is_told_apart_from_bad_input_and_leaves_a_context_that_works(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = chequered_floor()
    before = render(scene, CAMERA, POSE, renderer="gl").image
    with monkeypatch.context() as broken:
        broken.setattr(pyrender.OffscreenRenderer, "render", Mock(side_effect=RuntimeError("lost")))
        with pytest.raises(RendererError, match="OpenGL failed while drawing: RuntimeError lost"):
            render(scene, CAMERA, POSE @ compose(np.eye(3), [0.3, 0, 0]), renderer="gl")
    # a camera that the failure left behind would still be the one that draws
    assert np.array_equal(render(scene, CAMERA, POSE, renderer="gl").image, before)


def test_two_processes_render_side_by_side_the_same_bytes() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([SOURCES, str(ROOT)])}
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


def test_quads_that_touch_are_found_as_by_comparing_each_with_each() -> None:
    rng = np.random.default_rng(3)
    plain = Texture.from_array(np.full((1, 1), 9, np.uint8))
    quads = tuple(
        Quad(
            str(k),
            plain,
            tuple(rng.choice([0.1, 0.3, 2.0], 2)),
            compose(rotation_about("x", rng.choice([0, 90, 180])), [*rng.uniform(-2, 2, 2), rng.choice([0, 5e-4])]),
        )
        for k in range(60)
    )
    groups = render_gl.touching_groups(Scene(quads))

    def touch(a: Quad, b: Quad) -> bool:
        local = (b.corners_m - a.world_from_quad[:3, 3]) @ a.world_from_quad[:3, :3]
        low, high, reach = local[:, :2].min(axis=0), local[:, :2].max(axis=0), np.array(a.size_m) / 2 - 1e-3
        return bool(np.abs(local[:, 2]).max() <= 1e-3 and (low < reach).all() and (high > -reach).all())

    linked = np.array([[touch(a, b) or touch(b, a) for b in quads] for a in quads]) | np.eye(60, dtype=bool)
    reach = np.linalg.matrix_power(linked.astype(float), 60) > 0
    alone = reach.sum(axis=1) == 1
    assert np.array_equal(groups == -1, alone)
    assert 0 < alone.sum() < 60
    assert np.array_equal((groups[:, None] == groups)[~alone][:, ~alone], reach[~alone][:, ~alone])
