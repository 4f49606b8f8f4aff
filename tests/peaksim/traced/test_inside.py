"""Lights inside solids are refused, unless the camera is inside as well."""

import numpy as np
import pytest
import trimesh
from peaksim import Camera, Light, Scene, render
from peaksim.errors import SceneError
from peaksim.geometry.pose import look_at
from peaksim.scene.lamps import AreaLight
from peaksim.traced.inside import is_inside, is_inside_many

from tests.peaksim.scene.boxes import cube
from tests.peaksim.traced.helpers import needs_tracing

CAMERA = Camera(8, 6, 8.0, 8.0, 3.5, 2.5)
OUTSIDE, INSIDE = look_at([2, 0, 1], [0, 0, 0.5]), look_at([0.3, 0, 0.5], [0, 0.2, 0.5])
LIGHTS = [Light("point", 1.0, position_m=(0, 0, 0.7)), AreaLight((0, 0, 0.9), (0.1, 0.1), 5.0)]


def test_points_are_inside_a_cube_where_their_coordinates_say() -> None:
    points = np.random.default_rng(0).uniform(-1, 1.5, (500, 3))
    expected = (np.abs(points[:, :2]) < 0.5).all(axis=1) & (points[:, 2] > 0) & (points[:, 2] < 1)
    triangles = cube(1.0).triangles_m
    assert [is_inside(triangles, point) for point in points] == expected.tolist()
    assert expected.any()


@pytest.mark.parametrize("light", LIGHTS, ids=["point", "area"])
def test_a_light_inside_a_mesh_is_refused_in_one_line(light: Light | AreaLight) -> None:
    scene = Scene((), (cube(1.0),), (light,))
    with pytest.raises(SceneError, match=r"^lights\[0\]: expected a light outside of mesh 'cube', got one inside it$"):
        render(scene, CAMERA, OUTSIDE, "traced")


@needs_tracing
def test_a_lamp_inside_a_mesh_is_not_baked_either() -> None:
    with pytest.raises(SceneError, match=r"^lights\[0\]: expected a light outside of mesh 'cube', got one inside it$"):
        render(Scene((), (cube(1.0),), (LIGHTS[1],)), CAMERA, OUTSIDE, "exact")


@needs_tracing
@pytest.mark.parametrize("light", LIGHTS, ids=["point", "area"])
def test_from_within_the_mesh_it_lights(light: Light | AreaLight) -> None:
    assert render(Scene((), (cube(1.0),), (light,)), CAMERA, INSIDE, "traced").linear.min() > 0


def test_rays_tell_the_same_for_meshes_of_many_faces() -> None:
    ball = trimesh.creation.icosphere(3, 0.5)
    triangles = np.asarray(ball.vertices)[np.asarray(ball.faces)]
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (2000, 3))
    inside = is_inside_many(triangles, points)
    assert np.array_equal(inside, is_inside(triangles, points))
    assert 0.1 < inside.mean() < 0.5
    assert not is_inside_many(triangles[: len(triangles) // 2], points).any()  # a shell is open
