"""Images to measure on: the stretched lab floor, photographs of scikit-image, noise, odd and tiny sizes."""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import skimage.data
from numpy.typing import NDArray
from peaksim import load_scene, render

from peakmark.identification.stretch import stretched
from peakmark.keypoints.image import as_gray

Image = NDArray[np.uint8]


def benchmark_images() -> dict[str, Image]:
    """Name → image of the speed and memory tables."""
    return {
        "floor 2048×3072": floor(),
        "photograph 1024×768": photograph(),
        "photograph 640×480": motorcycle()[:480, :640],
    }


def parity_images() -> dict[str, Image]:
    """Name → image of the parity table."""
    photographs: dict[str, Callable[[], NDArray[np.generic]]] = {
        name: getattr(skimage.data, name)
        for name in ("astronaut", "camera", "chelsea", "coffee", "grass", "hubble_deep_field", "moon", "page", "rocket")
    }
    images = {name: as_gray(load()) for name, load in photographs.items()}
    images |= {"motorcycle": motorcycle(), "motorcycle 1024×768": photograph(), "lab floor, stretched": floor()}
    rng = np.random.default_rng(0)
    images["noise 401×303"] = rng.integers(0, 256, (303, 401), dtype=np.uint8)
    images["soft noise 1023×767"] = as_gray(np.clip(0.5 + 0.6 * _soft(rng, 767, 1023), 0, 1))
    images["two levels 255×257"] = np.where(_soft(rng, 257, 255) > 0, 255, 0).astype(np.uint8)
    images["strip 1000×31"] = as_gray(skimage.data.camera())[200:231].repeat(2, axis=1)[:, :1000].copy()
    images["tiny 29×23"] = as_gray(skimage.data.camera())[60:83, 220:249].copy()
    images["one pixel"] = np.full((1, 1), 7, dtype=np.uint8)
    return images


@cache
def floor() -> Image:
    """Return the main job's first frame of the lab floor, stretched by 2: 2048×3072."""
    scene, camera, trajectory = load_scene("floor")
    return stretched(as_gray(render(scene, camera, trajectory.at(0.0)).image), 2.0)


def photograph() -> Image:
    """Return a photograph of 1024×768."""
    return cv2.resize(motorcycle(), None, fx=1.55, fy=1.55, interpolation=cv2.INTER_CUBIC)[:768, :1024].copy()


def motorcycle() -> Image:
    """Return a photograph of 741×500."""
    return as_gray(skimage.data.stereo_motorcycle()[0])


def _soft(rng: np.random.Generator, height: int, width: int) -> NDArray[np.float32]:
    """Gaussian noise, blurred, of standard deviation 1/3."""
    noise = cv2.GaussianBlur(rng.normal(size=(height, width)).astype(np.float32), (0, 0), 3)
    return np.asarray(noise / (3 * noise.std()), dtype=np.float32)
