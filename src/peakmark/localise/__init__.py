"""Markers → where the camera is: on a map, from arrays, from frame to frame."""

from peakmark.localise.from_arrays import Place, pose_from_arrays
from peakmark.localise.locate import FloorMap, Located, locate
from peakmark.localise.odometry import odometry
from peakmark.localise.pose import PoseEstimate, PoseFit
from peakmark.localise.tracks import Tracks, follow

__all__ = [
    "FloorMap",
    "Located",
    "Place",
    "PoseEstimate",
    "PoseFit",
    "Tracks",
    "follow",
    "locate",
    "odometry",
    "pose_from_arrays",
]
