"""Quads, meshes, lights and scenes: what they refuse, and in which frame their corners are."""

import numpy as np
import pytest
from peaksim import Camera, Light, Mark, Mesh, Quad, Scene, render
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


@pytest.mark.parametrize(
    ("color", "message"),
    [
        ((128, 128), r"expected \(3\) numbers, got shape \(2,\)"),
        (128, "numbers, got shape"),
        ("grey", "expected numbers, got 'grey'"),
        ((0, 0, np.nan), "expected finite numbers"),
        ((0, 0, 256), "expected three grey levels 0…255, got"),
        ((-1, 0, 0), "expected three grey levels 0…255, got"),
    ],
)
def test_a_colour_that_is_none_is_refused(color: object, message: str) -> None:
    with pytest.raises(SceneError, match=f"mesh 'm': color: .*{message}"):
        Mesh("m", BOX_M, BOX_FACES, color=color)  # type: ignore[arg-type]


def test_a_colour_may_be_an_array() -> None:
    assert Mesh("m", BOX_M, BOX_FACES, color=np.array([1, 2, 3])).color == (1.0, 2.0, 3.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("faces", [[[0, 1, 2.5]], "abc", [[0, 1], [2, 3, 4]]])
def test_faces_are_whole_numbers(faces: object) -> None:
    with pytest.raises(SceneError, match="mesh 'm': faces: expected"):
        Mesh("m", BOX_M, faces)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"side_m": 0.0}, "side_m: expected a positive number, got 0.0"),
        ({"side_m": np.nan}, "side_m: expected finite numbers"),
        ({"side_m": "big"}, "side_m: expected numbers, got 'big'"),
        ({"side_m": 0.1, "center_m": (0.0,)}, r"center_m: expected \(2\) numbers, got shape \(1,\)"),
        ({"side_m": 0.1, "center_m": (0.0, np.inf)}, "center_m: expected finite numbers"),
    ],
)
def test_a_mark_of_no_size_or_position_is_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=f"marker 'm': {message}"):
        Mark("m", "any", **values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"size_m": (1.0,)}, r"quad 'q': size_m: expected \(2\) numbers"),
        ({"texture": np.zeros((2, 2), np.uint8)}, "quad 'q': texture: expected a Texture, got ndarray"),
        ({"marker": 3}, "quad 'q': marker: expected a tuple of Mark, got int"),
        ({"marker": ("a", "b")}, "quad 'q': marker: expected a tuple of Mark, got str"),
    ],
)
def test_a_quad_of_something_else_is_refused(values: dict[str, object], message: str) -> None:
    given = {"texture": WHITE, "size_m": (1.0, 1.0), "world_from_quad": np.eye(4), **values}
    with pytest.raises(SceneError, match=message):
        Quad("q", **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"quads": plain_quad("q", 0, 1.0, np.eye(4))}, "quads: expected a tuple of Quad, got Quad"),
        ({"meshes": (plain_quad("q", 0, 1.0, np.eye(4)),)}, "meshes: expected a tuple of Mesh, got Quad"),
        ({"lights": (None,)}, "lights: expected a tuple of Light or AreaLight or Environment, got NoneType"),
        ({"background": np.nan}, "background: expected finite numbers"),
        ({"background": 300.0}, "background: expected a grey level 0…255, got 300"),
    ],
)
def test_a_scene_of_something_else_is_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=f"scene: {message}"):
        Scene(**values)  # type: ignore[arg-type]


def test_lists_are_as_good_as_tuples() -> None:
    quad = Quad("q", WHITE, (1.0, 1.0), np.eye(4), [Mark("m", "any", 0.1)])  # type: ignore[arg-type]
    scene = Scene([quad], [], [])  # type: ignore[arg-type]
    assert (scene.quads, scene.meshes, scene.lights) == ((quad,), (), ())
    assert quad.marks[0].name == "m"
    assert render(scene, Camera(8, 6, 9.0), np.eye(4), renderer="exact").image.shape == (6, 8)


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


class CountedName(str):
    """A name that counts how often it is compared."""

    compared = 0
    __hash__ = str.__hash__

    def __eq__(self, other: object) -> bool:
        CountedName.compared += 1
        return str.__eq__(self, other)


def test_names_are_not_compared_each_with_each() -> None:
    marks = tuple(Mark(CountedName(f"m{k}"), "any", 0.001) for k in range(2000))
    Scene((Quad("q", WHITE, (1.0, 1.0), np.eye(4), marks),))
    assert CountedName.compared < 10 * len(marks)
