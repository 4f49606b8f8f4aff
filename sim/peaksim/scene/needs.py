"""What a scene and its camera have that the renderers without path tracing leave out."""

from peaksim.camera.camera import Camera
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.scene import Scene


def left_out(scene: Scene, camera: Camera, is_baked: bool = False, is_unlit: bool = False) -> tuple[str, ...]:
    """Return in words what "exact" and "gl" do not draw, with or without baked light; () if nothing.

    "pyrender" draws nothing lit (`is_unlit`).
    """
    materials = [quad.material for quad in scene.quads] + [mesh.material for mesh in scene.meshes]
    skies = [light for light in scene.lights if isinstance(light, Environment)]
    return tuple(
        name
        for name, is_there in (
            ("light and shadow", is_unlit and len(scene.plain_lights) > 0),
            ("area lights", not is_baked and any(isinstance(light, AreaLight) for light in scene.lights)),
            ("light from the environment", not is_baked and len(skies) > 0),
            ("gloss", any(material.kind == "plastic" for material in materials)),
            ("depth of field", camera.thin_lens is not None),
        )
        if is_there
    )


def is_bakeable(scene: Scene) -> bool:
    """Return whether a scene has light that "exact" and "gl" show only where it is baked."""
    return any(isinstance(light, AreaLight | Environment) for light in scene.lights)
