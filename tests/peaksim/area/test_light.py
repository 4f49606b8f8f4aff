"""Lights and shadows against brute force and against what can be derived by hand."""

import numpy as np
import pytest
from peaksim import Camera, Light, Mesh, Scene
from peaksim.area.integrate import integrate
from peaksim.area.light import pack_lights
from peaksim.geometry.pose import compose, look_at, rotation_about

from tests.peaksim.area.light_reference import lit_integral
from tests.peaksim.shapes import BOX_FACES, BOX_M, plain_quad

CAMERA = Camera(width=32, height=24, fx=27.0, fy=27.0, cx=15.5, cy=11.5)
SQUARE = Camera(width=48, height=48, fx=40.0, fy=40.0, cx=23.5, cy=23.5)
ABOVE = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])  # 1 m above z = 0, looking down, its x along the world's
LIGHTS = {
    "ambient": (Light("ambient", 0.7),),
    "directional": (Light("ambient", 0.2), Light("directional", 0.9, direction=(0.6, -0.4, -1.0))),
    "point": (Light("point", 1.0, position_m=(0.4, -0.7, 1.6), reference_m=1.5),),
    "point without shadows": (Light("point", 1.0, position_m=(0.4, -0.7, 1.6), casts_shadows=False),),
    "two": (Light("directional", 0.5, direction=(-1, 0.2, -0.8)), Light("point", 0.6, position_m=(-0.5, 0.5, 1.8))),
}


def furniture(seed: int) -> Scene:
    """Return a floor, a wall and three rotated boxes."""
    rng = np.random.default_rng(seed)
    wall = compose(rotation_about("x", 90), [0, 1.2, 0.5])
    quads = (plain_quad("floor", 180, 4.0, np.eye(4)), plain_quad("wall", 220, 4.0, wall))
    boxes = []
    for k in range(3):
        size = rng.uniform(0.15, 0.5, 3)
        rotation = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", rng.uniform(0, 40) * (k == 2))
        position = [*rng.uniform(-0.7, 0.7, 2), size[2] * (0.5 if k < 2 else 1.4)]
        boxes.append(Mesh(f"box{k}", BOX_M * size, BOX_FACES, compose(rotation, position), (90.0 + 40 * k,) * 3))
    return Scene(quads, tuple(boxes))


@pytest.mark.parametrize("name", LIGHTS)
def test_light_and_shadow_are_those_of_brute_force(name: str) -> None:
    plainly = furniture(len(name))
    scene = Scene(plainly.quads, plainly.meshes, LIGHTS[name], background=30.0)
    pose = look_at([1.5, -2.0, 1.4], [0, 0, 0.2])
    reference = lit_integral(scene, CAMERA, pose)
    error = integrate(scene, CAMERA, pose[None])[:, :, 0] - reference
    assert np.sqrt((error**2).mean()) < 0.5
    assert np.quantile(np.abs(error), 0.99) < 3


def test_a_mesh_throws_its_shadow_by_area() -> None:
    corners = np.array([[-0.1, -0.1, 0.5], [0.1, -0.1, 0.5], [0.1, 0.1, 0.5], [-0.1, 0.1, 0.5]])
    roof = Mesh("roof", corners + np.array([0.25, 0, 0]), np.array([[0, 1, 2], [0, 2, 3]]))
    lights = (Light("ambient", 0.25), Light("directional", 0.5, direction=(-0.5, 0, -1)))
    scene = Scene((plain_quad("floor", 200, 2.0, np.eye(4)),), (roof,), lights)
    image = integrate(scene, SQUARE, ABOVE[None])[:, :, 0]
    lit = 200 * (0.25 + 0.5 / np.hypot(0.5, 1))
    # the roof at height 0.5 is thrown 0.25 m to the left: under the camera, ± 0.1 m is ± 4 px
    assert image[24, 24] == pytest.approx(50, abs=1e-3)
    assert image[2, 2] == pytest.approx(lit, rel=1e-5)
    shadow = (lit - image[12:36, 12:28]).sum() / (lit - 50)
    assert shadow == pytest.approx(64, rel=0.02)


def test_a_point_light_falls_off_with_distance_and_angle() -> None:
    light = Light("point", 1.0, position_m=(0, 0, 2), reference_m=2)
    scene = Scene((plain_quad("floor", 100, 2.0, np.eye(4)),), lights=(light,))
    image = integrate(scene, SQUARE, ABOVE[None])[:, :, 0]
    x = (np.arange(48) - 23.5) / 40
    r2 = x**2 + x[:, None] ** 2 + 4
    assert np.allclose(image, 100 * (2 / np.sqrt(r2)) * 4 / r2, atol=0.01)


def test_a_light_behind_a_surface_does_not_reach_it() -> None:
    below = Light("directional", 1.0, direction=(0, 0, 1))
    scene = Scene((plain_quad("floor", 100, 2.0, np.eye(4)),), lights=(below,))
    assert not integrate(scene, SQUARE, ABOVE[None]).any()


def test_lights_are_packed_as_directions_towards_them() -> None:
    rows = pack_lights((Light("directional", 0.5, direction=(0, 0, -2)), Light("point", 2.0, casts_shadows=False)))
    assert rows[:, 0].tolist() == [1, 2]
    assert rows[0, 2:5].tolist() == [0, 0, 1]
    assert rows[1].tolist() == [2, 2, 0, 0, 2.5, 1, 0]


def test_a_shadow_is_the_same_however_many_faces_throw_it() -> None:
    corners = np.array([[0.11, -0.1, 0.5], [0.4, -0.13, 0.5], [0.42, 0.1, 0.5], [0.1, 0.12, 0.5]])
    lights = (Light("ambient", 0.25), Light("directional", 0.5, direction=(-0.53, 0.17, -1)))
    floor, roof = (plain_quad("floor", 200, 2.0, np.eye(4)),), [[0, 1, 2], [0, 2, 3]]
    one, twenty = (
        integrate(Scene(floor, (Mesh("roof", corners, np.tile(roof, (n, 1))),), lights), SQUARE, ABOVE[None])
        for n in (1, 20)
    )
    assert len(np.unique(one)) > 20  # lit, shadow, and shares of both
    assert np.array_equal(one, twenty)
