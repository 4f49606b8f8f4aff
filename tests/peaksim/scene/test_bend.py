"""Bent paper: lengths on it, the panels that stand for it, and images of it against rays that meet a cylinder."""

from functools import cache
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim import Camera, Mark, Quad, Scene, Texture, render
from peaksim.camera.camera import resized
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.gl.context import is_available
from peaksim.scene.bend import Bend

from tests.peaksim.area.area_reference import permuted_offsets, rays_of
from tests.peaksim.views import LENSES

SHEET_M = (0.3, 0.2)
RNG = np.random.default_rng(2)
PRINT = Texture.from_array(np.kron(RNG.integers(0, 256, (8, 12)), np.ones((4, 4))).astype(np.uint8))
CAMERA = Camera(80, 60, 85.0, 85.0, 39.5, 29.5)


def cylinder_integral(quad: Quad, camera: Camera, pose: np.ndarray, n: int) -> np.ndarray:
    """Return the (h, w) mean of n² rays a pixel that meet a bent quad, by solving for their points on the cylinder."""
    bend = quad.bend
    assert bend is not None
    r, a, b = bend.radius_m, (0, 1)[bend.axis == "x"], (1, 0)[bend.axis == "x"]
    to_quad = np.linalg.inv(quad.world_from_quad) @ pose
    eye = to_quad[:3, 3]
    out = np.zeros((camera.height, camera.width))
    for dx, dy in permuted_offsets(n):
        x, y = np.meshgrid(np.arange(camera.width) + dx, np.arange(camera.height) + dy)
        d = rays_of(camera, x, y) @ to_quad[:3, :3].T
        # (eye + t·d − centre)² = r² across the axis; the centre is at z = −r
        p, q = eye[a], eye[2] + r
        aa, bb, cc = d[..., a] ** 2 + d[..., 2] ** 2, p * d[..., a] + q * d[..., 2], p * p + q * q - r * r
        root = np.sqrt(np.maximum(bb * bb - aa * cc, 0))
        level = np.full(x.shape, 128.0)
        nearest = np.full(x.shape, np.inf)
        for t in ((-bb - root) / aa, (-bb + root) / aa):
            at = eye + t[..., None] * d
            arc = abs(r) * np.arctan2(at[..., a], np.sign(r) * (at[..., 2] + r)) * 1.0
            arc = np.where(r < 0, abs(r) * np.arctan2(at[..., a], -(at[..., 2] + r)), arc)
            along, across = arc, at[..., b]
            hit = (bb * bb > aa * cc) & (t > 0) & (t < nearest)
            hit &= (np.abs(along) <= SHEET_M[a] / 2) & (np.abs(across) <= SHEET_M[b] / 2)
            outward = np.sign(r) * (d[..., a] * at[..., a] + d[..., 2] * (at[..., 2] + r))
            xy = (along, across) if a == 0 else (across, along)
            shown = np.where(outward < 0, bilinear(xy[0] / SHEET_M[0] + 0.5, 0.5 - xy[1] / SHEET_M[1]), 128.0)
            level, nearest = np.where(hit, shown, level), np.where(hit, t, nearest)
        out += level / n**2
    return out


