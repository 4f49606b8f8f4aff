"""Views of one marker by the exact renderer, of any kind, size and tilt: what centres are measured on."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import compose, rotation_about
from peaksim.rendering import render
from peaksim.scene.scene import Mark, Quad, Scene
from peaksim.scene.texture import Texture

from peakmark.markers.patterns import Variant, marker_image

WIDTH, HEIGHT = 800, 600

_TEXELS = 480
_SIDE_M = 0.06


@dataclass(frozen=True)
class CenterView:
    """One marker on white paper, at a random place, rotation and direction of tilt, and what is true of it."""

    levels: NDArray[np.float64]
    """(H, W) grey levels without noise, blurred by a σ of up to 0.8 px."""
    center_xy: NDArray[np.float64]
    """(2,) px."""
    side_px: float
    """Square root of the marker's area at its centre."""
    focal_px: float
    """Of the camera, without distortion, whose axis meets the middle of the image."""

    def noisy(self, rng: np.random.Generator, sigma: float) -> NDArray[np.uint8]:
        """Return the (H, W) image under noise of σ grey levels."""
        return np.clip(np.rint(self.levels + sigma * rng.standard_normal(self.levels.shape)), 0, 255).astype(np.uint8)


def render_view(rng: np.random.Generator, variant: Variant, side_px: float, tilt_deg: float) -> CenterView:
    """Return a view of a marker, by a camera of a focal length of 500…1500 px."""
    focal = float(np.exp(rng.uniform(np.log(500), np.log(1500))))
    camera = Camera(WIDTH, HEIGHT, focal, focal, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    distance = focal * _SIDE_M / side_px * np.sqrt(np.cos(np.radians(tilt_deg)))
    turn = rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", tilt_deg)
    turn = turn @ rotation_about("z", rng.uniform(0, 360)) @ rotation_about("x", 180)
    x, y = rng.uniform(-1, 1, 2) * [0.25 * WIDTH, 0.2 * HEIGHT] * distance / focal
    texels = np.pad(marker_image(_TEXELS, variant), _TEXELS // 8, constant_values=255)
    size = _SIDE_M * len(texels) / _TEXELS
    pose = compose(turn, [x, y, distance])
    quad = Quad("sheet", Texture.from_array(texels), (size, size), pose, (Mark("marker", variant.kind, _SIDE_M),))
    frame = render(Scene((quad,), background=128), camera, np.eye(4), renderer="exact")
    blur = float(rng.uniform(0, 0.8))
    shown = np.asarray(frame.linear, dtype=np.float64).reshape(HEIGHT, WIDTH)
    soft = np.asarray(cv2.GaussianBlur(shown, (0, 0), blur), dtype=np.float64) if blur > 0.15 else shown
    (truth,) = frame.truth
    return CenterView(25 + 0.8 * soft, truth.center_xy, _side_at_center(truth.corners_xy), focal)


def _side_at_center(corners_xy: NDArray[np.float64]) -> float:
    """Return the square root of the area that a side's square has at the centre, under the corners' homography."""
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]], np.float32)
    h = np.asarray(cv2.getPerspectiveTransform(square, corners_xy.astype(np.float32)), dtype=np.float64)
    return float(np.sqrt(abs(np.linalg.det(h)) / h[2, 2] ** 3))
