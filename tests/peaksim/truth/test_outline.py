"""What is seen of markers that reach behind the camera, and through lenses, against counts of pixels."""

from functools import cache

import numpy as np
import pytest
from peaksim import Camera, Mark, Quad, Scene, Texture, render
from peaksim.camera.camera import resized
from peaksim.camera.frame import Frame
from peaksim.geometry.polygon import polygon_area
from peaksim.geometry.pose import Pose, compose, invert, rotation_about, transform
from peaksim.geometry.trajectory import Trajectory
from peaksim.truth.outline import part_before, seen_outline

from tests.peaksim.views import LENSES

SIDE_M = 0.8
GREY = Texture.from_array(np.full((2, 2), 200, np.uint8))
MARKER = Quad("marker", GREY, (SIDE_M, SIDE_M), np.eye(4), Mark("m", "any", SIDE_M))
CARD = Quad("card", GREY, (0.02, 0.02), compose(np.eye(3), [0.0, 0.03, 0.01]))
PINHOLE = Camera(160, 120, 140.0, 140.0, 79.5, 59.5)
BARREL = Camera(160, 120, 120.0, 125.0, 77.0, 62.0, (-0.25, 0.06, 0.002, -0.001))
PINCUSHION = Camera(160, 120, 140.0, 140.0, 79.5, 59.5, (0.2, 0.05, 0.0, 0.0))
TILTED, WIDE = (resized(LENSES[name], 0.25) for name in ("tilted14", "wide fisheye"))
RAY_PX = 0.125
HEIGHTS_M = (0.03, 0.06, 0.12, 0.3)
TILTS_DEG = (15.0, 40.0, 65.0, 80.0)


def above(height_m: float, tilt_deg: float, turn_deg: float = 20.0) -> Pose:
    """Return a camera above the marker's middle that looks down at a tilt; 90° looks along the floor."""
    down = np.diag([1.0, -1.0, -1.0])
    return compose(rotation_about("z", turn_deg) @ down @ rotation_about("x", tilt_deg), [0.01, -0.02, height_m])


def in_camera(pose: Pose) -> np.ndarray:
    return transform(invert(pose), MARKER.corners_m)


def counted_share(frame: Frame, height_m: float) -> float:
    """Return the printed share that the pixels show: each stands for the patch of the floor that it sees."""
    depth_m, camera = frame.depth_m[frame.quad_ids == 0].astype(np.float64), frame.camera
    patches_m2 = depth_m**3 / (height_m * camera.fx * camera.fy)
    return float(patches_m2.sum() / SIDE_M**2)


@pytest.mark.parametrize("height_m", HEIGHTS_M)
@pytest.mark.parametrize("tilt_deg", TILTS_DEG)
@pytest.mark.parametrize("quads", [(MARKER,), (MARKER, CARD)])
def test_a_marker_that_reaches_behind_the_camera_is_as_visible_as_its_pixels_say(
    height_m: float, tilt_deg: float, quads: tuple[Quad, ...]
) -> None:
    fine = Camera(640, 480, 560.0, 560.0, 319.5, 239.5)  # sees the same as PINHOLE
    pose = above(height_m, tilt_deg)
    (truth,) = render(Scene(quads), PINHOLE, pose, renderer="exact").truth
    frame = render(Scene(quads), fine, pose, renderer="exact")
    shown = int((frame.quad_ids == 0).sum())
    assert (in_camera(pose)[:, 2] < 0).any() or tilt_deg == TILTS_DEG[0]
    assert 0 < truth.visible_fraction <= 1
    if (in_camera(pose)[:, 2] < 0).any():
        assert truth.visible_fraction == pytest.approx(counted_share(frame, height_m), rel=0.02)
        if len(quads) == 1:
            assert truth.side_px == pytest.approx(np.sqrt(shown) / 4, rel=0.01)


@cache
def rays_of(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 2) px all over the image and the (3, n) rays that they see."""
    grid = np.meshgrid(*(np.arange(-0.5 + RAY_PX / 2, n - 0.5, RAY_PX) for n in (camera.width, camera.height)))
    xy = np.stack(grid, axis=2).reshape(-1, 2)
    return xy, np.ascontiguousarray(camera.unproject(xy).T, dtype=np.float32)


@pytest.mark.parametrize("camera", [PINHOLE, BARREL, PINCUSHION, TILTED, WIDE])
@pytest.mark.parametrize("height_m", HEIGHTS_M)
@pytest.mark.parametrize("tilt_deg", TILTS_DEG)
def test_outlines_are_those_of_the_pixels(camera: Camera, height_m: float, tilt_deg: float) -> None:
    pose = above(height_m, tilt_deg)
    xy, rays = rays_of(camera)
    x, y, z = pose[:3, :3].astype(np.float32) @ rays
    ahead = -float(pose[2, 3]) / z  # where a ray meets the floor, in its lengths
    shown = xy[
        (ahead > 0) & (np.maximum(abs(float(pose[0, 3]) + ahead * x), abs(float(pose[1, 3]) + ahead * y)) <= SIDE_M / 2)
    ]
    outline = seen_outline(camera, in_camera(pose))
    assert np.abs(outline.min(axis=0) - shown.min(axis=0)).max() <= 0.5
    assert np.abs(outline.max(axis=0) - shown.max(axis=0)).max() <= 0.5
    assert abs(polygon_area(outline)) == pytest.approx(len(shown) * RAY_PX**2, rel=0.005)


def test_a_bent_side_is_followed_to_a_fraction_of_a_pixel() -> None:
    camera = LENSES["brown4"]
    corners = np.array([[-0.55, -0.4, 1], [0.55, -0.4, 1], [0.55, 0.4, 1], [-0.55, 0.4, 1.0]])
    steps = np.linspace(0, 1, 20_000)[:, None]
    rim = np.concatenate([a + steps * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
    exact = camera.project(rim)
    outline = seen_outline(camera, corners)
    assert len(outline) < 200
    assert np.allclose([outline.min(axis=0), outline.max(axis=0)], [exact.min(axis=0), exact.max(axis=0)], atol=0.05)
    assert polygon_area(outline) == pytest.approx(polygon_area(exact), rel=2e-4)
    straight = polygon_area(camera.project(corners))
    assert abs(straight - polygon_area(exact)) > 5000


def test_nothing_is_seen_of_what_is_wholly_behind_or_beside() -> None:
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    for shift in ([0, 0, -1.0], [30.0, 0, 1.0]):
        assert seen_outline(PINHOLE, square + shift).shape == (0, 2)
        assert len(part_before(PINHOLE, square + shift)) == 0


def test_a_rolling_shutter_above_a_marker_has_its_truth_too() -> None:
    camera = Camera(160, 120, 140.0, 140.0, 79.5, 59.5, row_time_s=1e-4)
    poses = np.stack([above(0.1, 65.0), above(0.1, 65.0) @ compose(np.eye(3), [0.004, 0.0, 0.0])])
    frame = render(Scene((MARKER, CARD)), camera, Trajectory(np.array([-1.0, 1.0]), poses), renderer="exact")
    still = render(Scene((MARKER, CARD)), PINHOLE, above(0.1, 65.0), renderer="exact")
    assert frame.truth[0].visible_fraction == pytest.approx(still.truth[0].visible_fraction, rel=0.05)
