"""Light with a shape: what only the traced renderer draws.

Radiance is in units of white: a lamp of radiance 1 in view shows level 255, as does a white surface in light of
multiplier 1. Light of radiance 1 from everywhere has the multiplier 1. A small lamp of A m² that faces a surface from
r metres has the multiplier radiance·A/(π·r²).
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError
from peaksim.geometry.pose import Pose, compose, look_at

WINDOW_RADIANCE = 25.0
"""Of `window`: 1 m² lights white paper 2.8 m away, face to face, with multiplier 1; in view it is far beyond white."""
_LIFT_M = 1e-3
"""An area light stands this far before its position, so that it may be stated as lying in a wall or ceiling."""

Point = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class AreaLight:
    """A rectangle that shines to one side, evenly in all directions (Lambert); it is black from behind.

    It is seen in images, but truth takes no notice of it: depth, ids and visibility are those without the lamp.
    """

    center_m: Point
    """Middle, world."""
    size_m: tuple[float, float]
    """Width and height."""
    radiance: float
    """In units of white, see the module."""
    normal: Point = (0.0, 0.0, -1.0)
    """World direction in which it shines."""
    up: Point = (0.0, 0.0, 1.0)
    """World direction of its height; y where this is along the normal."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.center_m).all() and all(0 < side < np.inf for side in self.size_m)):
            raise SceneError(
                f"area light: expected a finite center_m and two positive size_m, got {self.center_m}, {self.size_m}"
            )
        if not (np.isfinite([*self.normal, *self.up]).all() and any(self.normal) and any(self.up)):
            raise SceneError(f"area light: expected directions other than 0, got normal {self.normal}, up {self.up}")
        _check_radiance(self.radiance, "area light")

    @property
    def world_from_light(self) -> Pose:
        """(4, 4) pose; it shines along z, width and height run along x and y."""
        normal = np.asarray(self.normal, dtype=np.float64)
        along = np.linalg.norm(np.cross(normal, self.up)) < 1e-6 * np.linalg.norm(normal) * np.linalg.norm(self.up)
        rotation = look_at(np.zeros(3), normal, (0.0, 1.0, 0.0) if along else self.up)[:3, :3]
        return compose(rotation, np.asarray(self.center_m) + _LIFT_M * normal / np.linalg.norm(normal))


def window(center_m: Point, size_m: tuple[float, float], normal: Point, radiance: float = WINDOW_RADIANCE) -> AreaLight:
    """Return a window in a wall: an upright area light of the sky's brightness, as seen from a room."""
    return AreaLight(center_m, size_m, radiance, normal)


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from infinitely far around: an even sky, or an image of the surroundings. It is the background, too."""

    radiance: float = 1.0
    """In units of white, see the module; for an image what its value 1 stands for."""
    image: NDArray[np.float32] | None = None
    """(h, w) or (h, w, 3) values ≥ 0 over all directions (equirectangular): the first row is straight up, the middle
    column looks along y, and x is a quarter of the width to its right; None for an even sky."""
    yaw_deg: float = 0.0
    """Rotation of the surroundings about z, counter-clockwise from above."""

    def __post_init__(self) -> None:
        _check_radiance(self.radiance, "environment")
        if not np.isfinite(self.yaw_deg):
            raise SceneError(f"environment: yaw_deg: expected a finite angle, got {self.yaw_deg}")
        if self.image is None:
            return
        image = np.ascontiguousarray(self.image, dtype=np.float32)
        shape = image.shape
        if len(shape) not in (2, 3) or shape[2:] not in ((), (3,)) or min(shape[:2]) < 2:
            raise SceneError(f"environment: image: expected (h, w) or (h, w, 3) with h, w ≥ 2, got {shape}")
        if not (np.isfinite(image).all() and image.min() >= 0):
            raise SceneError("environment: image: expected finite values ≥ 0")
        object.__setattr__(self, "image", image)


def _check_radiance(radiance: float, name: str) -> None:
    if not 0 <= radiance < np.inf:
        raise SceneError(f"{name}: radiance: expected a finite number ≥ 0, got {radiance}")


def plain_values(light: Any) -> dict[str, Any]:
    """Return a light's kind and fields as records keep them; an image by its shape."""
    kinds = {AreaLight: "area", Environment: "environment"}
    kind = {"kind": kinds[type(light)]} if type(light) in kinds else {}
    fields = asdict(light).items()
    return kind | {name: list(value.shape) if isinstance(value, np.ndarray) else value for name, value in fields}
