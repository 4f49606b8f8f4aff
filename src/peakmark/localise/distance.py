"""Distance of a marker from its size in the image (paper, Section 4.2: "first assumptions about the marker distances").

A small square of side s at distance d, whose normal makes the angle θ with the ray to the camera, covers the solid
angle s² cos θ / d². SURF's scale measures that area alone, so an assumption must stand in for θ: a known stretch, or
a known height of the camera above the floor. A refined marker's affinity measures area and foreshortening, and needs
none.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from peaksim.camera.camera import Camera

Values = NDArray[np.float64]

_STEP_PX = 0.5


def unit_rays(camera: Camera, xy: ArrayLike) -> Values:
    """Return (n, 3) unit viewing directions of (n, 2) px, camera frame; nan where the lens folds."""
    rays = camera.unproject(xy)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def ray_slopes(camera: Camera, xy: ArrayLike) -> Values:
    """Return (n, 3, 2) derivatives of the unit viewing directions by x and y, rad/px, by central differences."""
    points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    steps = np.eye(2) * _STEP_PX
    ahead, behind = (np.stack([unit_rays(camera, points + sign * step) for step in steps], axis=2) for sign in (1, -1))
    return np.asarray((ahead - behind) / (2 * _STEP_PX))


def solid_angles(camera: Camera, xy: ArrayLike, side_px: ArrayLike) -> Values:
    """Return (n,) solid angles, sr, of markers whose image area is `side_px` squared."""
    slopes = ray_slopes(camera, xy)
    area = np.linalg.norm(np.cross(slopes[:, :, 0], slopes[:, :, 1]), axis=1)
    return np.asarray(area * np.square(side_px))


def distances_at_height(solid_angle_sr: ArrayLike, side_m: float, height_m: float) -> Values:
    """Return (n,) distances, m, of markers on a floor that is `height_m` below the camera.

    With cos θ = h / d the solid angle is s² h / d³. The cubic root makes a relative error of the scale 2/3 as large in
    the distance.
    """
    return np.asarray(np.cbrt(side_m**2 * height_m / np.asarray(solid_angle_sr)))


def distances_of_shapes(camera: Camera, xy: ArrayLike, affinity: ArrayLike, side_m: float) -> tuple[Values, Values]:
    """Return (n,) distances, m, and (n,) tilts, degrees, from refined markers at (n, 2) px of (n, 2, 2) px per side.

    Seen from the camera centre the marker's sides span angles whose largest singular value is s / d, the direction
    that is not foreshortened, and whose smallest is s cos θ / d.
    """
    angles = ray_slopes(camera, xy) @ np.asarray(affinity, dtype=np.float64).reshape(-1, 2, 2)
    largest, smallest = np.linalg.svd(angles, compute_uv=False).T
    return side_m / largest, np.degrees(np.arccos(np.clip(smallest / largest, 0, 1)))
