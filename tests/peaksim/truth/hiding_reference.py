"""What may lie between an eye and a rectangle, in plain NumPy: the reference of the kernel that walks the tree."""

import numpy as np
from numpy.typing import NDArray

_IN_PLANE_M = 1e-12
"""Faces closer than this are in one plane."""


def faces_before(
    faces: NDArray[np.float64], number: int, among: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """Return those of (f, 4, 3) faces that may hide one of them: of faces in its own plane the later ones are seen.

    `among` are the numbers of those that come into question, of all faces by default.
    """
    order = np.arange(len(faces)) if among is None else among
    first, second, _, last = faces[number]
    normal = np.cross(second - first, last - first)
    in_plane = (np.abs((faces[order] - first) @ normal) <= _IN_PLANE_M * np.linalg.norm(normal)).all(axis=1)
    return faces[order[np.where(in_plane, order > number, order != number)]]


def may_hide(
    eye_m: NDArray[np.float64], corners_m: NDArray[np.float64], faces: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (f,) whether each of (f, 4, 3) faces may lie between the eye and a rectangle (4, 3): False is certain.

    A face cannot if it is wholly on the outer side of one of the four planes through the eye and a side of the
    rectangle, or wholly behind the rectangle, or if its own plane has eye and rectangle on one side.
    """
    if len(faces) == 0:
        return np.zeros(0, dtype=bool)
    *inwards, normal = pyramid(eye_m, corners_m)
    beyond = np.any(np.all((faces - eye_m) @ np.transpose(inwards) < 0, axis=1), axis=1)
    behind = ((faces - corners_m[0]) @ normal < -1e-9 * np.linalg.norm(normal)).all(axis=1)
    planes = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    sides = (np.vstack([corners_m, eye_m]) - faces[:, :1]) @ planes[:, :, None]
    least = 1e-9 * np.linalg.norm(planes, axis=1)[:, None]
    apart = (sides[:, :, 0] > least).all(axis=1) | (sides[:, :, 0] < -least).all(axis=1)
    return np.asarray(~beyond & ~behind & ~apart)


def pyramid(eye_m: NDArray[np.float64], corners_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (5, 3) inward normals of the pyramid from an eye to a rectangle (4, 3).

    The first four planes pass through the eye and a side, the last one is the rectangle's own.
    """
    rays = corners_m - eye_m
    inwards = np.cross(rays, rays[[1, 2, 3, 0]])
    inwards *= np.sign(inwards @ rays.mean(axis=0))[:, None]
    normal = np.cross(corners_m[1] - corners_m[0], corners_m[3] - corners_m[0])
    normal *= -np.sign(normal @ rays[0])
    return np.vstack([inwards, normal])
