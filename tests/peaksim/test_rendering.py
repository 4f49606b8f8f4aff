"""Bad input is refused in one line, or drawn right: never a wrong picture, never a hang."""

import numpy as np
import pytest
from peaksim import Camera, Mesh, Quad, Scene, Texture, render
from peaksim.errors import ImageError, InputError, SceneError
from peaksim.geometry.pose import compose

CAMERA = Camera(width=40, height=30, fx=40.0, fy=40.0, cx=19.5, cy=14.5)
ABOVE = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])
WHITE = Texture.from_array(np.full((1, 1), 255, np.uint8))
SLAB = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SLAB_FACES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


@pytest.mark.parametrize("size_m", [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (np.inf, 1.0)])
def test_degenerate_quads_are_refused(size_m: tuple[float, float]) -> None:
    with pytest.raises(SceneError, match="quad 'q': size_m: expected two positive numbers"):
        Quad("q", WHITE, size_m, np.eye(4))


def test_a_camera_inside_a_mesh_sees_its_inner_side() -> None:
    scene = Scene(
        (Quad("floor", WHITE, (9, 9), compose(np.eye(3), [0, 0, -3])),),
        (Mesh("room", SLAB * 2, SLAB_FACES, color=(70.0,) * 3),),
    )
    frame = render(scene, CAMERA, ABOVE, renderer="exact")
    assert (frame.image == 70).all()
    assert np.allclose(frame.depth_m, 3)  # the slab's lower side, 3 m below the eye
    assert (frame.mesh_ids == 0).all()


@pytest.mark.parametrize("faces", [np.zeros((0, 3), int), np.array([[0, 1, 8]]), np.array([[0, 1]])])
def test_meshes_without_faces_or_with_wrong_ones_are_refused(faces: np.ndarray) -> None:
    with pytest.raises(SceneError, match="mesh 'm': faces: expected"):
        Mesh("m", SLAB, faces)


def test_a_texture_of_one_texel_is_plain() -> None:
    frame = render(Scene((Quad("q", WHITE, (9, 9), np.eye(4)),)), CAMERA, ABOVE, renderer="exact")
    assert (frame.image == 255).all()


def test_a_texture_that_is_too_large_is_refused() -> None:
    with pytest.raises(ImageError, match="expected at most 64000000 texels, got 16000×16000"):
        Texture.from_array(np.broadcast_to(np.uint8(1), (16_000, 16_000)))


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
