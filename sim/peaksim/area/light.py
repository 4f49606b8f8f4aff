"""Kernels: the multiplier of linear grey levels over pixels and pieces of pixels, with shadows from meshes.

What is baked is the mean of a map over the piece. Any other multiplier is computed at the piece's middle; where a mesh
comes near the ray from there to the light, samples of the piece tell which share is lit.
"""

import numpy as np
from numpy.typing import NDArray

from peaksim.area.cut import FACE, ROW, SIZE
from peaksim.area.faces import DEPTH, NORMAL
from peaksim.area.light_map import add_baked_piece
from peaksim.area.rays import STACK, meets_any
from peaksim.kernel import kernel, part
from peaksim.scene.scene import Light

KIND, INTENSITY, VECTOR, REFERENCE, SHADOWS = 0, 1, 2, 5, 6
"""Columns of a table of lights."""
AMBIENT, DIRECTIONAL, POINT = 0, 1, 2
_KINDS = {"ambient": AMBIENT, "directional": DIRECTIONAL, "point": POINT}
_LIFT_M = 1e-5
"""Rays to the light start this much above a surface, so that it does not shade itself."""
_FEW, _MANY = 16, 128
"""Rays to a light for each triangle of a piece's fan: a few, and many where only some of those are blocked."""


def pack_lights(lights: tuple[Light, ...]) -> NDArray[np.float64]:
    """Return an (l, 7) table of lights; VECTOR is the unit direction towards a directional light, or a position."""
    return np.array([_row(light) for light in lights], dtype=np.float64).reshape(-1, 7)


def _row(light: Light) -> list[float]:
    vector = np.asarray(light.position_m, dtype=np.float64)
    if light.kind == "directional":
        vector = -np.asarray(light.direction, dtype=np.float64) / np.linalg.norm(light.direction)
    return [_KINDS[light.kind], light.intensity, *vector, light.reference_m, light.casts_shadows]


@part
def point_on_face(planes, face, u, v, point):
    """Write the world point (u, v) of a face."""
    for k in range(3):
        point[k] = planes[face, 0, k] + u * planes[face, 1, k] + v * planes[face, 2, k]


@part
def ray_to_light(lights, light, point, ray):
    """Write the ray from a point to a light; return its length, and the ray parameter at which the light is."""
    length = 0.0
    is_point = lights[light, KIND] == POINT
    for k in range(3):
        ray[k] = lights[light, VECTOR + k] - (point[k] if is_point else 0.0)
        length += ray[k] * ray[k]
    return np.sqrt(length), (1.0 if is_point else np.inf)


@part
def lit_share(planes, face, polygons, k, n, lift, lights, light, boxes, links, solids, point, ray, stack, samples):
    """Return the share of polygon k that a light reaches past the meshes."""
    lit = whole = 0.0
    u0, v0 = polygons[k, 0, 0], polygons[k, 0, 1]
    for i in range(1, n - 1):
        u1, v1 = polygons[k, i, 0] - u0, polygons[k, i, 1] - v0
        u2, v2 = polygons[k, i + 1, 0] - u0, polygons[k, i + 1, 1] - v0
        weight = abs(u1 * v2 - u2 * v1)
        whole += weight
        reached = 0
        for sample in range(samples):
            # an even sequence in the square (Roberts 2018), folded into the triangle
            a, b = (0.5 + 0.7548776662466927 * sample) % 1.0, (0.5 + 0.5698402909980532 * sample) % 1.0
            if a + b > 1.0:
                a, b = 1.0 - a, 1.0 - b
            point_on_face(planes, face, u0 + a * u1 + b * u2, v0 + a * v1 + b * v2, point)
            for axis in range(3):
                point[axis] += lift[axis]
            _, farthest = ray_to_light(lights, light, point, ray)
            if not meets_any(boxes, links, solids, point, ray, 0.0, farthest, stack):
                reached += 1
        lit += weight * (reached / samples)
    return lit / whole if whole > 0.0 else 1.0


@part
def sampled_share(planes, face, polygons, k, n, lift, lights, light, boxes, links, solids, point, ray, stack):
    """Return the lit share of polygon k from a few samples, and from many where a few do not agree."""
    share = 0.5
    for samples in (_FEW, _MANY):
        if 0.0 < share < 1.0:
            share = lit_share(
                planes, face, polygons, k, n, lift, lights, light, boxes, links, solids, point, ray, stack, samples
            )
    return share


