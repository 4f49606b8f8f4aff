"""The area integral by brute force: many rays a pixel, at permuted offsets; written apart from the renderers."""

import cv2
import numpy as np
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
    textures = [np.atleast_3d(q.texture.pixels).astype(np.float64) for q in scene.quads]
    out = np.zeros((camera.height * camera.width, channels))
    for dx, dy in permuted_offsets(n):
        x, y = np.meshgrid(np.arange(camera.width) + dx, np.arange(camera.height) + dy)
        rays = np.ascontiguousarray(rays_of(camera, x, y).reshape(-1, 3).T)
        _add_samples(rays, frames, sizes, textures, scene.background, out)
    return out.reshape(camera.height, camera.width, channels) / n**2


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


def _add_samples(rays, frames, sizes, textures, background, out):
    """Add what one ray a pixel, of (3, n), meets first to (n, channels): of quads in one plane the later one."""
    best, best_depth, best_uv = np.full(len(out), -1), np.full(len(out), np.inf), np.zeros((2, len(out)))
    local = np.concatenate([np.zeros((0, 3)), *frames[:, :3, :3]]) @ rays
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, (m, size) in enumerate(zip(frames, sizes, strict=True)):  # m: quad from camera
            x, y, z = local[3 * k : 3 * k + 3]
            depth = -m[2, 3] / z
            u, v = (m[0, 3] + depth * x) / size[0] + 0.5, 0.5 - (m[1, 3] + depth * y) / size[1]
            inside = (np.abs(u - 0.5) <= 0.5) & (np.abs(v - 0.5) <= 0.5)
            nearer = inside & (depth > 0) & (depth <= best_depth * (1 + 1e-9))
            np.copyto(best, k, where=nearer)
            np.copyto(best_depth, depth, where=nearer)
            np.copyto(best_uv, [u, v], where=nearer)
    out[best < 0] += background
    for k, texture in enumerate(textures):
        shown = np.flatnonzero(best == k)
        out[shown] += 128.0 if frames[k, 2, 3] < 0.0 else _bilinear(texture, *best_uv[:, shown])


def _bilinear(texture, u, v):
    """Return the (n, channels) levels of a texture at (n,) shares of its sides, clamped beyond the outer texels."""
    height, width, channels = texture.shape
    u, v = np.clip(u * width - 0.5, 0, width - 1), np.clip(v * height - 0.5, 0, height - 1)
    i, j = np.minimum(u.astype(int), max(width - 2, 0)), np.minimum(v.astype(int), max(height - 2, 0))
    f, g = (u - i)[:, None], (v - j)[:, None]
    texels, here = texture.reshape(-1, channels), j * width + i
    right, below = int(width > 1), width * int(height > 1)
    above = (1 - f) * texels[here] + f * texels[here + right]
    return (1 - g) * above + g * ((1 - f) * texels[here + below] + f * texels[here + below + right])
