"""Quads, meshes, lights and scenes: what they refuse, and in which frame their corners are."""

import numpy as np
import pytest
from peaksim import Light, Mark, Mesh, Quad, Scene
from peaksim.errors import SceneError
from peaksim.geometry.pose import compose, rotation_about
from peaksim.scene.scene import rectangle_m

from tests.peaksim.shapes import BOX_FACES, BOX_M, plain_quad, plain_texture

WHITE = plain_texture(255)


@pytest.mark.parametrize("size_m", [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (np.inf, 1.0)])
def test_degenerate_quads_are_refused(size_m: tuple[float, float]) -> None:
    with pytest.raises(SceneError, match="quad 'q': size_m: expected two positive numbers"):
        Quad("q", WHITE, size_m, np.eye(4))


@pytest.mark.parametrize("faces", [np.zeros((0, 3), int), np.array([[0, 1, 8]]), np.array([[0, 1]])])
def test_meshes_without_faces_or_with_wrong_ones_are_refused(faces: np.ndarray) -> None:
    with pytest.raises(SceneError, match="mesh 'm': faces: expected"):
        Mesh("m", BOX_M, faces)


def test_corners_run_clockwise_from_the_top_left_of_the_printed_face() -> None:
    wall = Quad("wall", WHITE, (4.0, 2.0), compose(rotation_about("x", 90), [1, 2, 3]))  # seen along +y
    assert np.allclose(wall.corners_m, [[-1, 2, 4], [3, 2, 4], [3, 2, 2], [-1, 2, 2]])
    assert np.allclose(rectangle_m(wall, (1.0, 0.5), (2.0, 1.0)), [[1, 2, 4], [3, 2, 4], [3, 2, 3], [1, 2, 3]])


def test_a_string_is_one_marker_that_fills_the_shorter_side() -> None:
    (mark,) = Quad("tile", WHITE, (0.3, 0.2), np.eye(4), "surf-dark").marks
    assert (mark.name, mark.kind, mark.side_m, mark.center_m) == ("tile", "surf-dark", 0.2, (0.0, 0.0))


def test_triangles_are_in_the_world() -> None:
    box = Mesh("box", BOX_M, BOX_FACES, compose(np.eye(3), [1, 0, 0]))
    assert box.triangles_m.shape == (12, 3, 3)
    assert np.allclose(box.triangles_m.min(axis=(0, 1)), [0.5, -0.5, -0.5])
    outward = np.cross(*(box.triangles_m[:, k] - box.triangles_m[:, 0] for k in (1, 2)))
    assert ((outward * (box.triangles_m.mean(axis=1) - [1, 0, 0])).sum(axis=1) > 0).all()


def test_a_name_may_stand_once() -> None:
    with pytest.raises(SceneError, match="expected unique names, got 'a' twice"):
        Scene((plain_quad("a", 0, 1.0, np.eye(4)),), (Mesh("a", BOX_M, BOX_FACES),))
    marks = (Mark("m", "any", 0.1), Mark("m", "any", 0.1, (0.2, 0.0)))
    with pytest.raises(SceneError, match="expected unique marker names, got 'm' twice"):
        Scene((Quad("q", WHITE, (1, 1), np.eye(4), marks),))


@pytest.mark.parametrize("field", [{"intensity": -1.0}, {"direction": (0, 0, 0)}, {"position_m": (0, 0, np.nan)}])
def test_impossible_lights_are_refused(field: dict[str, object]) -> None:
    with pytest.raises(SceneError, match="light: "):
        Light(**{"kind": "point", "intensity": 1.0, **field})  # type: ignore[arg-type]
