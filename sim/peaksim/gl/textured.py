"""The renderer that leaves all to OpenGL: textures as pyrender draws them, at n × n samples a pixel.

OpenGL filters textures with mip levels, three linear interpolations and 8 bits, so that a pixel is not the integral of
what it shows; the samples make up for most of it. Nothing is lit.
"""

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peaksim.area.bands import Levels
from peaksim.area.faces import BACK_LEVEL, channels_of, corner_levels, distance_range, faces_of
from peaksim.camera.camera import Camera
from peaksim.geometry.pose import Pose
from peaksim.gl.context import draw_textured, load_pyrender
from peaksim.gl.tiles import ImageTile, split_into_tiles, window_of, window_positions
from peaksim.scene.bend import Bend
from peaksim.scene.material import WHITE, Material
from peaksim.scene.scene import Mesh, Quad, Scene
from peaksim.scene.skin import Skin
from peaksim.scene.texture import Texture

MOST_SAMPLES = 1024
"""Most samples a pixel: 32 × 32."""
_NEAREST_M = 1e-3
_LONGEST_SAMPLES = 4096
"""Longest side of what is drawn at once."""
_LARGEST_TEXTURE = 8192
"""Texels a side that every OpenGL takes; larger images are made smaller."""
_LINEAR, _MIP_MAPPED, _CLAMPED, _TRIANGLES = 9729, 9987, 33071, 4
_TWO = [0, 3, 2, 0, 2, 1]
"""Corners of a panel as two triangles, counter-clockwise from the printed side."""

Values = dict[str, NDArray[np.float64]]


