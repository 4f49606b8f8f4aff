"""Lens models that are fitted: their parameters, and OpenCV's projection with its derivatives."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera

from peakmark.errors import check_choice

Values = NDArray[np.float64]

_FOCAL = ("fx", "fy", "cx", "cy")
_BROWN = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass(frozen=True)
class Lens:
    """A lens model."""

    name: str
    """As the command calls it."""
    model: Literal["brown", "fisheye"]
    """Of `Camera`."""
    terms: tuple[str, ...]
    """Names of its coefficients, in OpenCV's order."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters: intrinsics, then coefficients."""
        return (*_FOCAL, *self.terms)

    def camera(self, size: tuple[int, int], values: Values) -> Camera:
        """Return the camera of (p,) parameters."""
        fx, fy, cx, cy = (float(value) for value in values[:4])
        distortion = tuple(float(value) for value in values[4:])
        return Camera(*size, fx, fy, cx, cy, distortion, self.model)

    def project(self, values: Values, pose: Values, points_m: Values) -> tuple[Values, Values, Values]:
        """Return (n, 2) px of points for (6,) camera_from_world (rotation vector, m), and the derivatives.

        (n, 2, p) by the parameters and (n, 2, 6) by the pose.
        """
        matrix = np.array([[values[0], 0, values[2]], [0, values[1], values[3]], [0, 0, 1]])
        count = len(self.terms)
        if self.model == "fisheye":
            points = np.ascontiguousarray(points_m.reshape(-1, 1, 3))
            xy, jacobian = cv2.fisheye.projectPoints(points, pose[:3], pose[3:], matrix, values[4:])
            # OpenCV's order: f, c, k (4), rotation, translation, skew
            by_lens, by_pose = jacobian[:, :8], jacobian[:, 8:14]
        else:
            k = np.zeros(8)
            k[:count] = values[4:]
            xy, jacobian = cv2.projectPoints(points_m, pose[:3], pose[3:], matrix, k)
            # rotation, translation, f, c, k (8)
            by_lens, by_pose = jacobian[:, 6 : 10 + count], jacobian[:, :6]
        n = len(points_m)
        parts = xy.reshape(n, 2), by_lens.reshape(n, 2, -1), by_pose.reshape(n, 2, 6)
        a, b, c = (np.asarray(part, dtype=np.float64) for part in parts)
        return a, b, c


LENSES = {
    "pinhole": Lens("pinhole", "brown", ()),
    "brown4": Lens("brown4", "brown", _BROWN[:4]),
    "brown5": Lens("brown5", "brown", _BROWN[:5]),
    "brown8": Lens("brown8", "brown", _BROWN),
    "fisheye": Lens("fisheye", "fisheye", ("k1", "k2", "k3", "k4")),
}
"""By the names that `peakmark calibrate --lens` takes."""


def lens_named(name: str) -> Lens:
    """Return a lens model by its name; an unknown one is an `InputError`."""
    check_choice(name, LENSES, "--lens")
    return LENSES[name]
