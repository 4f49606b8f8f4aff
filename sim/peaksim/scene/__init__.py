"""Scenes: textured quads, meshes and lights, as values and as files."""

from peaksim.scene.file import Setup, load_scene
from peaksim.scene.ride import Bumps, Mount, Ride, follow_path
from peaksim.scene.ride_file import load_ride
from peaksim.scene.scene import Light, Mark, Mesh, Quad, Scene
from peaksim.scene.texture import Texture

__all__ = [
    "Bumps",
    "Light",
    "Mark",
    "Mesh",
    "Mount",
    "Quad",
    "Ride",
    "Scene",
    "Setup",
    "Texture",
    "follow_path",
    "load_ride",
    "load_scene",
]