def draw(scene: Scene, camera: Camera, world_from_camera: Pose, samples: int) -> Levels:
    """Return the (h, w, channels) levels of a scene without its light.

    `samples` a pixel are drawn, or as many more as make a square number.

    Raises
    ------
    RendererError
        If OpenGL fails.
    """
    count, channels = int(np.ceil(np.sqrt(samples))), channels_of(scene)
    nearest, farthest = distance_range(faces_of(scene), world_from_camera[:3, 3])
    if not np.isfinite(nearest):
        return np.full((camera.height, camera.width, channels), scene.background, np.float32)
    drawn = _drawn(scene)
    out = np.empty((camera.height, camera.width, channels), np.float32)
    for tile in split_into_tiles(camera, max(1, _LONGEST_SAMPLES // count)):
        window = window_of(tile, camera.is_pinhole, count)
        depths_m = max(_NEAREST_M, 0.99 * window.slant * nearest), 1.01 * farthest + 2 * _NEAREST_M
        levels = draw_textured(drawn, world_from_camera, window, depths_m)[:, :, :channels]
        if camera.is_pinhole:
            rows, columns = tile.rays.shape[0] - 1, tile.rays.shape[1] - 1
            means = levels.reshape(rows, count, columns, count, channels).mean(axis=(1, 3), dtype=np.float32)
        else:
            means = _through_lens(levels, tile, window.samples_from_camera, count)
        out[tile.rows, tile.columns] = means
    return out


def _through_lens(
    levels: NDArray[np.uint8], tile: ImageTile, samples_from_camera: NDArray[np.float64], count: int
) -> NDArray[np.float32]:
    """Return the means over pixels of a lens: of the drawn samples that are nearest to those of the pixel."""
    corners, steps = tile.rays, (np.arange(count) + 0.5) / count
    total = np.zeros((corners.shape[0] - 1, corners.shape[1] - 1, levels.shape[2]), np.float32)
    for t in steps:
        rows = (1 - t) * corners[:-1] + t * corners[1:]
        for s in steps:
            at = window_positions((1 - s) * rows[:, :-1] + s * rows[:, 1:], samples_from_camera)
            column, row = (np.clip(np.nan_to_num(at[..., k]).astype(int), 0, levels.shape[1 - k] - 1) for k in (0, 1))
            total += levels[row, column]
    return np.asarray(total / np.float32(count**2), dtype=np.float32)


# --- the scene ----------------------------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def _drawn(scene: Scene) -> Any:
    """Return the scene for pyrender: one mesh, so that the order of drawing never varies; of ties the first wins."""
    pyrender = load_pyrender()
    level = scene.background / WHITE
    drawn = pyrender.Scene(bg_color=[level, level, level, 1.0])
    primitives = [*_backs(scene.quads), *_fronts(scene.quads)]
    for mesh in scene.meshes:
        primitives += _triangles(mesh)
    if primitives:
        drawn.add(pyrender.Mesh(primitives))
    return drawn


def _backs(quads: tuple[Quad, ...]) -> list[Any]:
    if not quads:
        return []
    corners = np.concatenate([quad.panels_m[:, _TWO[::-1]] for quad in quads]).reshape(-1, 3)
    return [_primitive({"positions": corners}, None, [BACK_LEVEL / WHITE] * 3, two_sided=False)]


def _fronts(quads: tuple[Quad, ...]) -> list[Any]:
    """Return the prints, those of one image together, the last quad first."""
    groups: dict[tuple[Texture, Material], list[Quad]] = {}
    for quad in reversed(quads):
        groups.setdefault((quad.texture, quad.material), []).append(quad)
    made = []
    for (texture, material), some in groups.items():
        corners = np.concatenate([quad.panels_m[:, _TWO].reshape(-1, 3) for quad in some])
        uv = np.concatenate([_panel_uv(len(quad.panels_m), quad.bend).reshape(-1, 2) for quad in some])
        made.append(_primitive({"positions": corners, "texcoord_0": uv}, (texture, material), None, two_sided=False))
    return made


def _panel_uv(count: int, bend: Bend | None) -> NDArray[np.float64]:
    """Return (n, 6, 2) texture coordinates of a quad's panels."""
    ends = np.tile(np.array([[0, 1], [1, 1], [1, 0], [0, 0.0]]), (count, 1, 1))
    shares = np.linspace(0, 1, count + 1)[:, None]
    if bend is None or bend.along == 0:
        ends[:, [0, 3], 0], ends[:, [1, 2], 0] = shares[:-1], shares[1:]
    else:
        ends[:, [0, 1], 1], ends[:, [2, 3], 1] = 1 - shares[:-1], 1 - shares[1:]
    return ends[:, _TWO]


def _triangles(mesh: Mesh) -> list[Any]:
    """Return a mesh: its faces without an image, then those of each image."""
    corners, skin = mesh.triangles_m, mesh.skin or Skin()
    numbers, made = skin.textured(len(corners)), []
    for number in np.unique(numbers).tolist():
        some = numbers == number
        values = {"positions": corners[some].reshape(-1, 3)}
        if number >= 0 and skin.uv is not None:
            values["texcoord_0"] = skin.uv[some].reshape(-1, 2)
            made.append(_primitive(values, (skin.textures[number], mesh.material), None, two_sided=True))
            continue
        plain = np.broadcast_to(np.array(mesh.color), (*values["positions"].shape,))
        colors = plain if skin.colors is None else skin.colors[some].reshape(-1, 3)
        shares = corner_levels(colors, mesh.material, 3) / WHITE
        values["color_0"] = np.column_stack([shares, np.ones(len(shares))])
        made.append(_primitive(values, None, [1.0] * 3, two_sided=True))
    return made


def _primitive(
    values: Values, print_: tuple[Texture, Material] | None, color: list[float] | None, *, two_sided: bool
) -> Any:
    pyrender = load_pyrender()
    material = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=[*(color or [1.0] * 3), 1.0],
        baseColorTexture=None if print_ is None else _image(*print_),
        doubleSided=two_sided,
    )
    arrays = {name: np.asarray(array, np.float32) for name, array in values.items()}
    return pyrender.Primitive(**arrays, mode=_TRIANGLES, material=material)


def _image(texture: Texture, material: Material) -> Any:
    pyrender = load_pyrender()
    levels = np.clip(np.rint(material.levels(texture.pixels)), 0, 255).astype(np.uint8)
    if max(levels.shape[:2]) > _LARGEST_TEXTURE:
        size = tuple(min(side, _LARGEST_TEXTURE) for side in levels.shape[1::-1])
        levels = np.asarray(cv2.resize(levels, size, interpolation=cv2.INTER_AREA))
    rgba = np.full((*levels.shape[:2], 4), 255, np.uint8)
    rgba[..., :3] = levels if levels.ndim == 3 else levels[..., None]
    sampler = pyrender.Sampler(magFilter=_LINEAR, minFilter=_MIP_MAPPED, wrapS=_CLAMPED, wrapT=_CLAMPED)
    return pyrender.Texture(source=rgba, source_channels="RGBA", sampler=sampler)
