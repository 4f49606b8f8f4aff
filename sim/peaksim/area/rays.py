"""Rays against faces: a tree of boxes around triangles and parallelograms, and its kernels."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import triangles_m
from peaksim.kernel import kernel, part
from peaksim.scene.scene import Mesh, Quad, Scene

_LEAF = 4
"""Most faces of a leaf; a choice of speed, which changes no result."""
STACK = 128
"""Boxes that wait while a tree is traversed: more than any tree of 2⁶⁴ faces needs."""
_TIE = 1e-9
"""Share of the distance within which two hits are in one plane, as `owner.TIE`."""

U, V, QUAD = 3, 6, 9
"""Columns of `Solids.faces`: first corner at 0, first side, second side, 1 for a parallelogram."""


class Solids(NamedTuple):
    """Faces in a binary tree of axis-aligned boxes, world frame, metres."""

    boxes: NDArray[np.float64]
    """(n, 6) least and largest coordinates."""
    links: NDArray[np.int64]
    """(n, 2) first child (the other one follows) and 0, or first face and number of faces of a leaf."""
    faces: NDArray[np.float64]
    """(f, 10) first corner, first side, second side, 1 for parallelograms and 0 for triangles."""
    ids: NDArray[np.int64]
    """(f,) number of the face in the scene: quads, then triangles in mesh order."""


def solids_of(scene: Scene, *, quads: bool) -> Solids:
    """Return the tree of a scene's meshes, with its quads if requested."""
    return _solids(scene.quads, scene.meshes, quads)


@lru_cache(maxsize=2)
def _solids(quads: tuple[Quad, ...], meshes: tuple[Mesh, ...], with_quads: bool) -> Solids:
    """Return the tree; frames of one scene share it, whatever their lights."""
    squares = np.array([quad.corners_m[[0, 1, 3]] for quad in quads]).reshape(-1, 3, 3)
    corners = np.concatenate([squares, triangles_m(meshes)])
    ids = np.arange(len(corners))
    keep = ids >= (0 if with_quads else len(squares))
    return build_tree(corners[keep], ids[keep] < len(squares), ids[keep])


def build_tree(corners: NDArray[np.float64], is_quad: NDArray[np.bool_], ids: NDArray[np.int64]) -> Solids:
    """Return the tree of (f, 3, 3) corners (for a parallelogram the last one follows), split at medians."""
    sides = corners[:, 1:] - corners[:, :1]
    fourth = corners[:, 1] + is_quad[:, None] * sides[:, 1]
    every = np.concatenate([corners, fourth[:, None]], axis=1)
    bounds = np.concatenate([every.min(axis=1), every.max(axis=1)], axis=1)
    order, boxes, links = _split(bounds)
    faces = np.concatenate([corners[:, 0], sides[:, 0], sides[:, 1], is_quad[:, None]], axis=1)
    return Solids(boxes, links, np.ascontiguousarray(faces[order]), ids[order])


