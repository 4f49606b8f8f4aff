"""Ground truth: where markers and surfaces appear, how much of them is visible, and how they move."""

from peaksim.truth.flow import Flow, optical_flow
from peaksim.truth.markers import marker_truth

__all__ = ["Flow", "marker_truth", "optical_flow"]