@part
def mean_light(planes, faces, face, polygons, k, n, eyes, pose, lights, boxes, links, solids, work, stack):
    """Return the mean multiplier over the n vertices of polygon k, in the coordinates of its face."""
    point, ray, lift, corner = work[0], work[1], work[2], work[3]
    u = v = radius = facing = total = 0.0
    for i in range(n):
        u += polygons[k, i, 0] / n
        v += polygons[k, i, 1] / n
    point_on_face(planes, face, u, v, point)
    for i in range(n):
        point_on_face(planes, face, polygons[k, i, 0], polygons[k, i, 1], corner)
        radius = max(radius, (corner[0] - point[0]) ** 2 + (corner[1] - point[1]) ** 2 + (corner[2] - point[2]) ** 2)
    for axis in range(3):
        facing += faces[face, NORMAL + axis] * (eyes[pose, axis] - point[axis])
    for axis in range(3):
        lift[axis] = faces[face, NORMAL + axis] * (_LIFT_M if facing >= 0.0 else -_LIFT_M)
        corner[axis] = point[axis]
    for light in range(lights.shape[0]):
        strength = lights[light, INTENSITY]
        if lights[light, KIND] != AMBIENT:
            length, farthest = ray_to_light(lights, light, corner, ray)
            cosine = (lift[0] * ray[0] + lift[1] * ray[1] + lift[2] * ray[2]) / (_LIFT_M * length)
            strength *= max(cosine, 0.0)
            if lights[light, KIND] == POINT:
                strength *= (lights[light, REFERENCE] / length) ** 2
            if strength > 0.0 and lights[light, SHADOWS] > 0.0:
                near = np.sqrt(radius) + 2.0 * _LIFT_M
                if meets_any(boxes, links, solids, corner, ray, near, farthest, stack):
                    strength *= sampled_share(
                        planes, face, polygons, k, n, lift, lights, light, boxes, links, solids, point, ray, stack
                    )
        total += strength
    return total


@kernel
def light_pieces(planes, faces, eyes, lights, boxes, links, solids, maps, texels, n, polygons, pieces, light):
    """Write the light on the first n pieces of a band.

    Parameters
    ----------
    planes, faces
        As in `Faces`.
    eyes
        (1 or h, 3) camera centres, world.
    lights
        From `pack_lights`.
    boxes, links, solids
        As in `Solids`: what casts shadows.
    maps, texels
        As in `PackedMaps`.
    n, polygons, pieces
        As in `cut_mixed`.
    light
        (n, channels) written: multipliers.
    """
    work, stack = np.empty((4, 3)), np.empty(STACK, np.int64)
    for k in range(n):
        face, size, pose = pieces[k, FACE], pieces[k, SIZE], pieces[k, ROW] if eyes.shape[0] > 1 else 0
        light[k] = mean_light(
            planes, faces, face, polygons, k, size, eyes, pose, lights, boxes, links, solids, work, stack
        )
        if maps.shape[0] > 0:
            add_baked_piece(planes, faces, face, polygons, k, size, eyes, pose, maps, texels, light[k])


@kernel
def light_owned(rays, sides, planes, faces, eyes, lights, boxes, links, solids, owners, light):
    """Write the plain light on all pixels of a band that have an owner to `light`; see `light_pieces`."""
    work, stack = np.empty((4, 3)), np.empty(STACK, np.int64)
    polygon = np.empty((1, 4, 2))
    for y in range(owners.shape[0]):
        for x in range(owners.shape[1]):
            face, pose = owners[y, x], y if eyes.shape[0] > 1 else 0
            if face >= 0:
                for corner in range(4):
                    i, j = y + corner // 2, x + (corner + 1) // 2 % 2
                    u = v = w = 0.0
                    for axis in range(3):
                        u += sides[pose, face, 0, axis] * rays[i, j, axis]
                        v += sides[pose, face, 1, axis] * rays[i, j, axis]
                        w += sides[pose, face, DEPTH, axis] * rays[i, j, axis]
                    polygon[0, corner, 0] = u / w
                    polygon[0, corner, 1] = v / w
                first, size = pose - pose, corner + 1
                light[y, x] = mean_light(
                    planes, faces, face, polygon, first, size, eyes, pose, lights, boxes, links, solids, work, stack
                )
