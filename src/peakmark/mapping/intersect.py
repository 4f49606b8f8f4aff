"""Where markers that look alike are, from images of known poses: rays of many images that meet in one point.

Structure from motion finds no tracks for markers of one kind: their descriptors are the same, so that it rejects their
matches. Poses tell what belongs together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError


@dataclass(frozen=True)
class Meeting:
    """A point that rays of several images meet in."""

    xyz: NDArray[np.float64]
    """(3,) in the poses' world."""
    label: str
    """Of all its sightings."""
    sightings: tuple[tuple[int, int], ...]
    """View and row of each."""


def intersect_sightings(
    world_from_camera: ArrayLike,
    rays: Sequence[ArrayLike],
    labels: Sequence[Sequence[str]],
    within: float = 0.003,
    least: int = 3,
) -> list[Meeting]:
    """Return the points in which sightings of one label meet, those of most images first; each sighting is of one.

    Parameters
    ----------
    world_from_camera
        (v, 4, 4) poses.
    rays
        Of each view, (n, 2) x / z and y / z of its sightings, without distortion.
    labels
        Of each view, n of them, such as `Detection.kind`.
    within
        Most distance of a sighting from a point, in units of x / z: 0.003 is 2 px with a focal length of 700 px.
    least
        Images that see a point.
    """
    poses = np.asarray(world_from_camera, dtype=np.float64).reshape(-1, 4, 4)
    if not len(poses) == len(rays) == len(labels):
        raise InputError(f"rays: expected those of {len(poses)} views, got {len(rays)} and labels of {len(labels)}")
    views = np.array([v for v, one in enumerate(labels) for _ in one], dtype=np.intp)
    rows = [(v, k) for v, one in enumerate(labels) for k in range(len(one))]
    names = np.array([name for one in labels for name in one])
    xy = np.concatenate([np.empty((0, 2)), *(np.asarray(one, dtype=np.float64).reshape(-1, 2) for one in rays)])
    if len(xy) != len(views):
        raise InputError(f"labels: expected one for each of {len(xy)} rays, got {len(views)}")
    found, free = [], np.ones(len(xy), np.bool_)
    points, label = _crossings(poses, xy, views, names)
    near = [_near(poses, points[k], xy, views, within) & (names == label[k]) for k in range(len(points))]
    while near:
        seen = [np.unique(views[one & free]).size for one in near]
        best = int(np.argmax(seen))
        if seen[best] < least:
            break
        members = np.flatnonzero(near[best] & free)
        xyz = _meeting(poses[views[members]], xy[members])
        members = np.flatnonzero(_near(poses, xyz, xy, views, within) & free & (names == label[best]))
        free[np.union1d(members, np.flatnonzero(near[best]))] = False
        if len(members) >= least:
            found.append(Meeting(xyz, str(label[best]), tuple(rows[k] for k in members)))
    return found


def _crossings(
    poses: NDArray[np.float64], xy: NDArray[np.float64], views: NDArray[np.intp], names: NDArray[np.str_]
) -> tuple[NDArray[np.float64], NDArray[np.str_]]:
    """Return (p, 3) where two rays of one label from different views come nearest to one another, and the labels."""
    i, j = np.triu_indices(len(xy), 1)
    kept = (views[i] != views[j]) & (names[i] == names[j])
    i, j = i[kept], j[kept]
    local = np.column_stack([xy, np.ones(len(xy))])
    along = np.einsum("nij,nj->ni", poses[views, :3, :3], local / np.linalg.norm(local, axis=1, keepdims=True))
    origin, between = poses[views, :3, 3], poses[views[j], :3, 3] - poses[views[i], :3, 3]
    cosine = (along[i] * along[j]).sum(axis=1)
    p, q = (between * along[i]).sum(axis=1), (between * along[j]).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (p - cosine * q) / (1 - cosine**2), (cosine * p - q) / (1 - cosine**2)
    middle = (origin[i] + s[:, None] * along[i] + origin[j] + t[:, None] * along[j]) / 2
    good = np.isfinite(middle).all(axis=1) & (s > 0) & (t > 0)
    return middle[good], names[i][good]


def _near(
    poses: NDArray[np.float64],
    point: NDArray[np.float64],
    xy: NDArray[np.float64],
    views: NDArray[np.intp],
    within: float,
) -> NDArray[np.bool_]:
    seen = np.einsum("vji,vj->vi", poses[:, :3, :3], point - poses[:, :3, 3])
    depth = np.where(seen[:, 2] > 0, seen[:, 2], np.nan)
    return np.asarray(np.linalg.norm((seen[:, :2] / depth[:, None])[views] - xy, axis=1) < within)


def _meeting(poses: NDArray[np.float64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the point of least squares in the images, by two weighted linear steps."""
    inverse = np.linalg.inv(poses)
    depth = np.ones(len(xy))
    for _ in range(3):
        rows = np.concatenate([(inverse[:, k, :] - xy[:, k, None] * inverse[:, 2, :]) / depth[:, None] for k in (0, 1)])
        point = np.linalg.lstsq(rows[:, :3], -rows[:, 3], rcond=None)[0]
        depth = inverse[:, 2, :3] @ point + inverse[:, 2, 3]
    return np.asarray(point)
