"""OpenGL's own textures through pyrender, against the area integral."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from peaksim import Camera, Light, Mesh, Quad, Scene, Trajectory, render
from peaksim.camera.camera import resized
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at
from peaksim.gl.context import is_available
from peaksim.scene.skin import Skin

from tests.peaksim.scene.test_bend import VIEWS, bent
from tests.peaksim.shapes import BOX_FACES, BOX_M, plain_quad
from tests.peaksim.views import LENSES, random_view, through

pytestmark = pytest.mark.skipif(not is_available(), reason="no OpenGL")

CAMERA = Camera(80, 60, 85.0, 85.0, 39.5, 29.5)


def rms_beside_exact(scene: Scene, camera: Camera, pose: np.ndarray, samples: int = 64) -> float:
    drawn, exact = (render(scene, camera, pose, name, samples=samples).linear for name in ("pyrender", "exact"))
    return float(np.sqrt(((drawn - exact) ** 2).mean()))


@pytest.mark.parametrize(("seed", "lens"), [(0, None), (3, None), (3, "brown5"), (7, "fisheye")])
def test_images_come_nearer_to_the_integral_with_more_samples(seed: int, lens: str | None) -> None:
    view = random_view(seed, 96, 72)
    view = view if lens is None else through(view, lens)
    few, many = (rms_beside_exact(view.scene, view.camera, view.pose, samples) for samples in (4, 144))
    assert many < 2.5
    assert many < 0.5 * few


@pytest.mark.parametrize("view", VIEWS)
def test_bent_paper_is_drawn_from_both_sides(view: tuple) -> None:
    radius_m, axis, lens, eye_m = view
    camera = CAMERA if lens == "pinhole" else resized(LENSES[lens], CAMERA.width / LENSES[lens].width)
    assert rms_beside_exact(Scene((bent(radius_m, axis),)), camera, look_at(eye_m, (0.02, 0, 0.03)), 256) < 0.5


def test_meshes_show_images_and_colours() -> None:
    rng = np.random.default_rng(1)
    (texture,) = {quad.texture for quad in (bent(0.1, "y"),)}
    uv, colors = rng.uniform(0, 1, (12, 3, 2)), rng.uniform(0, 255, (12, 3, 3))
    pose = look_at((0.9, -1.6, 1.1), (0, 0, 0))
    camera = replace(CAMERA, fx=100.0, fy=100.0)
    for skin in (Skin((texture,), uv=uv), Skin(colors=colors), Skin((texture,), np.arange(12) % 2 - 1, uv, colors)):
        mesh = Mesh("m", BOX_M, BOX_FACES, skin=skin)
        assert rms_beside_exact(Scene((), (mesh,), background=30.0), camera, pose, 256) < 1.0
    plain = Mesh("m", BOX_M, BOX_FACES, color=(10, 200, 90))
    assert rms_beside_exact(Scene((), (plain,)), camera, pose, 256) < 0.5


def test_of_quads_in_one_plane_the_later_one_is_seen() -> None:
    quads = (plain_quad("a", 50, 1.0, np.eye(4)), plain_quad("b", 200, 0.5, np.eye(4)))
    drawn = render(Scene(quads, background=0.0), CAMERA, look_at((0, 0, 2), (0, 0, 0), up=(0, 1, 0)), "pyrender").linear
    assert drawn[29:31, 39:41].tolist() == [[200, 200], [200, 200]]
    assert drawn[29, 22] == 50


def test_an_image_repeats_itself_and_an_empty_scene_is_background() -> None:
    view = random_view(2, 64, 48)
    first, second = (render(view.scene, view.camera, view.pose, "pyrender").linear for _ in range(2))
    render(Scene(background=40.0), CAMERA, np.eye(4), "gl")
    assert np.array_equal(first, second)
    assert (render(Scene(background=40.0), CAMERA, np.eye(4), "pyrender").linear == 40).all()


def test_numbers_of_faces_are_drawn_as_before_afterwards() -> None:
    view = random_view(4, 64, 48)
    before = render(view.scene, view.camera, view.pose, "gl").linear
    render(view.scene, view.camera, view.pose, "pyrender")
    assert np.array_equal(render(view.scene, view.camera, view.pose, "gl").linear, before)


def test_a_textured_file_looks_as_in_the_exact_renderer(tmp_path: Path) -> None:
    trimesh.creation.icosphere(2, 0.5).export(tmp_path / "ball.ply")
    mesh = Mesh.from_file(tmp_path / "ball.ply")
    assert rms_beside_exact(Scene((), (mesh,), background=10.0), CAMERA, look_at((0, -2, 0.5), (0, 0, 0)), 256) < 1


def test_what_it_cannot_draw_is_said_or_refused(capfd: pytest.CaptureFixture[str]) -> None:
    scene = Scene((plain_quad("a", 50, 1.0, np.eye(4)),), lights=(Light("ambient", 0.3),))
    pose = look_at((0, 0, 2), (0, 0, 0), up=(0, 1, 0))
    assert render(scene, CAMERA, pose, "pyrender").linear[30, 40] == 50
    said = 'peaksim: the pyrender renderer leaves out light and shadow; renderer "traced" draws them\n'
    assert capfd.readouterr().err in (said, "")  # once a process
    rolling = replace(CAMERA, row_time_s=1e-3)
    path = Trajectory(np.array([0.0, 1.0]), np.stack([pose, pose @ compose(np.eye(3), [0.1, 0, 0])]))
    with pytest.raises(SceneError, match='rolling shutter, got "pyrender"'):
        render(scene, rolling, path, "pyrender")
    for samples in (0, 1025):
        with pytest.raises(SceneError, match="samples: expected"):
            render(scene, CAMERA, pose, "pyrender", samples=samples)


def test_motion_blur_is_the_mean_of_moments() -> None:
    quad, pose = bent(0.1, "y"), look_at((0.1, -0.3, 0.15), (0.02, 0, 0.03))
    path = Trajectory(np.array([0.0, 1.0]), np.stack([pose, pose @ compose(np.eye(3), [0.1, 0, 0])]))
    camera = replace(CAMERA, exposure_s=0.1)
    drawn, exact = (render(Scene((quad,)), camera, path, name, time_s=0.5).linear for name in ("pyrender", "exact"))
    assert np.sqrt(((drawn - exact) ** 2).mean()) < 0.5
    assert isinstance(quad, Quad)
