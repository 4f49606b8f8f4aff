"""A scene in Mitsuba's terms: quads, meshes, materials and lights.

Levels become reflectance by level / 255, and radiance is in units of white. The multiplier M of `peaksim.scene.Light`
is irradiance / π here: a diffuse surface of reflectance ρ shows the radiance ρ·M.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import BACK_LEVEL, channels_of, corner_levels, mesh_levels
from peaksim.scene.bend import Bend
from peaksim.scene.lamps import AreaLight, Environment
from peaksim.scene.material import WHITE, Material
from peaksim.scene.scene import Light, Mesh, Quad, Scene
from peaksim.scene.skin import Skin
from peaksim.scene.texture import Texture
from peaksim.traced.library import tools_for

_TOUCH_M = 1e-5
"""Quads that lie this close to one plane are one plane for single precision in a room."""
_LIFT_M = 2e-5
"""Of quads in one plane the later one is drawn, as by the other renderers: it is put this far before the earlier."""


class Traceable(NamedTuple):
    """A scene that paths can be traced in."""

    scene: Any
    """Mitsuba's."""
    is_lit: bool
    """Whether it has light that travels: without any, there are no paths to trace."""
    fill: tuple[Light, ...]
    """Light that does not travel, for it reaches what is seen through everything: ambient, and without shadows."""


@lru_cache(maxsize=2)
def traceable(scene: Scene) -> Traceable:
    """Return a scene in Mitsuba's terms, in the variant of its channels; the frames of a film share one."""
    channels = channels_of(scene)
    fill = tuple(light for light in scene.plain_lights if light.kind == "ambient" or not light.casts_shadows)
    travelling = [light for light in scene.lights if light not in fill]
    with tools_for(channels) as (mi, _):
        # each object is loaded by itself: their order in the scene, and so in its noise, is then the same every time
        objects: dict[str, Any] = {"type": "scene"}
        prints: dict[Any, Any] = {}
        for k, (quad, lift_m) in enumerate(zip(scene.quads, lifts_m(scene.quads), strict=True)):
            key = quad.texture, quad.material
            if key not in prints:
                front = _surface(mi, quad.material, _image(mi, quad.texture, quad.material))
                prints[key] = _two_sided(mi, front, _plain(mi, BACK_LEVEL))
            if quad.bend is None:
                square = _rectangle(mi, quad.world_from_quad, quad.size_m, lift_m)
                objects[f"quad{k}"] = mi.load_dict({**square, "bsdf": prints[key]})
            else:
                objects[f"quad{k}"] = _triangles(mi, f"quad{k}", prints[key], bent_corners(quad, quad.bend))
        for k, mesh in enumerate(scene.meshes):
            for j, part in enumerate(_mesh(mi, mesh, channels)):
                objects[f"mesh{k}_{j}"] = part
        for k, light in enumerate(travelling):
            objects[f"light{k}"] = mi.load_dict(_emitter(mi, light))
        is_lit = any(_strength(light) > 0 for light in travelling)
        return Traceable(mi.load_dict(objects), is_lit, fill if scene.lights else (Light("ambient", 1.0),))


def _strength(light: Light | AreaLight | Environment) -> float:
    return light.intensity if isinstance(light, Light) else light.radiance


# --- surfaces ---------------------------------------------------------------------------------------------------


def lifts_m(quads: tuple[Quad, ...]) -> NDArray[np.float64]:
    """Return (q,) how far each quad is moved along its normal to lie before the earlier ones in its plane, metres."""
    lifts = np.zeros(len(quads))
    corners = np.array([quad.corners_m for quad in quads]).reshape(-1, 4, 3)
    for k, quad in enumerate(quads[1:], start=1):
        local = (corners[:k] - quad.world_from_quad[:3, 3]) @ quad.world_from_quad[:3, :3]
        low, high = local[:, :, :2].min(axis=1), local[:, :, :2].max(axis=1)
        reach = np.array(quad.size_m) / 2
        under = (np.abs(local[:, :, 2]).max(axis=1) < _TOUCH_M) & ((low < reach) & (high > -reach)).all(axis=1)
        lifts[k] = lifts[:k][under].max(initial=-_LIFT_M) + _LIFT_M
    return lifts


def _rectangle(mi: Any, pose: NDArray[np.float64], size_m: tuple[float, float], lift_m: float = 0.0) -> dict[str, Any]:
    """Return Mitsuba's square of side 2, put where a rectangle is; v runs up from its lower edge."""
    placed = pose @ np.diag([size_m[0] / 2, size_m[1] / 2, 1, 1])
    placed[:3, 3] += lift_m * pose[:3, 2]
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(placed)}


def _mesh(mi: Any, mesh: Mesh, channels: int) -> Iterator[Any]:
    """Yield a mesh: its faces without an image, then those of each image."""
    corners, skin = mesh.triangles_m, mesh.skin or Skin()
    numbers = skin.textured(len(corners))
    for number in np.unique(numbers).tolist():
        some = np.flatnonzero(numbers == number)
        if number >= 0 and skin.uv is not None:
            reflectance, values = _image(mi, skin.textures[number], mesh.material), {"texcoords": skin.uv[some]}
        elif skin.colors is not None:
            levels = corner_levels(skin.colors[some], mesh.material, channels)
            reflectance, values = {"type": "mesh_attribute", "name": "vertex_color"}, {"color": levels / WHITE}
        else:
            reflectance, values = _plain_reflectance(mi, mesh_levels(mesh, channels)), {}
        side = {"type": "twosided", "side": _surface(mi, mesh.material, reflectance)}
        yield _triangles(mi, f"{mesh.name}_{number}", mi.load_dict(side), {"positions": corners[some], **values})


