"""peaksim: scenes of textured quads, rendered with pixels and truth that can be trusted.

Names are imported when first used, so that `import peaksim` stays quick.
"""

from typing import TYPE_CHECKING

from peaksim.lazy import lazy_names

if TYPE_CHECKING:
    from peaksim.camera.camera import Camera as Camera
    from peaksim.camera.frame import Frame as Frame
    from peaksim.camera.models import camera_named as camera_named
    from peaksim.geometry.trajectory import Trajectory as Trajectory
    from peaksim.geometry.trajectory_file import load_trajectory as load_trajectory
    from peaksim.rendering import render as render
    from peaksim.scene.bend import Bend as Bend
    from peaksim.scene.file import load_scene as load_scene
    from peaksim.scene.scene import Light as Light
    from peaksim.scene.scene import Mark as Mark
    from peaksim.scene.scene import Mesh as Mesh
    from peaksim.scene.scene import Quad as Quad
    from peaksim.scene.scene import Scene as Scene
    from peaksim.scene.skin import Skin as Skin
    from peaksim.scene.texture import Texture as Texture
    from peaksim.truth.flow import optical_flow as optical_flow

__all__, __getattr__, __dir__ = lazy_names(
    __name__,
    {
        "Camera": "peaksim.camera.camera",
        "Frame": "peaksim.camera.frame",
        "camera_named": "peaksim.camera.models",
        "Trajectory": "peaksim.geometry.trajectory",
        "load_trajectory": "peaksim.geometry.trajectory_file",
        "render": "peaksim.rendering",
        "Bend": "peaksim.scene.bend",
        "load_scene": "peaksim.scene.file",
        **dict.fromkeys(("Light", "Mark", "Mesh", "Quad", "Scene"), "peaksim.scene.scene"),
        "Skin": "peaksim.scene.skin",
        "Texture": "peaksim.scene.texture",
        "optical_flow": "peaksim.truth.flow",
    },
)
