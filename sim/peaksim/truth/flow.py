"""Optical flow between two images of one scene, from depth and projection; nothing is estimated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peaksim.area.rays import first_faces, solids_of
from peaksim.camera.frame import Frame
from peaksim.camera.shutter import PosedCamera
from peaksim.scene.scene import Scene

_SAME_DEPTH = 1e-4
"""Share of a distance by which two surfaces count as one: the depth is float32, good to 10⁻⁷."""


@dataclass(frozen=True)
class Flow:
    """Where each point of the first image lies in the second one."""

    xy: NDArray[np.float32]
    """(H, W, 2) motion from each pixel centre, px; nan where the first image shows nothing, or the second camera
    cannot see in that direction."""
    visible: NDArray[np.bool_]
    """(H, W) whether the point is inside the second image, and nothing there hides it."""


def optical_flow(scene: Scene, first: Frame, second: Frame) -> Flow:
    """Return the flow from one frame to another one of a scene, at mid-exposure."""
    points, xy = surface_points(first), first.camera.pixel_centers().reshape(-1, 2)
    landed = np.full((len(points), 2), np.nan)
    known = np.isfinite(points).all(axis=1)
    landed[known] = second.posed_camera.project(points[known])
    shape = first.depth_m.shape
    visible = _is_seen(scene, second.posed_camera, points, landed)
    return Flow((landed - xy).astype(np.float32).reshape(*shape, 2), visible.reshape(shape))


def surface_points(frame: Frame) -> NDArray[np.float64]:
    """Return the (H·W, 3) world points that the pixel centres show, nan where nothing is."""
    poses, rays, world_rays = frame.posed_camera.rays(frame.camera.pixel_centers())
    depth = frame.depth_m.ravel().astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        points = poses[:, :3, 3] + (depth / rays[:, 2])[:, None] * world_rays
    points[~np.isfinite(depth)] = np.nan
    return np.asarray(points)


def _is_seen(
    scene: Scene, posed: PosedCamera, points: NDArray[np.float64], xy: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (n,) whether an image shows world points at their (n, 2) px."""
    seen = posed.camera.contains(xy)
    eyes = np.broadcast_to(posed.row_poses(xy[seen, 1])[:, :3, 3], (int(seen.sum()), 3))
    reached = first_faces(solids_of(scene, quads=True), eyes, points[seen] - eyes)[1]
    seen[seen] = np.abs(reached - 1) < _SAME_DEPTH
    return seen
