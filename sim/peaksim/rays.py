"""Rays against faces: a bounding-volume hierarchy of triangles and parallelograms, and its kernels."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from peaksim.faces import QUAD, TRIANGLE
from peaksim.scene import Scene

_LEAF = 4
_DEPTH = 64


class Solids(NamedTuple):
    """Faces in a binary tree of axis-aligned boxes, world frame; children of node k lie at links[k], links[k] + 1."""

    lows: NDArray[np.float64]
    """(n, 3) metres."""
    highs: NDArray[np.float64]
    """(n, 3) metres."""
    links: NDArray[np.int64]
    """(n,) first child, or first face of a leaf."""
    counts: NDArray[np.int64]
    """(n,) faces of a leaf, 0 for an inner node."""
    origins: NDArray[np.float64]
    """(f, 3) first corner."""
    us: NDArray[np.float64]
    """(f, 3) first side."""
    vs: NDArray[np.float64]
    """(f, 3) second side."""
    kinds: NDArray[np.int64]
    """(f,) QUAD for parallelograms, TRIANGLE."""
    ids: NDArray[np.int64]
    """(f,) number of the face in the scene: quads, then triangles in mesh order."""


def solids_of(scene: Scene, *, quads: bool) -> Solids:
    """Return the tree of a scene's meshes, with its quads if asked for."""
    squares = np.array([q.corners_m[[0, 1, 3]] for q in scene.quads]).reshape(-1, 3, 3)
    triangles = np.concatenate([np.zeros((0, 3, 3)), *(mesh.triangles_m for mesh in scene.meshes)])
    corners = np.concatenate([squares, triangles])
    ids = np.arange(len(corners))
    kinds = np.where(ids < len(squares), QUAD, TRIANGLE)
    keep = ids >= (0 if quads else len(squares))
    return build(corners[keep], kinds[keep], ids[keep])


def build(corners: NDArray[np.float64], kinds: NDArray[np.int64], ids: NDArray[np.int64]) -> Solids:
    """Return the tree of (f, 3, 3) corners, split at the median of the longest side."""
    sides = corners[:, 1:] - corners[:, :1]
    everything = np.concatenate(
        [corners, corners[:, 1:2] + np.where(kinds == QUAD, 1, 0)[:, None, None] * sides[:, 1:2]], axis=1
    )
    lows, highs = everything.min(axis=1, initial=np.inf), everything.max(axis=1, initial=-np.inf)
    middles = (lows + highs) / 2
    order = np.arange(len(corners))
    nodes: list[tuple[NDArray[np.float64], NDArray[np.float64], int, int]] = [_node(lows, highs, order, 0, len(order))]
    pending = [(0, 0, len(order))]
    while pending:
        node, first, last = pending.pop()
        if last - first <= _LEAF:
            continue
        part = order[first:last]
        axis = int(np.argmax(np.ptp(middles[part], axis=0)))
        order[first:last] = part[np.argsort(middles[part, axis], kind="stable")]
        half = (first + last) // 2
        nodes[node] = (*nodes[node][:2], len(nodes), 0)
        for a, b in ((first, half), (half, last)):
            pending.append((len(nodes), a, b))
            nodes.append(_node(lows, highs, order, a, b))
    return Solids(
        np.array([n[0] for n in nodes]),
        np.array([n[1] for n in nodes]),
        np.array([n[2] for n in nodes], dtype=np.int64),
        np.array([n[3] for n in nodes], dtype=np.int64),
        np.ascontiguousarray(corners[order, 0]),
        np.ascontiguousarray(sides[order, 0]),
        np.ascontiguousarray(sides[order, 1]),
        kinds[order].astype(np.int64),
        ids[order].astype(np.int64),
    )


def _node(
    lows: NDArray[np.float64], highs: NDArray[np.float64], order: NDArray[np.int64], first: int, last: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], int, int]:
    part = order[first:last]
    return lows[part].min(axis=0, initial=np.inf), highs[part].max(axis=0, initial=-np.inf), first, last - first


