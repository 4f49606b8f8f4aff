"""Baked light against traced images, against figures that can be derived, and the same in both fast renderers."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera, Light, Quad, Scene, Texture, render
from peaksim.area.integrate import integrate
from peaksim.area.light_map import LightMaps, split_maps
from peaksim.camera.camera import resized
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.gl import integrate as render_gl
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.traced.bake import bake_light, lit_scene

from tests.helpers import needs_gl
from tests.peaksim.scene.boxes import cube
from tests.peaksim.traced.helpers import needs_tracing
from tests.peaksim.views import LENSES

pytestmark = needs_tracing

CAMERA = Camera(96, 72, 90.0, 90.0, 47.5, 35.5)
POSE = look_at([0.5, -1.3, 1.0], [0.0, 0.1, 0.1])
WHITE = Texture.from_array(np.full((1, 1), 255, np.uint8))


def corner(channels: int = 1) -> Scene:
    """Return a floor with a box and a sheet on it before a wall, in the light of two lamps."""
    rng = np.random.default_rng(3)
    floor = Texture.from_array(rng.integers(60, 220, (24, 24, 3)[: 2 + (channels == 3)], dtype=np.uint8))
    wall = compose(rotation_about("x", 90), [0, 0.9, 0.6])
    quads = (
        Quad("floor", floor, (2.4, 2.4), np.eye(4)),
        Quad("wall", Texture.from_array(np.full((1, 1), 200, np.uint8)), (2.4, 1.2), wall),
        Quad("sheet", WHITE, (0.3, 0.3), compose(rotation_about("z", 20), [0.5, -0.3, 0.001])),
    )
    box = replace(cube(0.3), world_from_mesh=compose(rotation_about("z", 30), [-0.2, 0.2, 0]), color=(150.0,) * 3)
    lamps = (AreaLight((0.6, -0.4, 1.6), (0.3, 0.3), 25.0), AreaLight((-0.7, 0.1, 1.4), (0.1, 0.4), 30.0))
    return Scene(quads, (box,), lamps, background=0.0)


@cache
def corners_light() -> LightMaps:
    """Return the light of the grey corner, baked once."""
    return bake_light(corner())


def draw(
    scene: Scene, maps: LightMaps, camera: Camera = CAMERA, pose: NDArray[np.float64] = POSE
) -> NDArray[np.float32]:
    """Return the exact renderer's levels of a scene in baked light."""
    return integrate(lit_scene(scene), camera, pose[None], maps)


def rms_beyond_noise(baked: NDArray[np.float32], rounds: NDArray[np.float32], where: NDArray[np.bool_]) -> float:
    """Return the rms difference of an image to the mean of (n, h, w, channels) noisy ones, without their noise."""
    expected = np.clip(rounds.mean(axis=0), 0, 255)
    squares = (np.clip(baked, 0, 255) - expected) ** 2 - rounds.var(axis=0, ddof=1) / len(rounds)
    return float(np.sqrt(max(squares[where].mean(), 0.0)))


def traced_rounds(scene: Scene, camera: Camera = CAMERA) -> NDArray[np.float32]:
    """Return four images of 256 samples each."""
    images = [render(scene, camera, POSE, "traced", samples=256, seed=k).linear for k in range(4)]
    return np.stack(images).reshape(4, camera.height, camera.width, -1)


@pytest.mark.parametrize("name", ["pinhole", "fisheye"])
def test_baked_light_is_that_of_traced_images_shadow_edges_included(name: str) -> None:
    camera = CAMERA if name == "pinhole" else resized(LENSES[name], CAMERA.width / LENSES[name].width)
    scene, maps = corner(), corners_light()
    rounds, baked = traced_rounds(scene, camera), draw(scene, maps, camera)
    assert rms_beyond_noise(baked, rounds, np.ones_like(baked, dtype=bool)) < 1.0
    plain = replace(scene, quads=tuple(replace(quad, texture=WHITE) for quad in scene.quads))
    light = draw(plain, maps, camera)
    edges = np.hypot(*np.gradient(light[:, :, 0])) > 8
    assert 100 < edges.sum() < 0.5 * edges.size
    assert rms_beyond_noise(baked, rounds, edges[:, :, None]) < 1.5


