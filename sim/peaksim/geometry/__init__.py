"""Poses, trajectories and paths: where things are, and when."""

from peaksim.geometry.floor_path import FloorPath
from peaksim.geometry.pose import invert, look_at, transform
from peaksim.geometry.trajectory import Trajectory
from peaksim.geometry.trajectory_file import load_trajectory, save_trajectory

__all__ = ["FloorPath", "Trajectory", "invert", "load_trajectory", "look_at", "save_trajectory", "transform"]
