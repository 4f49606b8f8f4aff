"""The area integral by brute force: many rays a pixel, at permuted offsets; written apart from the renderers."""

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from peaksim import Camera, Scene
from scipy.stats import qmc


def permuted_offsets(n: int, seed: int = 1) -> NDArray[np.float64]:
    """Return (n·n, 2) offsets in (−0.5, 0.5): digits of a Sobol' sequence, permuted at random (Owen 1995)."""
    return qmc.Sobol(2, scramble=True, rng=seed).random(n * n) - 0.5


def area_integral(scene: Scene, camera: Camera, pose: NDArray[np.float64], n: int = 32) -> NDArray[np.float64]:
    """Return the (h, w, channels) mean of n × n rays a pixel through a scene of quads without lights."""
    channels = max([q.texture.channels for q in scene.quads], default=1)
    frames = np.array([np.linalg.inv(q.world_from_quad) @ pose for q in scene.quads]).reshape(-1, 4, 4)
    sizes = np.array([q.size_m for q in scene.quads], dtype=np.float64).reshape(-1, 2)
    textures = [np.atleast_3d(q.texture.pixels) for q in scene.quads]
    planes = [np.broadcast_to(t, (*t.shape[:2], channels)).ravel() for t in textures]
    flat = np.concatenate([np.zeros(0, np.uint8), *planes])
    shapes = np.array([t.shape[:2] for t in textures], dtype=np.int64).reshape(-1, 2)
    starts = np.cumsum([0, *(h * w * channels for h, w in shapes)])[: len(shapes)].astype(np.int64)
    out = np.zeros((camera.height, camera.width, channels))
    for dx, dy in permuted_offsets(n):
        x, y = np.meshgrid(np.arange(camera.width) + dx, np.arange(camera.height) + dy)
        _add_samples(rays_of(camera, x, y), frames, sizes, flat, shapes, starts, scene.background, out)
    return out / n**2


def rays_of(camera: Camera, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (h, w, 3) directions of (h, w) px with z = 1, lenses inverted by OpenCV."""
    if camera.is_pinhole:
        return np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], axis=2)
    xy, coefficients = np.stack([x.ravel(), y.ravel()], axis=1)[:, None], np.array(camera.distortion)
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-10)
    if camera.model == "fisheye":
        flat = cv2.fisheye.undistortPoints(xy, camera.matrix, coefficients, criteria=until)
    else:
        flat = cv2.undistortPointsIter(xy, camera.matrix, coefficients, None, None, until)
    return np.concatenate([flat[:, 0], np.ones((x.size, 1))], axis=1).reshape(*x.shape, 3)


@njit(cache=True, nogil=True)
def _add_samples(rays, frames, sizes, flat, shapes, starts, background, out):
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            best, best_depth, best_u, best_v = -1, np.inf, 0.0, 0.0
            for k in range(len(frames)):
                m = frames[k]  # quad from camera
                dz = m[2, 0] * rays[y, x, 0] + m[2, 1] * rays[y, x, 1] + m[2, 2] * rays[y, x, 2]
                if dz == 0.0:
                    continue
                depth = -m[2, 3] / dz
                if depth <= 0.0 or depth > best_depth * (1 + 1e-9):
                    continue
                px = m[0, 3] + depth * (m[0, 0] * rays[y, x, 0] + m[0, 1] * rays[y, x, 1] + m[0, 2] * rays[y, x, 2])
                py = m[1, 3] + depth * (m[1, 0] * rays[y, x, 0] + m[1, 1] * rays[y, x, 1] + m[1, 2] * rays[y, x, 2])
                if abs(px) <= sizes[k, 0] / 2 and abs(py) <= sizes[k, 1] / 2:
                    best, best_depth = k, depth
                    best_u, best_v = px / sizes[k, 0] + 0.5, 0.5 - py / sizes[k, 1]
            for c in range(out.shape[2]):
                if best < 0:
                    out[y, x, c] += background
                elif frames[best][2, 3] < 0.0:
                    out[y, x, c] += 128.0
                else:
                    h, w = shapes[best]
                    u = min(max(best_u * w - 0.5, 0.0), w - 1.0)
                    v = min(max(best_v * h - 0.5, 0.0), h - 1.0)
                    i, j = min(int(u), max(w - 2, 0)), min(int(v), max(h - 2, 0))
                    i1, j1 = min(i + 1, w - 1), min(j + 1, h - 1)
                    f, g, s = u - i, v - j, starts[best] + c
                    n = out.shape[2]
                    above = (1 - f) * flat[s + (j * w + i) * n] + f * flat[s + (j * w + i1) * n]
                    below = (1 - f) * flat[s + (j1 * w + i) * n] + f * flat[s + (j1 * w + i1) * n]
                    out[y, x, c] += (1 - g) * above + g * below