def bilinear(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    pixels = PRINT.pixels.astype(float)
    h, w = pixels.shape
    x, y = np.clip(u * w - 0.5, 0, w - 1), np.clip(v * h - 0.5, 0, h - 1)
    i, j = np.minimum(x.astype(int), w - 2), np.minimum(y.astype(int), h - 2)
    f, g = x - i, y - j
    return (1 - g) * ((1 - f) * pixels[j, i] + f * pixels[j, i + 1]) + g * (
        (1 - f) * pixels[j + 1, i] + f * pixels[j + 1, i + 1]
    )


def bent(radius_m: float, axis: Literal["x", "y"]) -> Quad:
    pose = compose(rotation_about("z", 25) @ rotation_about("x", 60), [0.02, 0.01, 0.03])
    mark = Mark("m", "any", 0.08, (0.06, -0.03))
    return Quad("sheet", PRINT, SHEET_M, pose, mark, bend=Bend(radius_m, axis))


VIEWS = [
    (0.1, "y", "pinhole", (0.1, -0.3, 0.15)),
    (-0.1, "y", "pinhole", (0.1, -0.35, 0.1)),
    (0.06, "x", "brown5", (0.25, -0.35, 0.3)),
    (-0.07, "x", "pinhole", (0.0, -0.4, 0.1)),
    (0.2, "y", "fisheye", (-0.2, -0.25, 0.2)),
    (0.06, "y", "pinhole", (-0.3, 0.3, 0.1)),  # from behind
]


@cache
def view_of(radius_m: float, axis: Literal["x", "y"], lens: str, eye_m: tuple[float, ...]) -> tuple[Any, ...]:
    """Return a bent sheet, camera and pose, and what is seen; the same for every renderer."""
    camera = CAMERA if lens == "pinhole" else resized(LENSES[lens], CAMERA.width / LENSES[lens].width)
    quad, pose = bent(radius_m, axis), look_at(eye_m, (0.02, 0, 0.03))
    return quad, camera, pose, cylinder_integral(quad, camera, pose, 32)


@pytest.mark.parametrize(
    "renderer", ["exact", pytest.param("gl", marks=pytest.mark.skipif(not is_available(), reason="no OpenGL"))]
)
@pytest.mark.parametrize(("radius_m", "axis", "lens", "eye_m"), VIEWS)
def test_images_are_those_of_a_cylinder(
    radius_m: float, axis: Literal["x", "y"], lens: str, eye_m: tuple[float, ...], renderer: Any
) -> None:
    quad, camera, pose, expected = view_of(radius_m, axis, lens, eye_m)
    shown = render(Scene((quad,)), camera, pose, renderer).linear
    error = shown - expected
    assert np.ptp(expected) > 20
    assert np.sqrt((error**2).mean()) < 0.5
    assert np.quantile(np.abs(error), 0.999) < 4
    assert np.abs(error).max() < 12


@given(st.floats(0.05, 50), st.booleans(), st.sampled_from("xy"))
def test_lengths_on_the_paper_stay_and_panels_lie_on_it(radius_m: float, inside: bool, axis: Literal["x", "y"]) -> None:
    bend = Bend(-radius_m if inside else radius_m, axis)
    arc = np.linspace(-0.5, 0.5, 2001)[:, None] * SHEET_M[bend.along] * np.eye(2)[bend.along]
    points = bend.points_m(arc)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(SHEET_M[bend.along], rel=1e-5)
    steps = np.diff(points, axis=0)
    assert np.abs((steps * bend.normals((arc[1:] + arc[:-1]) / 2)).sum(axis=1)).max() < 1e-12
    panels = bend.panels_m(SHEET_M)
    inner = panels[:, :1] + np.linspace(0, 1, 21)[:, None] * (panels[:, 1:2] - panels[:, :1])
    if axis == "x":
        inner = panels[:, :1] + np.linspace(0, 1, 21)[:, None] * (panels[:, 3:] - panels[:, :1])
    away = np.hypot(inner[..., bend.along], inner[..., 2] + bend.radius_m) - radius_m
    assert np.abs(away).max() < 1.1 * 3e-6 * SHEET_M[bend.along]
    assert abs(away.mean()) < 0.2 * np.abs(away).max() + 1e-12


@pytest.mark.parametrize("radius_m", [0.0477, -0.0477, 0.0, float("nan"), float("inf"), "1"])
def test_a_sheet_that_would_cover_itself_is_refused_in_one_line(radius_m: Any) -> None:
    with pytest.raises(SceneError, match=r"quad 'sheet': bend: radius_m: expected at least 0.04775 m .* got") as caught:
        bent(radius_m, "y")
    assert "\n" not in str(caught.value)


def test_an_unknown_axis_is_refused() -> None:
    with pytest.raises(SceneError, match='bend: axis: expected "x" or "y", got \'z\''):
        bent(0.1, "z")  # type: ignore[arg-type]


@pytest.mark.parametrize("axis", ["x", "y"])
def test_directions_on_the_print_are_the_derivatives_of_its_points(axis: Literal["x", "y"]) -> None:
    quad, xy, step = bent(-0.1, axis), np.array([0.05, -0.04]), 1e-6
    right, up = ((quad.points_m([xy + d]) - quad.points_m([xy - d]))[0] / (2 * step) for d in step * np.eye(2))
    assert np.allclose(quad.rotation_at((0.05, -0.04)), np.stack([right, up, np.cross(right, up)], axis=1), atol=1e-8)
    assert np.allclose(quad.normals_at([xy])[0], np.cross(right, up), atol=1e-8)
