"""Tables of faces: what the kernels are told of each print, and what they make of images and colours on triangles."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim import Camera, Mesh, Scene, Texture
from peaksim.area.faces import CONTRAST, pack_textures
from peaksim.area.integrate import integrate
from peaksim.scene.material import PRINT, Material
from peaksim.scene.skin import Skin

from tests.peaksim.area.area_reference import area_integral, permuted_offsets, rays_of
from tests.peaksim.views import random_view, through


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 3)])
def test_contrast_is_the_deviation_of_the_channel_that_varies_most(shape: tuple[int, ...]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    prints = [(Texture.from_array(pixels), material) for material in (PRINT, Material(reflectance=(0.25, 0.75)))]
    _, (plain, half) = pack_textures(tuple(prints))
    expected = pixels.std(axis=(0, 1)).max()
    assert (plain[CONTRAST], half[CONTRAST]) == pytest.approx((expected, expected / 2))


def as_mesh(scene: Scene, eye_m: np.ndarray, rng: np.random.Generator) -> Mesh:
    """Return quads as one mesh: a fan of four triangles around a point of each, plain grey where seen from behind."""
    corners, uvs, numbers = [], [], []
    for quad in scene.quads:
        u, v = rng.uniform(0.2, 0.8, 2)
        ends = np.array([[0, 1], [1, 1], [1, 0], [0, 0.0]])
        fan = np.array([[[u, v], ends[(k + 1) % 4], ends[k]] for k in range(4)])
        flat = np.dstack([(fan - 0.5) * quad.size_m, np.zeros((4, 3))])
        corners.append(flat @ quad.world_from_quad[:3, :3].T + quad.world_from_quad[:3, 3])
        uvs.append(fan)
        is_seen = (eye_m - quad.world_from_quad[:3, 3]) @ quad.world_from_quad[:3, 2] > 0
        numbers += 4 * [len(uvs) - 1 if is_seen else -1]
    textures = tuple(quad.texture for quad in scene.quads)
    skin = Skin(textures, np.array(numbers), np.concatenate(uvs))
    vertices = np.concatenate(corners).reshape(-1, 3)
    return Mesh("prints", vertices, np.arange(len(vertices)).reshape(-1, 3), skin=skin)


@pytest.mark.parametrize("seed", range(4))
def test_textured_triangles_are_the_area_integral(seed: int) -> None:
    view = random_view(seed, 64, 48)
    view = through(view, ("fisheye", "brown5")[seed]) if seed < 2 else view
    mesh = as_mesh(view.scene, view.pose[:3, 3], np.random.default_rng(seed))
    drawn = integrate(Scene((), (mesh,), background=view.scene.background), view.camera, view.pose[None])
    error = np.clip(np.rint(drawn), 0, 255) - area_integral(view.scene, view.camera, view.pose, 32)
    assert np.sqrt((error**2).mean()) < 0.5
    assert np.quantile(np.abs(error), 0.999) < 6  # with that of the reference


def test_colours_of_corners_are_linear_over_a_triangle() -> None:
    rng = np.random.default_rng(5)
    vertices, colors = rng.uniform(-0.5, 0.5, (3, 3)), rng.uniform(0, 255, (1, 3, 3))
    vertices[:, 2] += 2
    mesh = Mesh("one", vertices, np.array([[0, 1, 2]]), skin=Skin(colors=colors))
    camera = Camera(48, 36, 40.0, 40.0, 23.5, 17.5)
    drawn = integrate(Scene((), (mesh,), background=0.0), camera, np.eye(4)[None])
    expected = np.zeros_like(drawn, dtype=np.float64)
    for dx, dy in permuted_offsets(32):
        x, y = np.meshgrid(np.arange(48) + dx, np.arange(36) + dy)
        rays = rays_of(camera, x, y)
        shares = rays @ np.linalg.inv(vertices)  # a·d = Σ share · vertex
        inside = (shares >= 0).all(axis=2)
        shares /= np.maximum(shares.sum(axis=2, keepdims=True), 1e-9)
        expected += np.where(inside[..., None], shares @ colors[0], 0) / 32**2
    assert np.abs(drawn - expected).max() < 1.5  # of 1024 samples on edges
    assert np.sqrt(((drawn - expected) ** 2).mean()) < 0.2


def test_a_triangle_on_a_line_of_its_image_shows_the_levels_of_that_line() -> None:
    ramp = Texture.from_array(np.arange(0, 256, 5, dtype=np.uint8)[None])
    vertices = np.array([[-1, -1, 2], [1, -1, 2], [-1, 1, 2.0]])
    line, point = np.array([[[0.1, 0.5], [0.9, 0.5], [0.3, 0.5]]]), np.full((1, 3, 2), 0.5)
    camera = Camera(20, 20, 10.0, 10.0, 9.5, 9.5)
    for uv in (line, point):
        mesh = Mesh("m", vertices, np.array([[0, 1, 2]]), skin=Skin((ramp,), uv=uv))
        levels = (uv[..., 0] * 52 - 0.5) * 5
        colored = Mesh("m", vertices, np.array([[0, 1, 2]]), skin=Skin(colors=np.repeat(levels[..., None], 3, 2)))
        shown, expected = (integrate(Scene((), (m,)), camera, np.eye(4)[None]) for m in (mesh, colored))
        assert np.allclose(shown, expected, atol=1e-3)
        assert np.ptp(shown[6:9, 6:9]) > 1 or uv is point


def test_both_sides_of_a_textured_triangle_show_its_image() -> None:
    view = random_view(3, 40, 30)
    mesh = as_mesh(view.scene, view.pose[:3, 3], np.random.default_rng(0))
    turned = Mesh("m", mesh.vertices_m, mesh.faces[:, ::-1], skin=replace(mesh.skin, uv=mesh.skin.uv[:, ::-1]))
    first, second = (integrate(Scene((), (m,)), view.camera, view.pose[None]) for m in (mesh, turned))
    assert np.allclose(first, second, atol=0.5)
