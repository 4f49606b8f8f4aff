"""glTF, GLB, OBJ, PLY and STL files as triangles, with the images and base colours that they show.

Read by trimesh, from the file's own folder alone. Only base colours are taken over: no metal, gloss, bumps or light, no
transparency and no animation. Levels are coded as in the files' images (sRGB); glTF states colours that are linear,
which are coded like them, so that images and colours agree. `Material(curve="srgb")` makes both linear again.
"""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from peaksim.errors import InputError, SceneError
from peaksim.extras import needs_extra
from peaksim.image_file import check_is_image, from_pillow, to_8_bits
from peaksim.scene.material import WHITE, linear_from_srgb, srgb_from_linear
from peaksim.scene.repeated import divide_at_repeats
from peaksim.scene.skin import Skin
from peaksim.scene.texture import MAX_TEXELS, Texture
from peaksim.shipped import file_inside

FORMATS = ("glb", "gltf", "obj", "ply", "stl")
MOST_FACES = 1_000_000
"""Larger meshes are refused: tables and tree of their faces would take gigabytes, and minutes."""
MOST_BYTES = 2_000_000_000
_LEAST_HEIGHT = 1e-7
"""A face lower than this share of its longest side is a line."""
_Z_FROM_Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
_REPEATED = 10497
"""OpenGL's number for an image that is repeated, glTF's default."""

Up = Literal["y", "z"]


class FileMesh(NamedTuple):
    """What a file shows."""

    corners: NDArray[np.float64]
    """(m, 3, 3) corners of faces, z up, in the file's unit."""
    skin: Skin
    """Images and colours."""
    remarks: tuple[str, ...]
    """What was dropped or left out, in words."""


@dataclass
class _Part:
    """Faces with one image, or without."""

    corners: NDArray[np.float64]
    colors: NDArray[np.float64] | None = None
    """(m, 3, 3) grey levels."""
    uv: NDArray[np.float64] | None = None
    image: Any = None
    """Pillow's."""
    factor: tuple[float, ...] = (1.0, 1.0, 1.0)
    """Linear, of the image's levels."""


@dataclass
class _Found:
    """What was found on the way."""

    parts: list[_Part] = field(default_factory=list)
    left_out: dict[str, None] = field(default_factory=dict)
    """In the order in which it was found."""
    pictured: set[str | None] = field(default_factory=set)
    """Names of the materials of glTF that have an image."""


def read_mesh(path: str | Path, up: Up | None = None, color: tuple[float, float, float] = (128.0,) * 3) -> FileMesh:
    """Return the triangles of a file.

    Parameters
    ----------
    path
        A file of one of `FORMATS`; other files that it names must lie in or below its folder.
    up
        Its axis that points up: "y" (the default for glTF, which says so) or "z" (for all others).
    color
        Grey levels 0…255, RGB, of faces for which the file states neither image nor colour.

    Raises
    ------
    SceneError
        One line that names the file: it is missing or damaged, names files that are missing or elsewhere, has no
        triangles or too many, or is compressed in a way that is not read here.
    ImageError
        The same for its images.
    """
    path = Path(path)
    kind = path.suffix[1:].lower()
    if kind not in FORMATS:
        raise SceneError(f"{path}: expected a file ending in {', '.join(FORMATS)}, got {path.name!r}")
    if up not in (None, "y", "z"):
        raise SceneError(f'{path}: up: expected "y" or "z", got {up!r}')
    found = _Found()
    scene = _load(path, kind, found)
    for matrix, geometry in _placed(scene):
        found.parts.append(_part(geometry, matrix, kind, found, str(path)))
    if (up or ("y" if kind in ("glb", "gltf") else "z")) == "y":
        for part in found.parts:
            part.corners = part.corners @ _Z_FROM_Y_UP.T
    dropped = sum(_drop_lines(part) for part in found.parts)
    if dropped:
        found.left_out[f"{dropped} faces without area"] = None
    parts = [part for part in found.parts if len(part.corners)]
    if not parts:
        raise SceneError(f"{path}: expected triangles, got none")
    if not all(np.isfinite(part.corners).all() for part in parts):
        raise SceneError(f"{path}: expected finite positions, got nan or infinity")
    skin = _skin(parts, color, str(path))
    return FileMesh(np.concatenate([part.corners for part in parts]), skin, tuple(found.left_out))


# --- the file ---------------------------------------------------------------------------------------------------


