"""Depth of field: a lens of finite aperture, in focus at one distance."""

from dataclasses import dataclass

import numpy as np

from peaksim.errors import SceneError


@dataclass(frozen=True)
class ThinLens:
    """A thin lens with a round aperture; "traced" draws its depth of field, truth stays that of the aperture's middle.

    A point z metres away becomes a disc of aperture_m·|z − focus_m|/(z·focus_m)·fx px across.
    """

    focus_m: float
    """Distance in focus: of a plane (brown) or a sphere (fisheye) around the camera centre, metres."""
    aperture_m: float
    """Diameter of the aperture, metres."""

    def __post_init__(self) -> None:
        for name in ("focus_m", "aperture_m"):
            if not 0 < getattr(self, name) < np.inf:
                raise SceneError(f"camera: {name}: expected a positive number, got {getattr(self, name)}")


def from_f_number(focus_m: float, focal_mm: float, f_number: float) -> ThinLens:
    """Return the lens of a focal length in millimetres and an f-number such as 2.8."""
    if not (0 < focal_mm < np.inf and 0 < f_number < np.inf):
        raise SceneError(f"camera: expected positive focal_mm and f_number, got {focal_mm} and {f_number}")
    return ThinLens(focus_m, focal_mm / 1000 / f_number)