@njit(cache=True, nogil=True, error_model="numpy")
def meets_box(low, high, origin, inverse, farthest):  # type: ignore[no-untyped-def]
    """Return whether a ray with 1/direction `inverse` meets a box nearer than `farthest`."""
    near, far = 0.0, farthest
    for k in range(3):
        a, b = (low[k] - origin[k]) * inverse[k], (high[k] - origin[k]) * inverse[k]
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near <= far * (1.0 + 1e-12)


@njit(cache=True, nogil=True, error_model="numpy")
def hit(solids, face, origin, ray):  # type: ignore[no-untyped-def]
    """Return the ray parameter at which it meets a face, inf if it does not (Möller and Trumbore 1997)."""
    u, v = solids.us[face], solids.vs[face]
    px = ray[1] * v[2] - ray[2] * v[1]
    py = ray[2] * v[0] - ray[0] * v[2]
    pz = ray[0] * v[1] - ray[1] * v[0]
    det = u[0] * px + u[1] * py + u[2] * pz
    if det == 0.0:
        return np.inf
    ox, oy, oz = (
        origin[0] - solids.origins[face, 0],
        origin[1] - solids.origins[face, 1],
        origin[2] - solids.origins[face, 2],
    )
    a = (ox * px + oy * py + oz * pz) / det
    if a < 0.0 or a > 1.0:
        return np.inf
    qx, qy, qz = oy * u[2] - oz * u[1], oz * u[0] - ox * u[2], ox * u[1] - oy * u[0]
    b = (ray[0] * qx + ray[1] * qy + ray[2] * qz) / det
    if b < 0.0 or b > 1.0 or (solids.kinds[face] != QUAD and a + b > 1.0):
        return np.inf
    return (v[0] * qx + v[1] * qy + v[2] * qz) / det


@njit(cache=True, nogil=True, error_model="numpy")
def blocked(solids, origin, ray, nearest, farthest):  # type: ignore[no-untyped-def]
    """Return whether any face meets origin + t·ray with nearest < t < farthest."""
    if solids.ids.size == 0:
        return False
    stack = np.empty(_DEPTH, np.int64)
    inverse = np.empty(3)
    for k in range(3):
        inverse[k] = 1.0 / ray[k] if ray[k] != 0.0 else 1e300
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        if not meets_box(solids.lows[node], solids.highs[node], origin, inverse, farthest):
            continue
        first = solids.links[node]
        if solids.counts[node] == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
            continue
        for face in range(first, first + solids.counts[node]):
            t = hit(solids, face, origin, ray)
            if nearest < t < farthest:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_face(solids, origin, ray):  # type: ignore[no-untyped-def]
    """Return (scene face, t) of what a ray sees first, (−1, inf) for nothing; of faces in one plane the later one."""
    best, best_t = -1, np.inf
    if solids.ids.size == 0:
        return best, best_t
    stack = np.empty(_DEPTH, np.int64)
    inverse = np.empty(3)
    for k in range(3):
        inverse[k] = 1.0 / ray[k] if ray[k] != 0.0 else 1e300
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        if not meets_box(solids.lows[node], solids.highs[node], origin, inverse, best_t * (1.0 + 1e-8)):
            continue
        first = solids.links[node]
        if solids.counts[node] == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
            continue
        for face in range(first, first + solids.counts[node]):
            t = hit(solids, face, origin, ray)
            tie = abs(t - best_t) <= 1e-9 * t
            if 0.0 < t < np.inf and ((tie and solids.ids[face] > best) or (not tie and t < best_t)):
                best, best_t = solids.ids[face], t
    return best, best_t


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_faces(solids, origin, rays):  # type: ignore[no-untyped-def]
    """Return the first scene face of each of (n, 3) rays from one origin, −1 for none, and the ray parameters."""
    faces = np.empty(len(rays), np.int64)
    parameters = np.empty(len(rays))
    for i in range(len(rays)):
        faces[i], parameters[i] = nearest_face(solids, origin, rays[i])
    return faces, parameters


def first_faces(solids: Solids, origin: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the first scene face that each of (n, 3) rays meets, −1 for none."""
    return np.asarray(nearest_faces(solids, origin, np.ascontiguousarray(rays))[0])