def _split(bounds: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Return an order of faces, and the boxes and links of a tree over it, from (f, 6) bounds."""
    order = np.arange(len(bounds))
    spans = [(0, len(bounds))]
    links = [(0, len(bounds))]
    for node, (first, last) in enumerate(spans):  # the list grows during the loop
        if last - first <= _LEAF:
            links[node] = (first, last - first)
            continue
        span = order[first:last]
        middles = bounds[span, :3] + bounds[span, 3:]
        axis = int(np.argmax(np.ptp(middles, axis=0)))
        order[first:last] = span[np.argsort(middles[:, axis], kind="stable")]
        links[node] = (len(spans), 0)
        half = (first + last) // 2
        spans += [(first, half), (half, last)]
        links += [(0, 0), (0, 0)]
    boxes = np.array([_hull(bounds[order[first:last]]) for first, last in spans])
    return order, boxes, np.array(links, dtype=np.int64)


def _hull(bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([bounds[:, :3].min(axis=0, initial=np.inf), bounds[:, 3:].max(axis=0, initial=-np.inf)])


@part
def meets_box(boxes, node, origin, ray, radius, farthest):
    """Return whether a ray comes within `radius` (along each axis) of a box before `farthest`."""
    near, far = 0.0, farthest
    for k in range(3):
        low, high = boxes[node, k] - radius - origin[k], boxes[node, k + 3] + radius - origin[k]
        if ray[k] != 0.0:
            a, b = low / ray[k], high / ray[k]
            near, far = max(near, min(a, b)), min(far, max(a, b))
        elif low > 0.0 or high < 0.0:
            return False
    return near <= far * (1.0 + 1e-12)


@part
def intersect_face(faces, face, origin, ray):
    """Return the ray parameter at which it meets a face, inf if it does not (Möller and Trumbore 1997)."""
    u0, u1, u2 = faces[face, U], faces[face, U + 1], faces[face, U + 2]
    v0, v1, v2 = faces[face, V], faces[face, V + 1], faces[face, V + 2]
    px, py, pz = ray[1] * v2 - ray[2] * v1, ray[2] * v0 - ray[0] * v2, ray[0] * v1 - ray[1] * v0
    det = u0 * px + u1 * py + u2 * pz
    if det == 0.0:
        return np.inf
    ox, oy, oz = origin[0] - faces[face, 0], origin[1] - faces[face, 1], origin[2] - faces[face, 2]
    qx, qy, qz = oy * u2 - oz * u1, oz * u0 - ox * u2, ox * u1 - oy * u0
    a = (ox * px + oy * py + oz * pz) / det
    b = (ray[0] * qx + ray[1] * qy + ray[2] * qz) / det
    if a < 0.0 or a > 1.0 or b < 0.0 or b > 1.0 or (faces[face, QUAD] == 0.0 and a + b > 1.0):
        return np.inf
    return (v0 * qx + v1 * qy + v2 * qz) / det


@part
def nearest_face(boxes, links, faces, ids, origin, ray, stack):
    """Return (scene face, t) of what a ray meets first, (−1, inf) for nothing; of faces in one plane the later one."""
    best, best_t = -1, np.inf
    stack[0] = 0
    top = min(1, ids.size)
    while top > 0:
        top -= 1
        node = stack[top]
        if not meets_box(boxes, node, origin, ray, 0.0, best_t * (1.0 + 2 * _TIE)):
            continue
        first = links[node, 0]
        if links[node, 1] == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
        for face in range(first, first + links[node, 1]):
            t = intersect_face(faces, face, origin, ray)
            tie = abs(t - best_t) <= _TIE * best_t
            if 0.0 < t < np.inf and ((tie and ids[face] > best) or (not tie and t < best_t)):
                best, best_t = ids[face], t
    return best, best_t


@part
def meets_any(boxes, links, faces, origin, ray, radius, farthest, stack):
    """Return whether a ray meets a face before `farthest`, or for a radius > 0 whether one may come that near."""
    stack[0] = 0
    top = min(1, faces.shape[0])
    while top > 0:
        top -= 1
        node = stack[top]
        if not meets_box(boxes, node, origin, ray, radius, farthest):
            continue
        first = links[node, 0]
        if links[node, 1] == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
        elif radius > 0.0:
            return True
        for face in range(first, first + links[node, 1]):
            if 0.0 < intersect_face(faces, face, origin, ray) < farthest:
                return True
    return False


@kernel
def list_faces_in(boxes, links, ids, planes, found):
    """List the scene faces whose boxes reach into a convex region; return how many.

    `planes` (m, 4) are its borders: normal and offset, n·p + d ≥ 0 inside.
    """
    stack = np.empty(STACK, np.int64)
    stack[0] = 0
    top, count = min(1, ids.size), 0
    while top > 0:
        top -= 1
        node = stack[top]
        outside = False
        for plane in range(planes.shape[0]):
            most = planes[plane, 3]
            for k in range(3):
                most += planes[plane, k] * boxes[node, k + 3 if planes[plane, k] > 0.0 else k]
            outside = outside or most < 0.0
        if outside:
            continue
        first = links[node, 0]
        if links[node, 1] == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
        for face in range(first, first + links[node, 1]):
            found[count] = ids[face]
            count += 1
    return count


@kernel
def nearest_faces(boxes, links, faces, ids, origins, rays, found, parameters):
    """Write the first scene face of each of (n, 3) rays, −1 for none, and the ray parameters, inf for none.

    `origins` is (1, 3), or (n, 3) for rays from different positions.
    """
    stack = np.empty(STACK, np.int64)
    for i in range(rays.shape[0]):
        origin = origins[i if origins.shape[0] > 1 else 0]
        found[i], parameters[i] = nearest_face(boxes, links, faces, ids, origin, rays[i], stack)


def first_faces(
    solids: Solids, origins: NDArray[np.float64], rays: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the first scene face of each of (n, 3) rays, −1 for none, and the ray parameter there, inf for none.

    Parameters
    ----------
    solids
        What the rays meet.
    origins
        (3,) of all rays or (n, 3), world.
    rays
        (n, 3) directions, world; a ray with nan meets nothing.
    """
    found, parameters = np.empty(len(rays), np.int64), np.empty(len(rays))
    nearest_faces(*solids, np.atleast_2d(origins), np.ascontiguousarray(rays), found, parameters)
    return found, parameters
