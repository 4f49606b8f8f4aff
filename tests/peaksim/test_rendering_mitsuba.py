"""Both renderers against Mitsuba 3 on a small fixed scene, within its Monte Carlo error."""

import numpy as np
import pytest
from peaksim import Camera, Light, Mesh, Quad, Scene, Texture, render
from peaksim.geometry.pose import Pose, compose, look_at, rotation_about
from peaksim.rendering import Renderer

from tests.helpers import needs_gl

try:
    import mitsuba
except (ImportError, NameError):  # a NameError where libatomic is missing
    pytest.skip("Mitsuba or libatomic is missing", allow_module_level=True)

CAMERA = Camera(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
POSE = look_at([0.5, -1.6, 1.0], [0.0, 0.1, 0.1])
ROUNDS, SAMPLES = 8, 64


def quads() -> tuple[Quad, ...]:
    rng = np.random.default_rng(3)
    floor = Texture.from_array(rng.integers(0, 256, (48, 48), dtype=np.uint8))
    card = Texture.from_array(np.array([[0, 250, 0], [250, 40, 250]], np.uint8).repeat(8, 0).repeat(8, 1))
    standing = compose(rotation_about("z", 20) @ rotation_about("x", 70), [0.1, 0.2, 0.25])
    return Quad("floor", floor, (2.0, 2.0), np.eye(4)), Quad("card", card, (0.6, 0.4), standing)


def bitmap(pixels: np.ndarray) -> dict:
    # clamped, bilinear and linear; the first row is at v = 0, the bottom
    levels = np.ascontiguousarray(np.repeat(pixels[::-1, :, None], 3, axis=2) / np.float32(255), dtype=np.float32)
    return {"type": "bitmap", "bitmap": mitsuba.Bitmap(levels), "raw": True, "wrap_mode": "clamp"}


def to_world(pose: Pose, size_m: tuple[float, float]) -> object:
    return mitsuba.ScalarTransform4f(pose @ np.diag([size_m[0] / 2, size_m[1] / 2, 1, 1]))


def rectangle(pose: Pose, size_m: tuple[float, float], reflectance: dict) -> dict:
    diffuse = {"type": "twosided", "material": {"type": "diffuse", "reflectance": reflectance}}
    return {"type": "rectangle", "to_world": to_world(pose, size_m), "bsdf": diffuse}


def sensor(samples: int) -> dict:
    # Mitsuba's camera looks along z with x to the left
    rotated = POSE @ np.diag([-1.0, -1.0, 1.0, 1.0])
    return {
        "type": "perspective",
        "to_world": mitsuba.ScalarTransform4f(rotated),
        "fov_axis": "x",
        "fov": float(np.degrees(2 * np.arctan(CAMERA.width / 2 / CAMERA.fx))),
        "near_clip": 0.01,
        "film": {
            "type": "hdrfilm",
            "width": CAMERA.width,
            "height": CAMERA.height,
            "rfilter": {"type": "box"},
            "pixel_format": "luminance",
            "component_format": "float32",
        },
        "sampler": {"type": "independent", "sample_count": samples},
    }


def estimate(shapes: dict, integrator: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean image of independent rounds and the standard error of each pixel, grey levels."""
    scene = mitsuba.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor(SAMPLES), **shapes})
    rounds = np.stack([255 * np.array(mitsuba.render(scene, seed=k))[:, :, 0] for k in range(ROUNDS)])
    return rounds.mean(axis=0), rounds.std(axis=0, ddof=1) / np.sqrt(ROUNDS)


def assert_within_noise(image: np.ndarray, mean: np.ndarray, error: np.ndarray) -> None:
    """Assert that the standardised differences are those of Student's t with ROUNDS − 1 degrees of freedom."""
    noisy = error > 0.05
    z = (image - mean)[noisy] / error[noisy]
    assert np.abs(image - mean)[~noisy].max(initial=0) < 1
    assert abs(z.mean()) < 4 / np.sqrt(len(z)) * 1.2  # no bias
    assert z.std() < 1.4  # of t: √(7/5) = 1.18
    assert np.abs(image - mean).mean() < 1.2 * np.abs(error[noisy]).mean()


@pytest.fixture(autouse=True)
def variant() -> None:
    mitsuba.set_variant("scalar_rgb")


@pytest.mark.parametrize("renderer", ["exact", pytest.param("gl", marks=needs_gl)])
def test_textured_quads_agree_with_mitsuba(renderer: Renderer) -> None:
    shapes = {
        q.name: {
            "type": "rectangle",
            "to_world": to_world(q.world_from_quad, q.size_m),
            "emitter": {"type": "area", "radiance": bitmap(q.texture.pixels)},
        }
        for q in quads()
    }
    mean, error = estimate(shapes, {"type": "path", "max_depth": 1})
    image = render(Scene(quads(), background=0.0), CAMERA, POSE, renderer=renderer).linear
    assert_within_noise(image, mean, error)


@pytest.mark.parametrize("renderer", ["exact", pytest.param("gl", marks=needs_gl)])
def test_a_lit_scene_with_a_shadow_agrees_with_mitsuba(renderer: Renderer) -> None:
    floor, pose = quads()[0], compose(rotation_about("x", 10), [0.1, 0, 0.5])
    corners = np.array([[-0.25, -0.2, 0], [0.25, -0.2, 0], [0.25, 0.2, 0], [-0.25, 0.2, 0]])
    roof = Mesh("roof", corners, np.array([[0, 1, 2], [0, 2, 3]]), pose, color=(120.0,) * 3)
    light = Light("point", 0.8, position_m=(0.3, -0.4, 1.8), reference_m=1.5)
    # the multiplier of a diffuse surface is π times its radiance at intensity × reference²
    power = {"type": "rgb", "value": float(np.pi * light.intensity * light.reference_m**2)}
    shapes = {
        "floor": rectangle(floor.world_from_quad, floor.size_m, bitmap(floor.texture.pixels)),
        "roof": rectangle(pose, (0.5, 0.4), {"type": "rgb", "value": 120 / 255}),
        "lamp": {"type": "point", "position": list(light.position_m), "intensity": power},
    }
    mean, error = estimate(shapes, {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0})
    image = render(Scene((floor,), (roof,), (light,), background=0.0), CAMERA, POSE, renderer=renderer).linear
    assert_within_noise(image, mean, error)
