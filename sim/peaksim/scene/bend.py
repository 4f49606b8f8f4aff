"""Bent paper: a sheet rolled about an axis, without stretch, so that lengths on it stay those of the print.

In the sheet's own frame (x right, y up, z out of the print) the middle stays where it is and keeps its normal. With
the arc s from the middle along x (axis "y") and the signed radius r, a point lies at r·sin(s/r) along x and
−r·(1 − cos(s/r)) along z: away from the viewer for r > 0.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import SceneError

FINEST = 3e-6
"""Distance of the drawn panels from the bent sheet, in its length along the arc: 0.005 px in 1600."""


@dataclass(frozen=True)
class Bend:
    """How a sheet is bent."""

    radius_m: float
    """Of curvature, metres: > 0 where the print is outside, as on a pillar, < 0 where it is inside, as in a pipe. A
    sheet may go round once at most."""
    axis: Literal["x", "y"] = "y"
    """Axis of the sheet's frame that stays straight: "y" is that of an upright pillar."""
    error: float = FINEST
    """Largest distance of the drawn panels from the sheet, in its length along the arc; "exact" and "gl" choose their
    own, a fraction of a pixel."""

    def checked(self, size_m: tuple[float, float], name: str) -> "Bend":
        """Return the bend of a sheet of some width and height.

        Raises
        ------
        SceneError
            One line that starts with `name`, the sheet, if the axis is unknown or the sheet would cover itself.
        """
        if self.axis not in ("x", "y"):
            raise SceneError(f'{name}: bend: axis: expected "x" or "y", got {self.axis!r}')
        length, radius = size_m[self.along], self.radius_m
        if not isinstance(radius, int | float) or not np.isfinite(radius) or abs(radius) < length / (2 * np.pi):
            least = length / (2 * np.pi)
            raise SceneError(
                f"{name}: bend: radius_m: expected at least {least:.4g} m (or at most −{least:.4g}) "
                f"for {length:g} m of paper, got {radius!r}"
            )
        return self

    @property
    def along(self) -> int:
        """Coordinate of the print that runs along the arc: 0 for x, 1 for y."""
        return 0 if self.axis == "y" else 1

    def points_m(self, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (n, 3) points of (n, 2) positions on the print, sheet frame."""
        points = np.zeros((len(xy_m), 3))
        angles = xy_m[:, self.along] / self.radius_m
        points[:, :2] = xy_m
        points[:, self.along] = self.radius_m * np.sin(angles)
        points[:, 2] = -2 * self.radius_m * np.sin(angles / 2) ** 2
        return points

    def normals(self, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (n, 3) unit normals out of the print at (n, 2) positions on it, sheet frame."""
        normals = np.zeros((len(xy_m), 3))
        angles = xy_m[:, self.along] / self.radius_m
        normals[:, self.along], normals[:, 2] = np.sin(angles), np.cos(angles)
        return normals

    def panels_m(self, size_m: tuple[float, float]) -> NDArray[np.float64]:
        """Return the (n, 4, 3) corners of flat panels of equal width, in the order of the print from left or top.

        Their corners lie off the sheet by two thirds of a panel's sag, so that its mean distance from the sheet is 0.
        """
        length, across = size_m[self.along], size_m[1 - self.along]
        count = max(2, int(np.ceil(np.sqrt(length / (12 * self.error * abs(self.radius_m))))))
        arcs = np.linspace(-length / 2, length / 2, count + 1)
        step = length / count / self.radius_m
        off = self.radius_m / (1 - step**2 / 12) - self.radius_m
        if self.along == 0:
            ends = [self._edge(arcs, y, off) for y in (across / 2, -across / 2)]
            corners = [ends[0][:-1], ends[0][1:], ends[1][1:], ends[1][:-1]]
        else:
            ends = [self._edge(arcs[::-1], x, off) for x in (-across / 2, across / 2)]
            corners = [ends[0][:-1], ends[1][:-1], ends[1][1:], ends[0][1:]]
        return np.stack(corners, axis=1)

    def _edge(self, arcs: NDArray[np.float64], other: float, off_m: float) -> NDArray[np.float64]:
        xy = np.full((len(arcs), 2), other)
        xy[:, self.along] = arcs
        return self.points_m(xy) + off_m * self.normals(xy)
