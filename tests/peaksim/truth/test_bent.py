"""Truth of markers on bent paper, against images of it and rays through a cylinder."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from peaksim import Mark, Mesh, Quad, Scene, Texture, Trajectory, render
from peaksim.camera.camera import resized
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.polygon import polygon_area
from peaksim.geometry.pose import compose, look_at

from tests.peaksim.scene.test_bend import CAMERA, SHEET_M, VIEWS, bent
from tests.peaksim.traced.helpers import assert_within_noise, needs_tracing
from tests.peaksim.views import LENSES


def spotted(quad: Quad) -> Quad:
    """Return a sheet with a dark disc of 6 mm in the middle of its marker, and the marker of that size."""
    x, y = np.meshgrid((np.arange(900) + 0.5) / 3000 - 0.15, 0.1 - (np.arange(600) + 0.5) / 3000)
    (mark,) = quad.marks
    disc = np.hypot(x - mark.center_m[0], y - mark.center_m[1]) < 0.003
    print_ = Texture.from_array(np.where(disc, 0, 255).astype(np.uint8))
    return replace(quad, texture=print_, marker=replace(mark, side_m=0.006))


@pytest.mark.parametrize(("radius_m", "axis", "lens", "eye_m"), VIEWS[:5])
def test_centres_are_those_of_blobs(
    radius_m: float, axis: Literal["x", "y"], lens: str, eye_m: tuple[float, ...]
) -> None:
    camera = resized(CAMERA, 8) if lens == "pinhole" else LENSES[lens]
    quad = spotted(bent(radius_m, axis))
    frame = render(Scene((quad,), background=255.0), camera, look_at(eye_m, (0.02, 0, 0.03)), "exact")
    (truth,) = frame.truth
    assert truth.visible_fraction == pytest.approx(1, abs=1e-9)
    x, y = np.rint(truth.center_xy).astype(int)
    dark = 255 - frame.linear[y - 15 : y + 16, x - 15 : x + 16].astype(float)
    rows, columns = np.mgrid[y - 15 : y + 16, x - 15 : x + 16]
    centroid = np.array([(dark * columns).sum(), (dark * rows).sum()]) / dark.sum()
    assert np.abs(centroid - truth.ellipse.center_xy).max() < 0.02
    assert np.abs(centroid - truth.center_xy).max() < 0.1  # perspective and curvature move the centre of a disc
    assert dark.sum() / 255 == pytest.approx(np.pi / 4 * truth.side_px**2, rel=0.02)
    across, down = truth.affinity.T
    assert abs(across[0] * down[1] - across[1] * down[0]) == pytest.approx(truth.side_px**2, rel=0.02)


@pytest.mark.parametrize(("radius_m", "axis", "lens", "eye_m"), [*VIEWS, (0.06, "y", "pinhole", (-0.3, -0.25, 0.2))])
def test_outlines_and_visible_shares_are_those_of_pixels(
    radius_m: float, axis: Literal["x", "y"], lens: str, eye_m: tuple[float, ...]
) -> None:
    """A marker is painted white on black: the white area in the image is what is seen of it."""
    camera = resized(CAMERA, 4) if lens == "pinhole" else resized(LENSES[lens], 0.5)
    quad = bent(radius_m, axis)
    (mark,) = quad.marks
    x, y = np.meshgrid((np.arange(600) + 0.5) / 2000 - 0.15, 0.1 - (np.arange(400) + 0.5) / 2000)
    inside = np.maximum(np.abs(x - mark.center_m[0]), np.abs(y - mark.center_m[1])) < mark.side_m / 2
    quad = replace(quad, texture=Texture.from_array(np.where(inside, 255, 0).astype(np.uint8)))
    hull = np.array([[-0.3, -0.3, 0.02], [0.06, -0.3, 0.02], [0.06, -0.3, 0.3]])
    for meshes in ((), (Mesh("m", hull, np.array([[0, 1, 2]]), color=(0, 0, 0)),)):
        scene = Scene((quad,), meshes, background=0.0)
        pose = look_at(eye_m, (0.02, 0, 0.03))
        frame = render(scene, camera, pose, "exact")
        backs = render(replace(scene, quads=(replace(quad, texture=BLACK),)), camera, pose, "exact").linear
        (truth,) = frame.truth
        white_px2 = float((frame.linear - backs).sum()) / 255
        total_px2 = _unsigned_area(quad, mark, frame.posed_camera)
        assert truth.visible_fraction == pytest.approx(white_px2 / total_px2, abs=0.012)
    assert truth.outline_xy.shape == (64, 2)
    assert np.allclose(truth.outline_xy[::16], truth.corners_xy)


BLACK = Texture.from_array(np.zeros((1, 1), np.uint8))


def _unsigned_area(quad: Quad, mark: Mark, posed: PosedCamera) -> float:
    """Return the image area of a pattern, where it faces away too, from a fine grid of it."""
    steps = (np.arange(201) / 200 - 0.5) * mark.side_m
    xy = np.stack(np.meshgrid(steps + mark.center_m[0], steps + mark.center_m[1]), axis=2)
    grid = posed.project(quad.points_m(xy.reshape(-1, 2))).reshape(201, 201, 2)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    one, two = c - a, d - b
    return float(np.abs(one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]).sum() / 2)


def test_a_nearly_flat_sheet_has_the_truth_of_a_flat_one() -> None:
    camera, pose = resized(CAMERA, 8), look_at((0.1, -0.3, 0.25), (0.02, 0, 0.03))
    for axis in ("x", "y"):
        quad = bent(5e4, axis)  # type: ignore[arg-type]
        curved, flat = (render(Scene((q,)), camera, pose, "exact") for q in (quad, replace(quad, bend=None)))
        assert np.abs(curved.linear - flat.linear).max() < 0.1
        (a,), (b,) = curved.truth, flat.truth
        assert np.allclose(a.corners_xy, b.corners_xy, atol=1e-3)
        assert np.allclose(a.affinity, b.affinity, atol=1e-3)
        assert np.allclose(
            [*a.ellipse.semi_axes_px, a.ellipse.angle_deg], [*b.ellipse.semi_axes_px, b.ellipse.angle_deg]
        )
        assert a.tilt_deg == pytest.approx(b.tilt_deg, abs=1e-4)
        assert a.visible_fraction == pytest.approx(b.visible_fraction, abs=1e-6)
        assert abs(abs(polygon_area(a.outline_xy)) - b.side_px**2) < 0.05
        assert np.allclose(curved.normals, flat.normals, atol=1e-4)
        assert np.array_equal(curved.quad_ids, flat.quad_ids)


def test_depth_and_normals_are_those_of_the_cylinder() -> None:
    camera = CAMERA
    quad = bent(0.1, "y")
    frame = render(Scene((quad,)), camera, look_at((0.1, -0.3, 0.15), (0.02, 0, 0.03)), "exact")
    hit = frame.quad_ids == 0
    _, rays, world = frame.posed_camera.rays(camera.pixel_centers())
    points = frame.world_from_camera[:3, 3] + (frame.depth_m.ravel() / rays[:, 2])[:, None] * world
    local = (points[hit.ravel()] - quad.world_from_quad[:3, 3]) @ quad.world_from_quad[:3, :3]
    assert np.abs(np.hypot(local[:, 0], local[:, 2] + 0.1) - 0.1).max() < 2e-6
    outward = np.stack([local[:, 0], 0 * local[:, 0], local[:, 2] + 0.1], axis=1) / 0.1
    expected = outward @ quad.world_from_quad[:3, :3].T @ frame.world_from_camera[:3, :3]
    facing = (expected * rays[hit.ravel()]).sum(axis=1) < 0
    assert np.allclose(frame.normals[hit][facing], expected[facing], atol=1e-4)


def test_a_moving_camera_sees_bent_paper_row_by_row() -> None:
    camera = replace(resized(CAMERA, 4), row_time_s=1e-3)
    pose = look_at((0.1, -0.3, 0.15), (0.02, 0, 0.03))
    path = Trajectory(np.array([0.0, 1.0]), np.stack([pose, pose @ compose(np.eye(3), [0.05, 0, 0])]))
    quad = spotted(bent(0.1, "y"))
    frame = render(Scene((quad,), background=255.0), camera, path, "exact", time_s=0.5)
    (truth,) = frame.truth
    dark = 255 - frame.linear.astype(float)
    dark[np.hypot(*(camera.pixel_centers() - truth.center_xy).transpose(2, 0, 1)) > 10] = 0
    centroid = (dark[..., None] * camera.pixel_centers()).sum(axis=(0, 1)) / dark.sum()
    assert np.abs(centroid - truth.ellipse.center_xy).max() < 0.02


@needs_tracing
def test_path_traced_bent_paper_is_that_of_the_exact_renderer() -> None:
    for radius_m, axis, _, eye_m in VIEWS[:2]:
        scene, pose = Scene((bent(radius_m, axis),)), look_at(eye_m, (0.02, 0, 0.03))
        rounds = np.array([render(scene, CAMERA, pose, "traced", samples=32, seed=k).linear for k in range(6)])
        assert_within_noise(rounds, render(scene, CAMERA, pose, "exact").linear, 0.5)


def test_bent_paper_hides_and_is_hidden() -> None:
    tube = replace(bent(0.1, "y"), marker=None)
    behind = Quad("behind", BLACK, SHEET_M, tube.world_from_quad @ compose(np.eye(3), [0, 0, -0.3]), "any")
    eye = tube.world_from_quad[:3, 3] + 0.6 * tube.world_from_quad[:3, 2]
    pose = look_at(eye, tube.world_from_quad[:3, 3])
    frame = render(Scene((behind, tube)), resized(CAMERA, 4), pose, "exact")
    assert {0, 1} <= set(np.unique(frame.quad_ids).tolist())
    (truth,) = frame.truth
    shown = (frame.quad_ids == 0).sum()
    alone = (render(Scene((behind,)), resized(CAMERA, 4), pose, "exact").quad_ids == 0).sum()
    x_share = truth.visible_fraction  # the marker fills the middle of the sheet, which the tube covers
    assert 0 <= x_share < shown / alone < 1
