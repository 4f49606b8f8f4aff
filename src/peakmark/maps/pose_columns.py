"""A pose as plain values by name, the same in files of poses and in data frames."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from peaksim.geometry.trajectory import Trajectory, quaternions_xyzw


class Posed(Protocol):
    """What is said of a pose."""

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(4, 4)."""

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(6, 6), see `Location`."""

    @property
    def position_sigma_m(self) -> NDArray[np.float64]:
        """(3,) world."""

    @property
    def rotation_sigma_deg(self) -> float:
        """Root of the sum over three axes."""

    @property
    def markers(self) -> int:
        """Of the map that were seen."""

    @property
    def rms_px(self) -> float:
        """Reprojection error."""

    @property
    def is_certain(self) -> bool:
        """Whether no other pose explains the image nearly as well."""

    @property
    def other(self) -> NDArray[np.float64] | None:
        """(4, 4) the second solution."""

    @property
    def page(self) -> int | None:
        """Sheet of paper whose frame it is in."""


def pose_columns(posed: Posed) -> dict[str, Any]:
    """Return position and quaternion, σ, certainty, the second solution, and the covariance, its upper triangle."""
    names = [f"c{i}{j}" for i, j in zip(*np.triu_indices(6), strict=True)]
    sigmas = zip(("sigma_x_m", "sigma_y_m", "sigma_z_m"), map(float, posed.position_sigma_m), strict=True)
    return {
        **_columns("", posed.world_from_camera),
        "markers": posed.markers,
        "rms_px": posed.rms_px,
        **dict(sigmas),
        "sigma_deg": posed.rotation_sigma_deg,
        "is_certain": posed.is_certain,
        "page": posed.page,
        **_columns("other_", posed.other),
        **dict(zip(names, map(float, posed.covariance[np.triu_indices(6)]), strict=True)),
    }


def _columns(prefix: str, pose: NDArray[np.float64] | None) -> dict[str, float | None]:
    names = [f"{prefix}{name}" for name in ("tx", "ty", "tz", "qx", "qy", "qz", "qw")]
    if pose is None:
        return dict.fromkeys(names)
    quaternion = quaternions_xyzw(Trajectory(np.zeros(1), pose[None]))[0]
    return dict(zip(names, map(float, (*pose[:3, 3], *quaternion)), strict=True))
