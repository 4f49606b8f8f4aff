"""The outline of what a camera shows of a flat convex polygon, also of one that reaches behind the camera.

The polygon is cut in space, by the planes through the camera's centre that enclose the image, before it is projected.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from peaksim.camera.camera import Camera
from peaksim.geometry.polygon import clip_polygon, cut_polygon

_SAG_PX = 0.02
"""A lens bends the sides; each is divided so that its parts are straight to about this."""
_MOST_PARTS = 64
_MARGIN = 0.01
"""Share of the image by which the planes stand off a lens's image, whose sides are bent between sampled points."""


def seen_outline(camera: Camera, corners_in_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (m, 2) px of the part inside the image of a convex polygon of (n, 3) points; (0, 2) if there is none.

    Points are in the camera's frame, metres. What may hide the polygon does not count.
    """
    part = part_before(camera, corners_in_camera)
    if len(part) < 3:
        return np.zeros((0, 2))
    xy = camera.project(part if camera.is_pinhole else _divided(camera, part))
    outline = clip_polygon(xy[np.isfinite(xy).all(axis=1)], (-0.5, -0.5), (camera.width - 0.5, camera.height - 0.5))
    return outline if len(outline) >= 3 else np.zeros((0, 2))


def part_before(camera: Camera, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the part of a convex polygon of (n, 3 or more) points before the camera, near its image.

    For a pinhole, this is the part inside the image. Columns after the third are interpolated. A camera that sees
    beyond 90° off its axis keeps the whole polygon.
    """
    for plane in _enclosing_planes(camera):
        corners = cut_polygon(corners, corners[:, :3] @ plane)
    return corners


@lru_cache(maxsize=16)
def _enclosing_planes(camera: Camera) -> NDArray[np.float64]:
    """Return the (4, 3) inward normals of planes around the image, camera frame; (0, 3) if it is too wide for them."""
    rays = camera.unproject(camera.border())
    if not (rays[:, 2] > 0).all():
        return np.zeros((0, 3))
    flat = rays[:, :2] / rays[:, 2:]
    low, high = flat.min(axis=0), flat.max(axis=0)
    margin = np.zeros(2) if camera.is_pinhole else _MARGIN * (high - low)
    (left, top), (right, bottom) = low - margin, high + margin
    return np.array([[1, 0, -left], [-1, 0, right], [0, 1, -top], [0, -1, bottom]])


def _divided(camera: Camera, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a polygon's (n, 3) corners with points between them, as many as the lens bends its sides."""
    if (corners[:, 2] > 0).all():
        corners = corners / corners[:, 2:]  # so that even steps are even in the image
    steps = np.roll(corners, -1, axis=0) - corners
    shares = np.array([0, 0.25, 0.5, 0.75, 1])[:, None, None]
    xy = camera.project((corners + shares * steps).reshape(-1, 3)).reshape(5, -1, 2)
    chords, away = xy[4] - xy[0], xy[1:4] - xy[0]
    cross = np.abs(chords[:, 0] * away[..., 1] - chords[:, 1] * away[..., 0]).max(axis=0)
    sags_px = cross / np.maximum(np.hypot(*chords.T), 1e-9)
    parts = np.clip(np.ceil(np.sqrt(np.nan_to_num(sags_px, nan=np.inf) / _SAG_PX)), 1, _MOST_PARTS).astype(int)
    sides = zip(corners, steps, parts, strict=True)
    return np.concatenate([corner + np.arange(n)[:, None] / n * step for corner, step, n in sides])
