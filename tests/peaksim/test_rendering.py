"""Bad input is refused in one line, or drawn right: never a wrong image, never a hang."""

import numpy as np
import pytest
from peaksim import Camera, Mesh, Quad, Scene, render
from peaksim.errors import InputError, SceneError
from peaksim.geometry.pose import compose

from tests.peaksim.shapes import BOX_FACES, BOX_M, plain_texture

CAMERA = Camera(width=40, height=30, fx=40.0, fy=40.0, cx=19.5, cy=14.5)
ABOVE = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])
WHITE = plain_texture(255)


def test_a_camera_inside_a_mesh_sees_its_inner_side() -> None:
    scene = Scene(
        (Quad("floor", WHITE, (9, 9), compose(np.eye(3), [0, 0, -3])),),
        (Mesh("room", BOX_M * 4, BOX_FACES, color=(70.0,) * 3),),
    )
    frame = render(scene, CAMERA, ABOVE, renderer="exact")
    assert (frame.image == 70).all()
    assert np.allclose(frame.depth_m, 3)  # the box's lower side, 3 m below the eye
    assert (frame.mesh_ids == 0).all()


def test_a_texture_of_one_texel_is_plain() -> None:
    frame = render(Scene((Quad("q", WHITE, (9, 9), np.eye(4)),)), CAMERA, ABOVE, renderer="exact")
    assert (frame.image == 255).all()


@pytest.mark.parametrize("pose", [np.eye(3), np.full((4, 4), np.nan), np.diag([1.0, 1, -1, 1]), 2 * np.eye(4)])
def test_poses_that_are_not_rigid_are_refused(pose: np.ndarray) -> None:
    with pytest.raises(InputError, match="world_from_camera"):
        render(Scene(), CAMERA, pose, renderer="exact")


def test_a_triangle_of_no_area_is_not_seen() -> None:
    sliver = Mesh("sliver", np.array([[0, 0, 0.5], [0.1, 0, 0.5], [0.2, 0, 0.5]]), np.array([[0, 1, 2]]))
    scene = Scene((Quad("q", WHITE, (9, 9), np.eye(4)),), (sliver,))
    assert (render(scene, CAMERA, ABOVE, renderer="exact").image == 255).all()


def test_a_camera_in_the_plane_of_a_quad_sees_nothing_of_it() -> None:
    frame = render(
        Scene((Quad("q", WHITE, (9, 9), np.eye(4), marker="m"),), background=7.0),
        CAMERA,
        compose(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), [0, 0, 0]),
        renderer="exact",
    )
    assert (frame.image == 7).all()
    assert frame.truth[0].visible_fraction == 0


def test_an_unknown_renderer_is_refused() -> None:
    with pytest.raises(SceneError, match=r"renderer: expected .*, got 'vulkan'"):
        render(Scene(), CAMERA, ABOVE, renderer="vulkan")  # type: ignore[arg-type]
