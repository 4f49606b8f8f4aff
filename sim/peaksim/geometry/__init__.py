"""Poses, trajectories and paths: where things are, and when."""

from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.pose import compose, interpolate, invert, look_at, pose_distance, rotation_about, transform
from peaksim.geometry.trajectory import Trajectory, from_quaternions, quaternions_xyzw
from peaksim.geometry.trajectory_file import load_trajectory, save_trajectory

__all__ = [
    "FloorPath",
    "Trajectory",
    "compose",
    "from_quaternions",
    "interpolate",
    "invert",
    "load_trajectory",
    "look_at",
    "pose_distance",
    "quaternions_xyzw",
    "rotation_about",
    "save_trajectory",
    "transform",
]
