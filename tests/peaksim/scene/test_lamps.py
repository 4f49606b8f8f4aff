"""Lamps and surroundings: their values, their scene files, and what is said where they are left out."""

from pathlib import Path

import numpy as np
import pytest
from peaksim import Camera, Light, Quad, Scene, Texture, load_scene, render
from peaksim.camera.thin_lens import ThinLens, from_f_number
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import compose
from peaksim.rendering import Renderer
from peaksim.scene.lamps import WINDOW_RADIANCE, AreaLight, Environment, window
from peaksim.scene.material import Material
from PIL import Image

from tests.helpers import needs_gl

CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)
ABOVE = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])
WHITE = Texture.from_array(np.full((1, 1), 255, np.uint8))
FILE = """
[camera]
width = 64
height = 48
focal_mm = 5.0
sensor_width_mm = 6.0
focus_m = 1.5
f_number = 2.0
[[trajectory]]
eye_m = [0, -2, 1]
target_m = [0, 0, 0]
[materials.paper]
reflectance = [0.05, 0.85]
curve = "srgb"
[materials.laminate]
kind = "plastic"
roughness = 0.2
[textures.wall]
level = 200
material = "paper"
[room]
min_m = [-3, -3, 0]
max_m = [3, 3, 3]
walls = "wall"
[[markers]]
name = "a"
kind = "surf-dark"
side_m = 0.3
center_m = [0, 0, 0]
material = "laminate"
[[marker_paths]]
name = "p"
kind = "surf-dark"
count = 3
side_m = 0.1
waypoints_m = [[1, 0], [1, 1]]
material = "paper"
[[posters]]
name = "sheet"
rows = ["D"]
side_m = 0.1
pitch_m = 0.1
center_m = [0, 2.9, 1]
normal = [0, -1, 0]
material = "laminate"
[[boxes]]
name = "box"
size_m = [0.2, 0.2, 0.2]
center_m = [1, -1, 0]
material = "paper"
[[tables]]
name = "desk"
size_m = [1, 1, 1]
center_m = [-1, -1, 0]
material = "laminate"
[[lights]]
kind = "area"
center_m = [0, 0, 2.5]
size_m = [1, 0.5]
radiance = 5
[[lights]]
kind = "environment"
file = "sky.png"
curve = "linear"
radiance = 3
yaw_deg = 30
[[lights]]
kind = "window"
center_m = [0, 3, 2]
size_m = [1, 1]
normal = [0, -1, 0]
[[lights]]
kind = "ambient"
intensity = 1
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a scene file and its sky."""
    Image.fromarray(np.array([[0, 255], [51, 102]], np.uint8)).save(tmp_path / "sky.png")
    (tmp_path / "scene.toml").write_text(FILE)
    return tmp_path


def test_a_scene_file_states_lights_materials_and_a_lens(folder: Path) -> None:
    scene, camera, _ = load_scene(folder / "scene.toml")
    lamp, sky, pane, ambient = scene.lights
    assert isinstance(lamp, AreaLight)
    assert (lamp.radiance, lamp.normal) == (5.0, (0.0, 0.0, -1.0))
    assert isinstance(sky, Environment)
    assert sky.image == pytest.approx(np.array([[0, 1], [0.2, 0.4]]), abs=1e-6)
    assert (sky.radiance, sky.yaw_deg) == (3.0, 30.0)
    assert isinstance(pane, AreaLight)
    assert pane.radiance == WINDOW_RADIANCE == window((0, 3, 2), (1, 1), (0, -1, 0)).radiance
    assert isinstance(ambient, Light)
    assert camera.thin_lens == ThinLens(1.5, 0.0025) == from_f_number(1.5, 5.0, 2.0)
    paper, laminate = Material(reflectance=(0.05, 0.85), curve="srgb"), Material("plastic", roughness=0.2)
    made = {thing.name: thing.material for thing in (*scene.quads, *scene.meshes)}
    assert {name for name, material in made.items() if material == laminate} == {"a", "sheet", "desk"}
    assert {name for name, material in made.items() if material == paper} == set(made) - {"a", "sheet", "desk"}


