"""Markers → where the camera is: on a map, from arrays, from frame to frame."""

from peakmark.localise.from_arrays import ArrayPose, pose_from_arrays
from peakmark.localise.locate import FloorMap, Located, locate

__all__ = ["ArrayPose", "FloorMap", "Located", "locate", "pose_from_arrays"]
