"""Marker patterns, the optimum that they come from, and 3-bit arrays; `sheet` lays them out for print."""

from peakmark.markers.array_code import THREE_BIT, Layout, code_of, polarities_of
from peakmark.markers.optimum import Limit, linear_optimum, quadratic_optimum
from peakmark.markers.patterns import Polarity, sift_marker, surf_marker

__all__ = [
    "THREE_BIT",
    "Layout",
    "Limit",
    "Polarity",
    "code_of",
    "linear_optimum",
    "polarities_of",
    "quadratic_optimum",
    "sift_marker",
    "surf_marker",
]
