"""Light and shadow by brute force: many rays a pixel, each with one to every light; written apart from the renderer."""

import numpy as np
from numpy.typing import NDArray
from peaksim import Camera, Light, Scene

from tests.peaksim.area.area_reference import permuted_offsets

Points = NDArray[np.float64]


def lit_integral(scene: Scene, camera: Camera, pose: NDArray[np.float64], n: int = 16) -> NDArray[np.float64]:
    """Return the (h, w) mean of n × n rays a pixel through quads of one grey level and grey meshes, with lights."""
    squares = [q.corners_m[[[0, 1, 2], [0, 2, 3]]] for q in scene.quads]
    solids = [m.triangles_m for m in scene.meshes]
    triangles = np.concatenate([*squares, *solids])
    levels = np.concatenate(
        [np.full(2, float(q.texture.pixels.ravel()[0])) for q in scene.quads]
        + [np.full(len(m.faces), m.color[0]) for m in scene.meshes]
    )
    blockers = np.concatenate([np.zeros((0, 3, 3)), *solids])
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    total = np.zeros(len(pixels))
    for offset in permuted_offsets(n):
        rays = camera.unproject(pixels + offset) @ pose[:3, :3].T
        t, hit = nearest(np.broadcast_to(pose[:3, 3], rays.shape), rays, triangles)
        seen = np.isfinite(t)
        positions = pose[:3, 3] + np.where(seen, t, 0)[:, None] * rays
        corners = triangles[hit]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        normals *= -np.sign((normals * rays).sum(axis=1, keepdims=True))
        light = sum(multiplier(one, positions, normals, blockers) for one in scene.lights)
        total += np.where(seen, levels[hit] * light, scene.background)
    return (total / n**2).reshape(camera.height, camera.width)


def multiplier(light: Light, positions: Points, normals: Points, blockers: Points) -> NDArray[np.float64]:
    """Return the (m,) multiplier of one light, as `Light` defines it."""
    if light.kind == "ambient":
        return np.full(len(positions), light.intensity)
    if light.kind == "directional":
        to_light = np.broadcast_to(-np.asarray(light.direction) * 1e3, positions.shape)
    else:
        to_light = np.asarray(light.position_m) - positions
    lengths = np.linalg.norm(to_light, axis=1)
    cosines = np.maximum((to_light * normals).sum(axis=1) / lengths, 0)
    falloff = (light.reference_m / lengths) ** 2 if light.kind == "point" else 1.0
    if light.casts_shadows:
        cosines[nearest(positions + 1e-6 * normals, to_light, blockers)[0] < 1] = 0
    return light.intensity * cosines * falloff


def nearest(origins: Points, rays: Points, triangles: Points) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the (m,) parameter and number of the first triangle on each ray, inf where there is none."""
    if len(triangles) == 0:
        return np.full(len(rays), np.inf), np.zeros(len(rays), np.int64)
    sides = np.roll(triangles, -1, axis=1) - triangles
    normals = np.cross(sides[:, 0], sides[:, 1])
    # (4, k, 3) planes of a triangle: its own, and those through its sides across it
    planes = np.stack([normals, *np.moveaxis(np.cross(normals[:, None], sides), 1, 0)])
    offsets = (planes * triangles[:, [0, 0, 1, 2]].swapaxes(0, 1)).sum(axis=2)
    heights, slopes = (
        np.moveaxis(vectors @ planes.reshape(-1, 3).T, 0, 1).reshape(4, -1, len(rays)) for vectors in (origins, rays)
    )
    heights -= offsets[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -heights[0] / slopes[0]
        inside = (heights[1:] + t * slopes[1:] >= 0).all(axis=0) & (t > 0)
    t = np.where(inside, t, np.inf)
    number = t.argmin(axis=0)
    return t[number, np.arange(len(rays))], number
