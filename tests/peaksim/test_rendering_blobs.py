"""Where blobs are in the image is where the truth says: at 200 random points and in the corners, for every camera."""

from dataclasses import replace

import numpy as np
import pytest
from peaksim import Camera, Quad, Scene, Texture, Trajectory, render
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.pose import compose, look_at, rotation_about
from peaksim.rendering import Renderer

from tests.helpers import needs_gl

PINHOLE = Camera(width=640, height=480, fx=500.0, fy=510.0, cx=310.0, cy=250.0)
BROWN = replace(PINHOLE, distortion=(-0.28, 0.09, 0.001, -0.002, -0.01))
RATIONAL = replace(PINHOLE, distortion=(0.1, -0.05, 0.001, 0.0005, 0.02, 0.35, -0.02, 0.01))
FISHEYE = Camera(640, 480, 280.0, 280.0, 322.0, 236.0, (-0.02, 0.004, -0.001, 0.0002), model="fisheye")
START = look_at([1.0, -2.0, 1.5], [0.3, 1.0, 1.0]) @ compose(rotation_about("z", 12), np.zeros(3))
BLOB_PX = 8.0
# smooth: a sharp blob's centroid aliases
_LINE = np.exp(-(np.linspace(-5, 5, 61) ** 2) / 2)
BLOB = Texture.from_array(np.rint(255 * _LINE[:, None] * _LINE).astype(np.uint8))


def moving(metres: tuple[float, float, float], turn_deg: float) -> Trajectory:
    """Return a second of motion that begins before the start pose and ends behind it."""
    poses = [
        START
        @ compose(
            rotation_about("y", k * turn_deg / 2) @ rotation_about("z", k * turn_deg / 3), k * np.array(metres) / 2
        )
        for k in (-1.0, -0.3, 0.4, 1.0)
    ]
    return Trajectory(np.array([-0.5, -0.15, 0.2, 0.5]), np.stack(poses))


def image_points(camera: Camera, inset_px: float) -> np.ndarray:
    """Return (200, 2) random px that lie apart, the corners among them."""
    rng = np.random.default_rng(7)
    x, y = np.meshgrid((np.arange(20) + 0.5) * camera.width / 20, (np.arange(10) + 0.5) * camera.height / 10)
    xy = np.stack([x.ravel(), y.ravel()], axis=1) - 0.5 + rng.uniform(-6, 6, (200, 2))
    low, high = inset_px - 0.5, np.array([camera.width, camera.height]) - 0.5 - inset_px
    xy[[0, 19, 180, 199]] = [[low, low], [high[0], low], [low, high[1]], [high[0], high[1]]]
    return xy


def blobs(posed: PosedCamera, xy: np.ndarray) -> Scene:
    """Return Gaussian blobs that face the camera, on squares of about `BLOB_PX`, at (n, 2) px and random distances."""
    rng = np.random.default_rng(8)
    quads = []
    _, _, rays = PosedCamera(replace(posed.camera, row_time_s=0.0), posed.trajectory, posed.time_s).rays(xy)
    for k, ray in enumerate(rays / np.linalg.norm(rays, axis=1, keepdims=True)):
        distance = rng.uniform(1.0, 6.0)
        center = posed.pose[:3, 3] + distance * ray
        side = BLOB_PX * distance / posed.camera.fx
        down = posed.pose[:3, 1] - (posed.pose[:3, 1] @ ray) * ray
        down /= np.linalg.norm(down)
        facing = np.stack([np.cross(down, ray), -down, -ray], axis=1)
        quads.append(Quad(f"blob{k}", BLOB, (side, side), compose(facing, center), marker="blob"))
    return Scene(tuple(quads), background=0.0)


def centroids(linear: np.ndarray, around_xy: np.ndarray, reach_px: int) -> np.ndarray:
    """Return the (n, 2) centres of gravity within `reach_px` of (n, 2) px."""
    out = []
    for x, y in np.rint(around_xy).astype(int):
        rows = slice(max(y - reach_px, 0), y + reach_px + 1)
        columns = slice(max(x - reach_px, 0), x + reach_px + 1)
        part = linear[rows, columns].astype(np.float64)
        u, v = np.arange(part.shape[1]) + columns.start, np.arange(part.shape[0]) + rows.start
        out.append([(part.sum(axis=0) * u).sum() / part.sum(), (part.sum(axis=1) * v).sum() / part.sum()])
    return np.array(out)


CASES = {
    "pinhole": (PINHOLE, None, 0.01),
    "brown": (BROWN, None, 0.02),
    "rational": (RATIONAL, None, 0.02),
    "fisheye": (FISHEYE, None, 0.02),
    "rolling shutter": (replace(PINHOLE, row_time_s=4e-5), moving((0.6, 0.3, 0.2), 25.0), 0.02),
    "rolling shutter and lens": (replace(BROWN, row_time_s=4e-5), moving((0.6, 0.3, 0.2), 25.0), 0.02),
    # longer blurs shift the blob's weight: it grows towards the border
    "blur": (replace(PINHOLE, exposure_s=0.012), moving((0.6, 0.3, 0.2), 25.0), 0.02),
    "blur and rolling shutter": (replace(PINHOLE, exposure_s=0.01, row_time_s=4e-5), moving((0.5, 0, 0), 15.0), 0.02),
}


@pytest.mark.parametrize("name", CASES)
def test_blobs_are_where_truth_says(name: str) -> None:
    camera, trajectory, tolerance = CASES[name]
    assert errors_px(camera, trajectory, "exact").max() < tolerance


@needs_gl
@pytest.mark.parametrize("name", ["pinhole", "rational", "fisheye", "blur"])
def test_opengl_puts_blobs_where_truth_says(name: str) -> None:
    camera, trajectory, tolerance = CASES[name]
    assert errors_px(camera, trajectory, "gl").max() < tolerance


def errors_px(camera: Camera, trajectory: Trajectory | None, renderer: Renderer) -> np.ndarray:
    """Return the 200 distances of rendered blobs' centroids from their truth, px."""
    motion = trajectory or Trajectory(np.zeros(1), START[None])
    posed = PosedCamera(camera, motion)
    scene = blobs(posed, image_points(camera, 12 if trajectory else 7))
    frame = render(scene, camera, motion if trajectory else START, renderer=renderer)
    truth = np.array([t.blur_mean_xy for t in frame.truth])
    assert len(truth) == 200
    if trajectory is None:
        assert np.array_equal(truth, [t.center_xy for t in frame.truth])
    found = centroids(frame.linear, truth, 10 if posed.is_blurred else 7)
    return np.linalg.norm(found - truth, axis=1)
