"""What a recording holds of one moment."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose


@dataclass(frozen=True)
class Moment:
    """One image, and what is known of it."""

    time_s: float
    """From the start of the recording; it grows from one moment to the next."""
    image: NDArray[Any]
    """(H, W) grey or (H, W, 3) RGB, uint8."""
    camera: Camera | None = None
    """That took it, if it is known."""
    outlines: tuple[tuple[str, NDArray[np.float64]], ...] = ()
    """Name and (4, 2) corners, px, of what was found in it."""
    estimate: Pose | None = None
    """(4, 4) world_from_camera as it was found."""
    covariance: NDArray[np.float64] | None = None
    """(6, 6) of a small step of the estimate in the camera's frame: rotation vector, rad, then translation, m."""
    truth: Pose | None = None
    """(4, 4) world_from_camera as it is, where that is known."""