@needs_extra
def _load(path: Path, kind: str, found: _Found) -> Any:
    """Return trimesh's scene."""
    import trimesh

    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise SceneError(f"{path}: expected at most {MOST_BYTES} bytes, got {size}")
        content = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from error
    beside = _resolver(path)
    if kind in ("glb", "gltf"):
        _check_gltf(path, _gltf_header(path, content), found)
    try:
        scene = trimesh.load_scene(
            trimesh.util.wrap_as_stream(content), file_type=kind, resolver=beside, process=False, maintain_order=True
        )
    except SceneError:
        raise
    except Exception as error:  # each reader of trimesh raises what it happens to
        raise SceneError(f"{path}: damaged: {' '.join(str(error).split()) or type(error).__name__:.200}") from error
    if beside.fault:
        raise SceneError(beside.fault)
    _check_count(scene, path)
    return scene


def _check_count(scene: Any, path: Path) -> None:
    count = sum(len(geometry.faces) for _, geometry in _placed(scene))
    if count > MOST_FACES:
        raise SceneError(f"{path}: expected at most {MOST_FACES} faces, got {count}; simplify the mesh")


def _placed(scene: Any) -> Iterator[tuple[NDArray[np.float64], Any]]:
    """Yield the pose and geometry of every triangle mesh of trimesh's scene, in the order of its nodes' names."""
    for node in sorted(scene.graph.nodes_geometry):
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if hasattr(geometry, "faces") and len(geometry.faces):
            yield np.asarray(matrix, dtype=np.float64), geometry


@needs_extra
def _resolver(path: Path) -> Any:
    """Return trimesh's way to the files that a file names: those in or below its folder."""
    from trimesh.resolvers import Resolver

    class Beside(Resolver):  # type: ignore[misc]
        """Reads files beside a file, and remembers the first that it could not: trimesh goes on without them."""

        def __init__(self) -> None:
            self.fault: str | None = None

        def get(self, key: str) -> bytes:
            try:
                name = unquote(key.strip())
                file = file_inside(path.parent, name.replace("\\", "/"), f"{path}: file it needs")
                if file.suffix.lower() not in (".mtl", ".bin"):
                    check_is_image(file)
                return file.read_bytes()
            except (InputError, OSError) as error:
                self.fault = self.fault or str(error)
                raise

        def keys(self) -> list[str]:
            return []

        def namespaced(self, namespace: str) -> "Beside":
            return self

        def write(self, name: str, data: bytes) -> None:
            raise NotImplementedError

    return Beside()


# --- glTF -------------------------------------------------------------------------------------------------------


def _gltf_header(path: Path, content: bytes) -> dict[str, Any]:
    """Return the JSON of a glTF or GLB file."""
    try:
        if content[:4] == b"glTF":
            (length,) = struct.unpack_from("<I", content, 12)
            content = content[20 : 20 + length]
        header = json.loads(content)
    except (ValueError, struct.error, RecursionError) as error:
        raise SceneError(f"{path}: expected glTF 2.0, found none: {error}") from error
    if not isinstance(header, dict) or not isinstance(header.get("asset"), dict):
        raise SceneError(f"{path}: expected glTF 2.0, found none")
    return header


def _check_gltf(path: Path, header: dict[str, Any], found: _Found) -> None:
    """Refuse what trimesh would pass over in silence, and note what is left out."""
    for extension in header.get("extensionsRequired", ()):
        if not str(extension).startswith("KHR_materials_"):
            raise SceneError(f"{path}: expected a glTF file without required extensions, got {extension!r:.80}")
    for extension in header.get("extensionsUsed", ()):
        if extension == "KHR_texture_transform":
            found.left_out["the transformation of texture coordinates"] = None
    named = [item.get("uri") for key in ("buffers", "images") for item in header.get(key, ()) if isinstance(item, dict)]
    for uri in named:
        if isinstance(uri, str) and not uri.startswith("data:"):
            file_inside(path.parent, unquote(uri), f"{path}: uri")
    for material in header.get("materials", ()):
        if "baseColorTexture" in material.get("pbrMetallicRoughness", ()):
            found.pictured.add(material.get("name"))
    if any(material.get("alphaMode", "OPAQUE") != "OPAQUE" for material in header.get("materials", ())):
        found.left_out["transparency"] = None
    modes = {sampler.get(side, _REPEATED) for sampler in header.get("samplers", ()) for side in ("wrapS", "wrapT")}
    if modes - {_REPEATED}:
        found.left_out["clamping and mirroring of images, which are repeated"] = None


# --- one part ---------------------------------------------------------------------------------------------------


