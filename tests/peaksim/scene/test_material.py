"""Materials: how printed levels reflect light, in every renderer."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim import Camera, Light, Quad, Scene, Texture, render
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at
from peaksim.rendering import Renderer
from peaksim.scene.material import PRINT, Material, linear_from_srgb

from tests.helpers import needs_gl
from tests.peaksim.scene.boxes import cube
from tests.peaksim.traced.helpers import needs_tracing

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
POSE = look_at([0.3, -1.4, 1.0], [0.0, 0.1, 0.0])
PAPER = Material(reflectance=(0.05, 0.85), curve="srgb")
RENDERERS = ["exact", pytest.param("gl", marks=needs_gl), pytest.param("traced", marks=needs_tracing)]


def scene(material: Material) -> Scene:
    """Return a floor that fills the view and a cube on it, of one material, in light."""
    texture = Texture.from_array(np.random.default_rng(0).integers(0, 256, (99, 99), dtype=np.uint8))
    floor = Quad("floor", texture, (9.0, 9.0), np.eye(4), material=material)
    return Scene((floor,), (replace(cube(0.3), material=material),), (Light("ambient", 0.8),))


@pytest.mark.parametrize("renderer", RENDERERS)
def test_linear_paper_maps_every_pixel_alike_in_all_renderers(renderer: Renderer) -> None:
    plain, paper = (
        render(scene(material), CAMERA, POSE, renderer, samples=64).linear
        for material in (PRINT, Material(reflectance=(0.05, 0.85)))
    )
    difference = paper - (0.8 * 255 * 0.05 + 0.8 * plain)
    assert np.sqrt((difference**2).mean()) < 0.1
    assert np.abs(difference).max() < 1


@pytest.mark.parametrize("renderer", RENDERERS[1:])
def test_srgb_print_looks_alike_in_all_renderers(renderer: Renderer) -> None:
    expected = render(scene(PAPER), CAMERA, POSE, "exact").linear
    difference = render(scene(PAPER), CAMERA, POSE, renderer, samples=1024).linear - expected
    assert np.sqrt((difference**2).mean()) < 0.6


def test_a_plain_srgb_print_shows_the_decoded_level() -> None:
    grey = Quad("q", Texture.from_array(np.full((1, 1), 186, np.uint8)), (9, 9), np.eye(4), material=PAPER)
    above = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])
    linear = render(Scene((grey,)), CAMERA, above, "exact").linear
    decoded = ((186 / 255 + 0.055) / 1.055) ** 2.4
    assert linear == pytest.approx(255 * (0.05 + 0.8 * decoded), abs=1e-3)


def test_the_curve_of_srgb_has_its_ends_and_its_knee() -> None:
    assert linear_from_srgb([0.0, 1.0]) == pytest.approx([0.0, 1.0])
    knee = linear_from_srgb([0.04045 - 1e-9, 0.04045 + 1e-9])
    assert knee == pytest.approx([0.0031308, 0.0031308], abs=1e-6)


def test_the_default_material_keeps_the_very_array() -> None:
    levels = np.arange(256, dtype=np.uint8)
    assert PRINT.levels(levels) is levels


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "velvet"}, 'kind: expected "diffuse" or "plastic"'),
        ({"reflectance": (0.9, 0.1)}, "reflectance: expected two rising numbers"),
        ({"reflectance": (0.1, 1.5)}, "reflectance: expected two rising numbers"),
        ({"curve": "gamma"}, 'curve: expected "linear" or "srgb"'),
        ({"roughness": -0.1}, "roughness: expected a number in 0…1"),
        ({"ior": 1.0}, "ior: expected a number above 1"),
        ({"ior": float("nan")}, "ior: expected a number above 1"),
    ],
)
def test_bad_materials_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Material(**values)  # type: ignore[arg-type]
