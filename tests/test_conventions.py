"""One test for each numbered sentence of CONVENTIONS.md."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture, Trajectory, render
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.pose import compose, invert, look_at, rotation_about, transform
from peaksim.rendering import Renderer
from peaksim.scene.file import load_scene

from peakmark import surf
from peakmark.experiments.floor.still import FloorConfig, render_view
from peakmark.markers.array_code import THREE_BIT, polarities_of
from tests.helpers import marker_view, needs_gl
from tests.places import ROOT

CAMERA = Camera(width=40, height=30, fx=40.0, fy=40.0, cx=19.5, cy=14.5)
FACING = compose(np.diag([1.0, -1.0, -1.0]), [0, 0, 1.0])  # a camera 1 m above a quad in z = 0, its x along the quad's


def quad(pixels: np.ndarray, size_m: tuple[float, float] = (1.0, 0.75), name: str = "q", z: float = 0.0) -> Quad:
    return Quad(name, Texture.from_array(pixels), size_m, compose(np.eye(3), [0, 0, z]))


def image(*quads: Quad, pose: np.ndarray = FACING, background: float = 0.0) -> np.ndarray:
    return render(Scene(quads=quads, background=background), CAMERA, pose, renderer="exact").image


def test_every_sentence_has_a_test() -> None:
    page = (ROOT / "CONVENTIONS.md").read_text()
    numbers = {int(n) for n in re.findall(r"^(\d+)\. ", page, re.M)}
    assert numbers == {int(n) for name in globals() for n in re.findall(r"^test_(\d+)_", name)}


def test_1_the_world_is_right_handed_with_z_up() -> None:
    pose = look_at([0, 0, 1], [0, 5, 1])  # looking along +y, so +x is right and +z is up in the image
    right, up = (CAMERA.project(transform(invert(pose), [p]))[0] for p in ([1, 5, 1], [0, 5, 2]))
    assert right[0] > CAMERA.cx
    assert right[1] == pytest.approx(CAMERA.cy)
    assert up[1] < CAMERA.cy


def test_2_the_camera_is_opencvs() -> None:
    points = np.array([[0.1, 0.05, 1.0], [-0.2, 0.1, 2.0]])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), CAMERA.matrix, None)[0].reshape(-1, 2)
    assert np.allclose(CAMERA.project(points), expected)
    assert np.isnan(CAMERA.project([[0, 0, -1.0]])).all()


def test_3_poses_map_from_their_source_to_their_target() -> None:
    pose = look_at([1, 2, 3], [4, 5, 0])
    assert np.allclose(transform(pose, [0, 0, 0]), [1, 2, 3])
    assert np.allclose(transform(invert(pose), [1, 2, 3]), 0)


def test_4_pixel_centres_are_at_integers() -> None:
    # a white quad that projects onto [9.5, 14.5] × [4.5, 9.5] fills pixels 10…14 × 5…9 exactly
    white = np.full((2, 2), 255, np.uint8)
    corner = CAMERA.unproject([[9.5, 4.5], [14.5, 9.5]])[:, :2]
    middle = corner.mean(axis=0)
    square = Quad("q", Texture.from_array(white), (5 / 40, 5 / 40), compose(np.eye(3), [middle[0], -middle[1], 0]))
    expected = np.zeros((30, 40), np.uint8)
    expected[5:10, 10:15] = 255
    assert np.array_equal(image(square), expected)


def test_5_images_are_rows_of_grey_or_rgb() -> None:
    grey = image(quad(np.full((3, 4), 9, np.uint8)))
    red = image(quad(np.full((3, 4, 3), [200, 20, 30], np.uint8)))
    assert (grey.shape, grey.dtype) == ((30, 40), np.uint8)
    assert red.shape == (30, 40, 3)
    assert red[15, 20].tolist() == [200, 20, 30]


def test_6_texels_are_samples_between_which_the_texture_is_linear_with_row_0_at_the_top() -> None:
    texels = np.array([[0, 100, 200, 100]], np.uint8).repeat(3, axis=0)
    row = image(quad(texels))[15].astype(float)  # 10 px a texel, centres at 4.5, 14.5, 24.5, 34.5
    assert np.allclose(row[:5], 0, atol=1)
    assert np.allclose(row[35:], 100, atol=1)
    assert np.allclose(row[5:14], (np.arange(5, 14) - 4.5) * 10, atol=0.51)
    down = image(quad(np.array([[10], [250]], np.uint8)))
    assert down[0, 20] == 10
    assert down[-1, 20] == 250


def test_7_a_quad_is_centred_and_ends_at_its_edge() -> None:
    half = quad(np.full((1, 1), 200, np.uint8), size_m=(10.5 / 40, 10 / 40))  # 10.5 px wide: the ends cover ¼ pixel
    row = image(half)[15]
    assert row[14:26].tolist() == [50, *[200] * 10, 50]
    assert np.allclose(half.corners_m[0], [-10.5 / 80, 10 / 80, 0])


def test_8_a_quad_is_grey_from_behind() -> None:
    from_below = compose(np.eye(3), [0, 0, -1.0])
    assert (image(quad(np.full((2, 2), 255, np.uint8)), pose=from_below)[5:25, 5:35] == 128).all()


def test_9_a_pixel_is_the_mean_over_its_area_rounded_once() -> None:
    chequer = (np.indices((75 * 8, 100 * 8)).sum(axis=0) % 2 * 255).astype(np.uint8)
    frame = render(Scene(quads=(quad(chequer),)), CAMERA, FACING, renderer="exact")
    assert np.allclose(frame.linear, 127.5, atol=0.05)
    assert np.array_equal(frame.image, np.rint(frame.linear).astype(np.uint8))


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("renderer", ["exact", pytest.param("gl", marks=needs_gl)])
def test_10_of_touching_surfaces_the_later_is_seen(order: tuple[int, int], renderer: Renderer) -> None:
    pair = [quad(np.full((1, 1), level, np.uint8), name=str(level)) for level in (40, 90)]
    frame = render(Scene(quads=tuple(pair[k] for k in order)), CAMERA, FACING, renderer=renderer)
    assert (frame.image == (40, 90)[order[-1]]).all()


def test_11_a_frames_noise_depends_on_the_seed_and_its_index_alone() -> None:
    setup = load_scene("floor")
    small = setup.__class__(setup.scene, CAMERA, setup.trajectory, setup.sensor)
    config = FloorConfig(renderer="exact", seed=7)
    later = render_view(small, config, 3, 1.0).frame.image
    render_view(small, config, 1, 0.5)
    assert np.array_equal(render_view(small, config, 3, 1.0).frame.image, later)
    assert not np.array_equal(render_view(small, config, 4, 1.0).frame.image, later)


def test_12_a_dark_marker_has_laplacian_plus_one() -> None:
    for polarity, sign in (("dark", 1), ("light", -1)):
        assert surf.detect(marker_view(60, polarity=polarity))[0].laplacian.tolist() == [sign]  # type: ignore[arg-type]


def test_13_each_row_of_a_rolling_shutter_has_its_own_time() -> None:
    rolling = replace(CAMERA, row_time_s=0.01)
    trajectory = Trajectory(np.array([0.0, 2.0]), np.stack([FACING, FACING @ compose(np.eye(3), [0.5, 0, 0])]))
    posed = PosedCamera(rolling, trajectory, 1.0)
    for x, y in posed.project([[0.2, 0.2, 0], [0.25, -0.3, 0], [0.3, 0, 0]]):
        own = trajectory.at(1.0 + (y - 14.5) * 0.01)
        point = transform(own, 1.0 * CAMERA.unproject([[x, y]]))
        assert np.allclose(posed.project(point), [[x, y]], atol=1e-8)


def test_14_the_affinity_maps_sides_right_and_down() -> None:
    upright = Quad("q", Texture.from_array(np.zeros((1, 1), np.uint8)), (0.25, 0.25), np.eye(4), marker="m")
    rotated = FACING @ compose(rotation_about("z", 90), np.zeros(3))  # the camera rotates clockwise, the image back
    for pose, expected in ((FACING, [[10, 0], [0, 10]]), (rotated, [[0, 10], [-10, 0]])):
        assert np.allclose(render(Scene((upright,)), CAMERA, pose, renderer="exact").truth[0].affinity, expected)


def test_15_light_is_one_and_the_first_marker_counts_most() -> None:
    assert [polarities_of(code) for code in (0, 1, 4)] == [
        ("dark", "dark", "dark"),
        ("dark", "dark", "light"),
        ("light", "dark", "dark"),
    ]
    assert THREE_BIT.cells == ((1, 0), (0, 1), (1, 1))
    laplacian = {p: surf.detect(marker_view(60, polarity=p))[0].laplacian[0] for p in polarities_of(1)}  # type: ignore[arg-type]
    bits = [int(laplacian[p] < 0) for p in polarities_of(6)]
    assert 4 * bits[0] + 2 * bits[1] + bits[2] == 6