def test_coloured_walls_colour_what_is_beside_them() -> None:
    scene = corner(channels=3)
    red = Texture.from_array(np.array([[[250, 40, 40]]], np.uint8))
    scene = replace(scene, quads=(scene.quads[0], replace(scene.quads[1], texture=red), scene.quads[2]))
    baked, rounds = draw(scene, bake_light(scene)), traced_rounds(scene)
    assert baked.shape == (72, 96, 3)
    assert rms_beyond_noise(baked, rounds, np.ones_like(baked, dtype=bool)) < 1.0


def test_the_stated_errors_are_those_that_are_there() -> None:
    maps, other, coarse = corners_light(), bake_light(corner(), seed=7), bake_light(corner(), texel_m=0.02)
    squares = ((maps.texels - other.texels) ** 2).mean() / 2
    assert 255 * np.sqrt(squares) < 2 * maps.noise < 2
    assert 0 < maps.detail < coarse.detail < 1.5


def test_an_even_sky_over_open_ground_lights_with_multiplier_1() -> None:
    scene = Scene((Quad("floor", WHITE, (2.0, 2.0), np.eye(4)),), (), (Environment(1.0),))
    baked = draw(scene, bake_light(scene))
    assert baked == pytest.approx(255.0, rel=0.01)  # the sky is seen behind the ground


def test_without_any_surface_the_even_sky_is_the_background(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKSIM_CACHE", str(tmp_path))
    assert render(Scene(lights=(Environment(0.2),)), CAMERA, POSE, "exact").linear == pytest.approx(51.0)


def test_plain_light_keeps_its_exact_edges_and_gives_its_indirect_light() -> None:
    scene = corner()
    lights = (Light("point", 0.6, position_m=(0.6, -0.4, 1.6)), Light("ambient", 0.1), Environment(0.05))
    scene = replace(scene, quads=scene.quads[:2], lights=lights)
    baked, rounds = draw(scene, bake_light(scene)), traced_rounds(scene)
    assert rms_beyond_noise(baked, rounds, np.ones_like(baked, dtype=bool)) < 1.0


def test_a_lamp_is_seen_bright_from_before_and_black_from_behind() -> None:
    lamp = AreaLight((0, 0, 1.0), (0.5, 0.5), 0.8)
    scene = Scene((), (), (lamp, Light("ambient", 0.1)), background=77.0)
    maps = bake_light(scene)
    below, above = (look_at([0, 0, z], [0, 0, 1.0], up=(0, 1, 0)) for z in (0.0, 2.0))
    assert draw(scene, maps, pose=below)[36, 48] == pytest.approx(0.8 * 255)
    assert draw(scene, maps, pose=above)[36, 48] == pytest.approx(0.0, abs=1e-3)
    assert draw(scene, maps, pose=below)[0, 0] == 77.0


@needs_gl
@pytest.mark.parametrize("channels", [1, 3])
def test_gl_shows_what_the_exact_renderer_shows(channels: int) -> None:
    scene = corner(channels)
    maps = bake_light(scene, texel_m=0.05)
    difference = render_gl.integrate(lit_scene(scene), CAMERA, POSE, maps) - draw(scene, maps)
    assert np.sqrt((difference**2).mean()) < 0.01
    assert np.abs(difference).max() < 1


def test_light_under_solids_and_behind_posters_does_not_darken_what_is_beside_them() -> None:
    lamp = AreaLight((0, 0, 3.0), (1.0, 1.0), 20.0)
    floor, sheet = (
        Quad("floor", WHITE, (2, 2), np.eye(4)),
        Quad("sheet", WHITE, (0.5, 0.5), compose(np.eye(3), [0, 0, 0.002])),
    )
    bare, covered = (bake_light(Scene(quads, (), (lamp,))) for quads in ((floor,), (floor, sheet)))
    below, among = (split_maps(maps.shapes.reshape(-1, 2), maps.texels)[1] for maps in (bare, covered))
    assert among == pytest.approx(below, rel=0.02)
    box = replace(cube(0.4), color=(0.0, 0.0, 0.0))
    maps = split_maps(*(lambda m: (m.shapes.reshape(-1, 2), m.texels))(bake_light(Scene((floor,), (box,), (lamp,)))))
    inside = maps[1][81:119, 81:119, 0]
    assert inside[0].min() > 0.5 * maps[1][79, 80:120].min()  # a texel within the box, bilinear with the one beside it
    assert inside[10, 10] == 0


def test_the_same_arguments_give_the_same_bytes() -> None:
    first, second = (bake_light(corner(), texel_m=0.05) for _ in range(2))
    assert np.array_equal(first.texels, second.texels)
