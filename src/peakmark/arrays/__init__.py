"""Markers → 3-bit arrays: `decode_arrays`."""

from peakmark.arrays.decode import MarkerArray, decode_arrays

__all__ = ["MarkerArray", "decode_arrays"]
