"""peaksim: scenes of textured quads, rendered with pixels and truth that can be trusted.

Names are imported when first used, so that `import peaksim` stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from peaksim.camera.camera import Camera
    from peaksim.camera.frame import Frame
    from peaksim.camera.models import camera_named
    from peaksim.geometry.trajectory import Trajectory
    from peaksim.geometry.trajectory_file import load_trajectory
    from peaksim.rendering import render
    from peaksim.scene.file import load_scene
    from peaksim.scene.scene import Light, Mark, Mesh, Quad, Scene
    from peaksim.scene.texture import Texture
    from peaksim.truth.flow import optical_flow

_HOMES = {
    "Camera": "peaksim.camera.camera",
    "Frame": "peaksim.camera.frame",
    "Light": "peaksim.scene.scene",
    "Mark": "peaksim.scene.scene",
    "Mesh": "peaksim.scene.scene",
    "Quad": "peaksim.scene.scene",
    "Scene": "peaksim.scene.scene",
    "Texture": "peaksim.scene.texture",
    "Trajectory": "peaksim.geometry.trajectory",
    "camera_named": "peaksim.camera.models",
    "load_scene": "peaksim.scene.file",
    "load_trajectory": "peaksim.geometry.trajectory_file",
    "optical_flow": "peaksim.truth.flow",
    "render": "peaksim.rendering",
}
"""Public name → its module."""

__all__ = [
    "Camera",
    "Frame",
    "Light",
    "Mark",
    "Mesh",
    "Quad",
    "Scene",
    "Texture",
    "Trajectory",
    "camera_named",
    "load_scene",
    "load_trajectory",
    "optical_flow",
    "render",
]


def __getattr__(name: str) -> Any:
    """Import a public name's module on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
