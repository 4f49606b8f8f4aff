"""Visible fractions that are known without sampling agree with sampled ones, whatever stands between."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.area.rays import solids_of
from peaksim.camera.camera import Camera
from peaksim.camera.shutter import PosedCamera, still_camera
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.scene.scene import Mark, Quad, Scene, rectangle_m
from peaksim.scene.texture import Texture
from peaksim.truth.markers import (
    area_weights,
    face_corners_m,
    find_hidden,
    marker_truth,
    polygon_area,
    visible_fraction,
)

from tests.peaksim.truth.hiding_reference import faces_before, may_hide

CAMERAS = (
    Camera(320, 240, 250.0, 250.0, 159.5, 119.5),
    Camera(320, 240, 250.0, 250.0, 159.5, 119.5, distortion=(-0.25, 0.05, 0.0, 0.0)),
    Camera(320, 240, 150.0, 150.0, 159.5, 119.5, model="fisheye"),
)
GREY = Texture.from_array(np.full((2, 2), 128, np.uint8))


def random_scene(rng: np.random.Generator) -> Scene:
    """Return a poster of nine marks before a wall, with cards around and between it and the camera."""
    marks = tuple(Mark(f"m{x}{y}", "any", 0.2, (0.3 * x, 0.3 * y)) for x in (-1, 0, 1) for y in (-1, 0, 1))
    poster = Quad("poster", GREY, (0.9, 0.9), np.eye(4), marks)
    wall = Quad("wall", GREY, (4.0, 4.0), compose(np.eye(3), [0, 0, -0.002]))
    cards = []
    for k in range(int(rng.integers(0, 5))):
        rotation = rotation_about("x", rng.uniform(0, 360)) @ rotation_about("y", rng.uniform(0, 360))
        position = [*rng.uniform(-0.8, 0.8, 2), rng.uniform(-0.5, 2.5)]
        cards.append(Quad(f"card{k}", GREY, tuple(rng.uniform(0.05, 0.6, 2)), compose(rotation, position)))
    return Scene(quads=(wall, poster, *cards))


@given(st.integers(0, 2**32))
def test_certain_fractions_are_those_that_sampling_gives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = random_scene(rng)
    eye, target = [*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.8, 2.5)], [*rng.uniform(-0.7, 0.7, 2), 0.0]
    posed = still_camera(CAMERAS[seed % 3], look_at(eye, target, up=(0.1, 1, 0)))
    solids = solids_of(scene, quads=True)
    poster = scene.quads[1]
    for truth, mark in zip(marker_truth(scene, posed), poster.marks, strict=True):
        corners = rectangle_m(poster, mark.center_m, (mark.side_m, mark.side_m))
        sampled = visible_fraction(posed, solids, 1, corners)
        cut_exactly = 0 < truth.visible_fraction < 1 and not may_hide_any(scene, posed, corners)
        assert abs(truth.visible_fraction - sampled) <= (0.012 if cut_exactly else 1e-12)


def may_hide_any(scene: Scene, posed: PosedCamera, corners: np.ndarray) -> bool:
    """Return whether any quad but the poster may lie before a rectangle."""
    others = np.array([quad.corners_m for quad in scene.quads if quad.name != "poster"])
    return bool(may_hide(posed.pose[:3, 3], corners, others).any())


@pytest.mark.parametrize("angle_deg", [0.0, 17.0])
def test_of_sheets_in_one_plane_the_later_one_is_seen(angle_deg: float) -> None:
    """The sheet covers the right half of the marker."""
    poses = [compose(rotation_about("y", angle_deg), rotation_about("y", angle_deg) @ [x, 0, 0]) for x in (0.0, 0.5)]
    marker, sheet = Quad("marker", GREY, (1, 1), poses[0], "any"), Quad("sheet", GREY, (1, 2), poses[1])
    posed = still_camera(CAMERAS[0], look_at([0.3, -1.0, 4.0], [0, 0, 0]))
    assert marker_truth(Scene(quads=(sheet, marker)), posed)[0].visible_fraction == 1.0
    (truth,) = marker_truth(Scene(quads=(marker, sheet)), posed)
    parts = rectangle_m(marker, (-0.25, 0), (0.5, 1)), marker.corners_m
    left_half, whole = (polygon_area(posed.project(part)) for part in parts)
    assert truth.visible_fraction == pytest.approx(left_half / whole, abs=0.01)
    faces = np.stack([marker.corners_m, sheet.corners_m])
    assert np.array_equal(faces_before(faces, 0), faces[1:])
    assert len(faces_before(faces, 1)) == 0
    assert np.array_equal(faces_before(faces + np.array([[[0]], [[0.01]]]), 1), faces[:1])


@given(st.floats(0, 6.28), st.floats(-1.2, 1.2), st.floats(0.6, 3.0))
def test_what_the_border_cuts_off_is_exact(angle_rad: float, aside: float, height: float) -> None:
    scene = Scene(quads=(Quad("marker", GREY, (0.5, 0.5), np.eye(4), "any"),))
    posed = still_camera(
        CAMERAS[0], look_at([0.0, -0.3, height], [aside, 0.1, 0], up=(np.sin(angle_rad), np.cos(angle_rad), 0.2))
    )
    (truth,) = marker_truth(scene, posed)
    frame = np.array([[-0.5, -0.5], [319.5, -0.5], [319.5, 239.5], [-0.5, 239.5]], np.float32)
    inside, _ = cv2.intersectConvexConvex(truth.corners_xy.astype(np.float32), frame)
    assert truth.visible_fraction == pytest.approx(inside / truth.side_px**2, abs=1e-4)


@given(st.integers(0, 2**32))
def test_patches_weigh_what_they_cover_in_the_image(seed: int) -> None:
    rng = np.random.default_rng(seed)
    marker = Quad("marker", GREY, (0.4, 0.4), compose(rotation_about("x", rng.uniform(0, 60)), [0, 0, 0]))
    posed = still_camera(CAMERAS[0], look_at(rng.uniform([-1, -1, 1], [1, 1, 3]), [0, 0, 0]))
    centers = rng.uniform(-0.19, 0.19, (20, 2))
    areas = [polygon_area(posed.project(rectangle_m(marker, (x, y), (1e-3, 1e-3)))) for x, y in centers]
    points = np.array([rectangle_m(marker, (x, y), (1e-3, 1e-3)).mean(axis=0) for x, y in centers])
    weights = area_weights(posed, points, marker.corners_m)
    assert area_weights(posed, points - 10 * posed.pose[:3, 2], marker.corners_m).tolist() == [0.0] * 20
    assert np.allclose(weights / weights.sum(), np.array(areas) / np.sum(areas), rtol=1e-5)


def test_a_card_hides_what_lies_behind_it_only() -> None:
    square = rectangle_m(Quad("q", GREY, (1, 1), np.eye(4)), (0, 0), (1, 1))
    eye = np.array([0.0, 0.0, 2.0])

    def card(x: float, z: float, tilt: float = 0.0) -> Quad:
        return Quad("c", GREY, (0.4, 0.4), compose(rotation_about("y", tilt), [x, 0, z]))

    before = [card(0, 1), card(0.44, 1.0)]
    beside = [card(0.46, 1.0), card(0.8, 0.1), card(0, -0.1), card(0, 2.5), card(0.6, 1, 90)]
    faces = face_corners_m(Scene(quads=tuple(before[:1])))
    assert np.array_equal(faces, before[0].corners_m[None])
    assert all(may_hide(eye, square, c.corners_m[None])[0] for c in before)
    assert not any(may_hide(eye, square, c.corners_m[None])[0] for c in beside)
    assert may_hide(eye, square, np.zeros((0, 4, 3))).shape == (0,)


@given(st.integers(0, 2**32))
def test_something_lies_between_where_plain_numpy_says_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = random_scene(rng)
    faces, poster = face_corners_m(scene), scene.quads[1]
    posed = still_camera(CAMERAS[0], look_at([*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.1, 2.5)], [0, 0, 0]))
    squares = np.array([rectangle_m(poster, tuple(rng.uniform(-0.4, 0.4, 2)), (0.1, 0.1)) for _ in range(12)])
    numbers = np.where(np.arange(12) % 3, 1, 0)  # some are said to lie on the wall, which the poster hides
    xy = posed.project(squares.reshape(-1, 3)).reshape(-1, 4, 2)
    hidden = find_hidden(scene, posed, numbers, squares, xy)
    plain = [
        bool(may_hide(posed.pose[:3, 3], square, faces_before(faces, number)).any())
        for square, number in zip(squares, numbers, strict=True)
    ]
    assert hidden.tolist() == plain
    assert find_hidden(scene, posed, numbers[:0], squares[:0], xy[:0]).shape == (0,)


def counted_fraction(scene: Scene, posed: PosedCamera, corners: np.ndarray, side: int = 200) -> float:
    """Return the visible share of a rectangle by casting side² rays over its box in the image and beyond."""
    rim = corners[[0, 1, 2, 3, 0]]
    steps = np.linspace(0, 1, 20)[:, None]
    edges_xy = posed.project(np.concatenate([a + steps * (b - a) for a, b in pairwise(rim)]))
    (x0, y0), (x1, y1) = edges_xy.min(axis=0), edges_xy.max(axis=0)
    x, y = np.meshgrid(*(low + (np.arange(side) + 0.5) / side * (high - low) for low, high in ((x0, x1), (y0, y1))))
    xy = np.stack([x.ravel(), y.ravel()], axis=1)
    _, _, rays = posed.rays(xy)
    eye = posed.pose[:3, 3]
    reach, on_mark = _plane_hits(eye, rays, corners)
    free = np.ones(len(rays), dtype=bool)
    for quad in scene.quads:
        if quad.name != "poster":
            other, hit = _plane_hits(eye, rays, quad.corners_m)
            free &= ~(hit & (other < reach))
    inside = ((xy >= -0.5) & (xy <= [posed.camera.width - 0.5, posed.camera.height - 0.5])).all(axis=1)
    whole, own = int(on_mark.sum()), int((on_mark & free & inside).sum())
    return own / whole if whole else 0.0


def _plane_hits(eye: np.ndarray, rays: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the parameters at which rays meet a rectangle's plane, and whether that is within it and ahead."""
    across, down = corners[1] - corners[0], corners[3] - corners[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((corners[0] - eye) @ np.cross(across, down)) / (rays @ np.cross(across, down))
        local = eye + t[:, None] * rays - corners[0]
        u, v = local @ across / (across @ across), local @ down / (down @ down)
    return t, (t > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)


def test_visible_fractions_are_those_of_a_count_for_a_hundred_occlusions() -> None:
    rng = np.random.default_rng(5)
    partly = 0
    while partly < 100:
        scene, (x, y) = random_scene(rng), rng.uniform(-0.9, 0.9, 2)
        camera = CAMERAS[partly % 3]
        posed = still_camera(
            camera, look_at([*rng.uniform(-1.5, 1.5, 2), rng.uniform(1, 2)], [x, y, 0], up=(0.1, 1, 0))
        )
        poster = scene.quads[1]
        for truth, mark in zip(marker_truth(scene, posed), poster.marks, strict=True):
            if 0 < truth.visible_fraction < 1:
                corners = rectangle_m(poster, mark.center_m, (mark.side_m, mark.side_m))
                assert abs(truth.visible_fraction - counted_fraction(scene, posed, corners)) < 0.01
                partly += 1
