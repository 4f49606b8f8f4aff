"""Smooth paths on a floor, parametrised by arc length."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

_STEPS = 10_000
"""Points of the table of arc lengths: 1.4 mm apart on the longest path that ships (14 m)."""


@dataclass(frozen=True, eq=False)
class FloorPath:
    """A cubic spline through waypoints; before its start and beyond its end it continues straight."""

    waypoints_m: NDArray[np.float64]
    """(n, 2) points in order, n ≥ 2, no two neighbours equal."""

    @cached_property
    def _curve(self) -> Any:
        points = np.asarray(self.waypoints_m, dtype=np.float64)
        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return scipy.interpolate.CubicSpline(chord, points)

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Curve parameters, arc lengths and points at even parameters."""
        at = np.linspace(0, self._curve.x[-1], _STEPS)
        points = self._curve(at)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return at, arc, points

    @property
    def length_m(self) -> float:
        """Arc length between the first and the last waypoint."""
        return float(self._table[1][-1])

    def at(self, arc_m: ArrayLike) -> NDArray[np.float64]:
        """Return (n, 2) points at arc lengths from the first waypoint."""
        arc, inside, parameter = self._parameter(arc_m)
        beyond = (arc - inside)[:, None] * self._directions(parameter)
        return np.asarray(self._curve(parameter) + beyond)

    def heading_rad(self, arc_m: ArrayLike) -> NDArray[np.float64]:
        """Return (n,) directions of travel, counter-clockwise from +x."""
        directions = self._directions(self._parameter(arc_m)[2])
        return np.asarray(np.arctan2(directions[:, 1], directions[:, 0]))

    def nearest(self, xy_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the (n,) arc lengths of the path nearest to (n, 2) points, and how far left of it they are, m."""
        points = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        _, arc, samples = self._table
        at = arc[scipy.spatial.cKDTree(samples).query(points)[1]]
        directions = self._directions(self._parameter(at)[2])
        off = points - self.at(at)
        at = at + np.where((at > 0) & (at < self.length_m), 0.0, (off * directions).sum(axis=1))
        off = points - self.at(at)
        return at, directions[:, 0] * off[:, 1] - directions[:, 1] * off[:, 0]

    def _parameter(self, arc_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        arc = np.atleast_1d(np.asarray(arc_m, dtype=np.float64))
        inside = np.clip(arc, 0, self.length_m)
        return arc, inside, np.interp(inside, self._table[1], self._table[0])

    def _directions(self, parameter: NDArray[np.float64]) -> NDArray[np.float64]:
        slope = self._curve(parameter, 1)
        return np.asarray(slope / np.linalg.norm(slope, axis=1, keepdims=True))