def _part(geometry: Any, matrix: NDArray[np.float64], kind: str, found: _Found, path: str) -> _Part:
    """Return the faces of one geometry, placed."""
    vertices = np.asarray(geometry.vertices, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = np.asarray(geometry.faces, dtype=np.int64)
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    visual, is_linear = geometry.visual, kind in ("glb", "gltf")
    part = _Part(vertices[faces])
    if visual.kind == "texture":
        material = visual.material
        image, color = _base(material, is_linear)
        if image is None and is_linear and visual.uv is not None and material.name in found.pictured:
            raise SceneError(f"{path}: image of material {material.name!r}: expected an image, found none")
        if image is not None and visual.uv is not None and len(visual.uv) == len(vertices):
            part.uv = np.asarray(visual.uv, dtype=np.float64)[faces]
            part.image, part.factor = image, color
            if "color" in visual.vertex_attributes:
                found.left_out["colours of vertices on images"] = None
        elif color is not None:
            part.colors = np.broadcast_to(_levels(np.array(color), is_linear), part.corners.shape)
    elif visual.kind == "vertex":
        part.colors = _levels(np.asarray(visual.vertex_colors)[:, :3] / WHITE, is_linear)[faces]
    elif visual.kind == "face":
        levels = _levels(np.asarray(visual.face_colors)[:, :3] / WHITE, is_linear)
        part.colors = np.repeat(levels[:, None], 3, axis=1)
    return part


def _base(material: Any, is_linear: bool) -> tuple[Any, tuple[float, ...]]:
    """Return the image and the colour, 0…1, of one of trimesh's materials; an image hides the colour but in glTF."""
    if is_linear:
        factor = material.baseColorFactor
        color = (1.0, 1.0, 1.0) if factor is None else tuple((np.asarray(factor)[:3] / WHITE).tolist())
        return material.baseColorTexture, color
    simple = material if hasattr(material, "diffuse") else material.to_simple()
    if getattr(simple, "image", None) is not None:
        return simple.image, (1.0, 1.0, 1.0)
    return None, tuple((np.asarray(simple.diffuse)[:3] / WHITE).tolist())


def _levels(shares: NDArray[np.float64], is_linear: bool) -> NDArray[np.float64]:
    """Return grey levels as they are coded in images."""
    return WHITE * np.clip(srgb_from_linear(shares) if is_linear else shares, 0, 1)


def _drop_lines(part: _Part) -> int:
    """Remove the faces without area; return how many."""
    sides = np.roll(part.corners, -1, axis=1) - part.corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1, initial=0)
    twice = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    keep = ~(twice <= _LEAST_HEIGHT * longest**2)
    part.corners = part.corners[keep]
    part.colors = None if part.colors is None else part.colors[keep]
    part.uv = None if part.uv is None else part.uv[keep]
    return int((~keep).sum())


# --- the skin ---------------------------------------------------------------------------------------------------


def _skin(parts: list[_Part], color: tuple[float, float, float], path: str) -> Skin:
    """Return the images and colours of all parts, whose faces it may divide where images are repeated."""
    textures: dict[Any, tuple[int, Texture]] = {}
    numbers, uvs, colors = [], [], []
    for part in parts:
        number = -1
        if part.image is not None and part.uv is not None:
            part.corners, part.uv, is_repeated = divide_at_repeats(part.corners, part.uv, MOST_FACES, path)
            key = id(part.image), part.factor, is_repeated
            if key not in textures:
                textures[key] = len(textures), _texture(part.image, part.factor, is_repeated, path)
            number, texture = textures[key]
            if is_repeated:
                part.uv = (part.uv * texture.size + (1 - 2 * part.uv)) / texture.size
        count = len(part.corners)
        numbers.append(np.full(count, number))
        uvs.append(np.zeros((count, 3, 2)) if part.uv is None else part.uv)
        colors.append(np.broadcast_to(np.array(color), (count, 3, 3)) if part.colors is None else part.colors)
    images = tuple(texture for _, texture in textures.values())
    return Skin(images, np.concatenate(numbers), np.concatenate(uvs), np.concatenate(colors))


def _texture(image: Any, factor: tuple[float, ...], is_repeated: bool, path: str) -> Texture:
    """Return an image times a linear factor; one that is repeated has its opposite border beyond each border."""
    levels = to_8_bits(from_pillow(image, f"{path}: image", MAX_TEXELS))
    if factor != (1.0, 1.0, 1.0):
        decoded = linear_from_srgb(np.arange(256) / WHITE)
        coded = np.rint(_levels(decoded[:, None] * np.array(factor), is_linear=True)).astype(np.uint8)
        rgb = np.broadcast_to(np.atleast_3d(levels), (*levels.shape[:2], 3))
        levels = np.stack([coded[rgb[:, :, k], k] for k in range(3)], axis=2)
    if is_repeated:
        levels = np.pad(levels, [(1, 1), (1, 1), *[(0, 0)] * (levels.ndim - 2)], mode="wrap")
    return Texture.from_array(levels)
