"""A camera from photographs of a board: intrinsics, distortion, and how sure they are."""

from peakmark.calibration.fit import Calibration, calibrate
from peakmark.calibration.views import BoardView, board_view

__all__ = ["BoardView", "Calibration", "board_view", "calibrate"]
