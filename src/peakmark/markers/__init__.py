"""Marker patterns, the optimum that they come from, 3-bit arrays, and sheets of them for print."""

from peakmark.markers.patterns import Polarity, sift_marker, surf_marker

__all__ = ["Polarity", "sift_marker", "surf_marker"]
