"""What a scene and its camera have that the renderers without path tracing leave out."""

from peaksim.camera.camera import Camera
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.scene import Scene


def left_out(scene: Scene, camera: Camera) -> tuple[str, ...]:
    """Return in words what "exact" and "gl" do not draw, () if nothing."""
    materials = [quad.material for quad in scene.quads] + [mesh.material for mesh in scene.meshes]
    return tuple(
        name
        for name, is_there in (
            ("area lights", any(isinstance(light, AreaLight) for light in scene.lights)),
            ("light from the environment", any(isinstance(light, Environment) for light in scene.lights)),
            ("gloss", any(material.kind == "plastic" for material in materials)),
            ("depth of field", camera.thin_lens is not None),
        )
        if is_there
    )