def bent_corners(quad: Quad, bend: Bend) -> dict[str, NDArray[np.float64]]:
    """Return positions, normals and texture coordinates at the corners of a bent quad's panels, two triangles each."""
    panels = quad.panels_m
    shares = np.linspace(0, 1, len(panels) + 1)
    ends = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])  # right and down, of a panel
    places = np.tile(ends, (len(panels), 1, 1))
    places[:, :, bend.along] = np.where(ends[:, bend.along] > 0, shares[1:, None], shares[:-1, None])
    xy_m = (places - 0.5) * [1, -1] * quad.size_m
    normals = quad.normals_at(xy_m.reshape(-1, 2)).reshape(-1, 4, 3)
    uv, two = np.stack([places[..., 0], 1 - places[..., 1]], axis=-1), [0, 3, 2, 0, 2, 1]
    return {
        name: values[:, two].reshape(-1, 3, values.shape[-1])
        for name, values in (("positions", panels), ("normals", normals), ("texcoords", uv))
    }


def _triangles(mi: Any, name: str, bsdf: Any, values: dict[str, NDArray[np.float64]]) -> Any:
    """Return (n, 3, …) values at the corners of triangles as Mitsuba's mesh."""
    properties, n = mi.Properties(), len(values["positions"])
    properties["mesh_bsdf"], properties["face_normals"] = bsdf, "normals" not in values
    made = mi.Mesh(
        name,
        3 * n,
        n,
        has_vertex_normals="normals" in values,
        has_vertex_texcoords="texcoords" in values,
        props=properties,
    )
    if "color" in values:
        made.add_attribute("vertex_color", values["color"].shape[-1], [0.0] * values["color"].size)
    own = mi.traverse(made)
    for key, array in values.items():
        own[f"vertex_{key}"] = np.ascontiguousarray(array, dtype=np.float32).ravel()
    own["faces"] = np.arange(3 * n, dtype=np.uint32)
    own.update()
    return made


def _two_sided(mi: Any, front: dict[str, Any], back: dict[str, Any]) -> Any:
    return mi.load_dict({"type": "twosided", "front": front, "back": back})


def _surface(mi: Any, material: Material, reflectance: dict[str, Any]) -> dict[str, Any]:
    if material.kind == "diffuse":
        return {"type": "diffuse", "reflectance": reflectance}
    plastic = {"diffuse_reflectance": reflectance, "int_ior": material.ior}
    if material.roughness == 0:
        return {"type": "plastic", **plastic}
    return {"type": "roughplastic", "distribution": "ggx", "alpha": material.roughness, **plastic}


def _plain(mi: Any, level: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": _plain_reflectance(mi, np.array([level]))}


def _plain_reflectance(mi: Any, levels: NDArray[np.float64]) -> dict[str, Any]:
    """Return the reflectance of one or three linear grey levels."""
    shares = np.clip(levels / WHITE, 0, 1)
    if len(shares) == 3:
        return {"type": "rgb", "value": shares.tolist()}
    return {"type": "uniform", "value": float(shares[0])}


def _image(mi: Any, texture: Texture, material: Material) -> dict[str, Any]:
    """Return a printed texture: bilinear between the centres of texels and clamped, as `peaksim.scene.Texture` is."""
    levels = material.levels(texture.pixels).astype(np.float32)
    shares = np.ascontiguousarray(np.atleast_3d(levels)[::-1] / np.float32(WHITE))  # the first row is at v = 0
    return {"type": "bitmap", "data": mi.TensorXf(shares), "raw": True, "wrap_mode": "clamp"}


# --- lights -----------------------------------------------------------------------------------------------------


def _emitter(mi: Any, light: Light | AreaLight | Environment) -> dict[str, Any]:
    if isinstance(light, AreaLight):
        shines = {"type": "area", "radiance": _uniform(light.radiance)}
        return _rectangle(mi, light.world_from_light, light.size_m) | {"emitter": shines, "bsdf": _plain(mi, 0.0)}
    if isinstance(light, Environment):
        return _surroundings(mi, light)
    if light.kind == "directional":
        return {
            "type": "directional",
            "direction": list(light.direction),
            "irradiance": _uniform(np.pi * light.intensity),
        }
    power = np.pi * light.intensity * light.reference_m**2
    return {"type": "point", "position": list(light.position_m), "intensity": _uniform(power)}


def _uniform(value: float) -> dict[str, Any]:
    return {"type": "uniform", "value": float(value)}


def _surroundings(mi: Any, light: Environment) -> dict[str, Any]:
    if light.image is None:
        return {"type": "constant", "radiance": _uniform(light.radiance)}
    grey_or_rgb = np.atleast_3d(light.image)
    pixels = np.array(np.broadcast_to(grey_or_rgb, (*grey_or_rgb.shape[:2], 3)), order="C")  # Mitsuba wants it writable
    # Mitsuba's map has y up, and its middle column looks along z: upright, that is −y
    rotation = mi.ScalarTransform4f().rotate([0, 0, 1], light.yaw_deg + 180) @ mi.ScalarTransform4f().rotate(
        [1, 0, 0], 90
    )
    return {"type": "envmap", "bitmap": mi.Bitmap(pixels), "scale": float(light.radiance), "to_world": rotation}
