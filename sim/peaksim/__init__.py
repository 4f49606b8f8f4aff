"""peaksim: scenes of textured quads, rendered with pixels and truth that can be trusted."""

from importlib import import_module
from typing import Any

_HOMES = {
    "Camera": "camera",
    "Frame": "frame",
    "Light": "scene",
    "Mark": "scene",
    "Mesh": "scene",
    "Quad": "scene",
    "Scene": "scene",
    "Texture": "texture",
    "Trajectory": "trajectory",
    "camera_named": "camera_models",
    "load_scene": "scene_file",
    "load_trajectory": "trajectory_file",
    "optical_flow": "flow",
    "render": "rendering",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """Import a public name's module on first use, so that `import peaksim` costs nothing (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'peaksim' has no attribute {name!r}")
    return getattr(import_module(f"peaksim.{_HOMES[name]}"), name)