@pytest.mark.parametrize(
    ("was", "becomes", "message"),
    [
        ("radiance = 5\n", "", r"lights\[0\].area: expected radiance"),
        ("normal = [0, -1, 0]\n[[lights]]", "[[lights]]", r"lights\[2\].window: expected normal"),
        ("radiance = 5", "radiance = -5", r"lights\[0\].area.radiance: .*greater than or equal to 0"),
        ("radiance = 5", "intensity = 5", r"lights\[0\].area.intensity: unknown field$"),
        ("size_m = [1, 0.5]", "size_m = [0, 1]", r"lights\[0\].area.size_m\[0\]: .*greater than 0"),
        ('file = "sky.png"', 'file = "scene.toml"', r"lights\[1\].file: .*expected an image"),
        ('file = "sky.png"', 'file = "none.png"', r"lights\[1\].file: expected a file"),
        ('kind = "ambient"', 'kind = "neon"', r"lights\[3\]: .*'area', 'window', 'environment'"),
        ('material = "paper"', 'material = "wood"', r"textures.wall.material: expected one of paper, laminate"),
        ("[0.05, 0.85]", "[0.85, 0.05]", r"materials.paper: material: reflectance: expected two rising numbers"),
        ("f_number = 2.0\n", "", r"camera: expected focus_m together with one of aperture_m and f_number"),
        ("focal_mm = 5.0\nsensor_width_mm = 6.0", "fx = 50.0", r"camera: expected focal_mm beside f_number"),
    ],
)
def test_faults_of_lights_and_materials_are_told_in_one_line(
    folder: Path, was: str, becomes: str, message: str
) -> None:
    assert was in FILE
    (folder / "scene.toml").write_text(FILE.replace(was, becomes, 1))
    with pytest.raises(SceneError, match=message) as caught:
        load_scene(folder / "scene.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: AreaLight((0, 0, np.nan), (1, 1), 1),
        lambda: AreaLight((0, 0, 0), (1, 0), 1),
        lambda: AreaLight((0, 0, 0), (1, 1), -1),
        lambda: AreaLight((0, 0, 0), (1, 1), 1, (0, 0, 0)),
        lambda: Environment(np.inf),
        lambda: Environment(1.0, np.zeros((4, 4, 2), np.float32)),
        lambda: Environment(1.0, np.full((4, 4), -1, np.float32)),
        lambda: ThinLens(0.0, 0.01),
        lambda: ThinLens(1.0, np.inf),
        lambda: from_f_number(1.0, 5.0, 0.0),
    ],
)
def test_bad_lamps_skies_and_lenses_are_refused(make: object) -> None:
    with pytest.raises(InputError, match="expected"):
        make()  # type: ignore[operator]


@pytest.mark.parametrize("renderer", ["exact", pytest.param("gl", marks=needs_gl)])
def test_what_is_left_out_is_said_once_in_one_line(renderer: Renderer, capfd: pytest.CaptureFixture[str]) -> None:
    floor = Quad("floor", WHITE, (9, 9), np.eye(4), material=Material("plastic"))
    scene = Scene((floor,), (), (AreaLight((0, 0, 2), (1, 1), 1), Environment(), Light("ambient", 0.5)))
    camera = Camera(40, 30, 40.0, 40.0, 19.5, 14.5, thin_lens=ThinLens(1.0, 0.01))
    for _ in range(2):
        assert render(scene, camera, ABOVE, renderer, bake=False).linear == pytest.approx(127.5)
    words = "area lights, light from the environment, gloss, depth of field"
    expected = f'peaksim: the {renderer} renderer leaves out {words}; renderer "traced" draws them\n'
    assert capfd.readouterr().err.count(expected) == 1


def test_lamps_alone_leave_surfaces_as_printed_where_light_is_not_baked() -> None:
    scene = Scene((Quad("floor", WHITE, (9, 9), np.eye(4)),), (), (AreaLight((0, 0, 2), (1, 1), 1),))
    assert (render(scene, CAMERA, ABOVE, "exact", bake=False).image == 255).all()
