"""Rays against faces: a tree of boxes around triangles and parallelograms."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import panels_m, triangles_m
from peaksim.native import function
from peaksim.scene.scene import Mesh, Quad, Scene

_LEAF = 4
"""Most faces of a leaf; a choice of speed, which changes no result."""

_nearest_faces = function(
    "void nearest_faces(const f8[nodes,6] boxes, const i8[nodes,2] links, const f8[count,10] faces, "
    "const i8[count] ids, const f8[n_origins,3] origins, const f8[n,3] rays, i8[n] found, f8[n] parameters)"
)


class Solids(NamedTuple):
    """Faces in a binary tree of axis-aligned boxes, world frame, metres."""

    boxes: NDArray[np.float64]
    """(n, 6) least and largest coordinates."""
    links: NDArray[np.int64]
    """(n, 2) first child (the other one follows) and 0, or first face and number of faces of a leaf."""
    faces: NDArray[np.float64]
    """(f, 10) first corner, first side, second side, 1 for parallelograms and 0 for triangles."""
    ids: NDArray[np.int64]
    """(f,) number of the face in the scene: panels of quads, then triangles in mesh order."""


def solids_of(scene: Scene, *, quads: bool) -> Solids:
    """Return the tree of a scene's meshes, with its quads if requested."""
    return _solids(scene.quads, scene.meshes, quads)


@lru_cache(maxsize=2)
def _solids(quads: tuple[Quad, ...], meshes: tuple[Mesh, ...], with_quads: bool) -> Solids:
    """Return the tree; frames of one scene share it, whatever their lights."""
    squares = panels_m(quads)[:, [0, 1, 3]]
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
    _nearest_faces(*solids, np.atleast_2d(origins), rays, found, parameters)
    return found, parameters
