"""What the renderers are timed against: pyrender's own textures, 4×4 samples in every pixel, grey, one channel read."""

from functools import lru_cache
from typing import Any

import numpy as np
import pyrender
from OpenGL import GL
from peaksim import Scene
from peaksim.area.faces import BACK_LEVEL
from peaksim.camera.camera import Camera
from peaksim.gl.context import open_context
from peaksim.scene.scene import Quad

SAMPLES = 4
TILE_PX = (1024, 512)
DEPTHS_M = (0.02, 200.0)
LINEAR, MIP_MAPPED, CLAMPED = 9729, 9987, 33071


def draw(scene: Scene, camera: Camera, pose: np.ndarray) -> np.ndarray:
    """Return the (h, w) image."""
    drawn = _drawn(scene)
    out = np.empty((camera.height, camera.width), np.float32)
    for y in range(0, camera.height, TILE_PX[1]):
        for x in range(0, camera.width, TILE_PX[0]):
            width, height = min(TILE_PX[0], camera.width - x), min(TILE_PX[1], camera.height - y)
            out[y : y + height, x : x + width] = _tile(drawn, camera, pose, x, y, width, height)
    return out


def _tile(drawn: Any, camera: Camera, pose: np.ndarray, x: int, y: int, width: int, height: int) -> np.ndarray:
    renderer = open_context()[0]
    renderer.viewport_width, renderer.viewport_height = width * SAMPLES, height * SAMPLES
    lens = pyrender.IntrinsicsCamera(
        camera.fx * SAMPLES,
        camera.fy * SAMPLES,
        (camera.cx + 0.5 - x) * SAMPLES,
        (camera.cy + 0.5 - y) * SAMPLES,
        *DEPTHS_M,
    )
    node = drawn.add(lens, pose=pose @ np.diag([1.0, -1.0, -1.0, 1.0]))
    numbers_of, renderer._renderer._read_main_framebuffer = renderer._renderer._read_main_framebuffer, _read_red
    try:
        fine, _ = renderer.render(drawn, flags=pyrender.RenderFlags.FLAT)
    finally:
        renderer._renderer._read_main_framebuffer = numbers_of
        drawn.remove_node(node)
    rows = fine.reshape(height, SAMPLES, width * SAMPLES).sum(axis=1, dtype=np.uint16)
    return rows.reshape(height, width, SAMPLES).sum(axis=2, dtype=np.uint16) / np.float32(SAMPLES**2)


def _read_red(scene: Any, flags: int) -> tuple[np.ndarray, None]:
    renderer = open_context()[0]._renderer
    width, height = renderer._main_fb_dims
    GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, renderer._main_fb_ms)
    GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
    levels = np.empty((height, width), np.uint8)
    GL.glReadPixels(0, 0, width, height, GL.GL_RED, GL.GL_UNSIGNED_BYTE, levels)
    return levels[::-1], None


@lru_cache(maxsize=1)
def _drawn(scene: Scene) -> Any:
    level = scene.background / 255
    drawn = pyrender.Scene(bg_color=[level, level, level, 1.0])
    backs = np.concatenate([quad.corners_m[[0, 1, 2, 0, 2, 3]] for quad in scene.quads]).astype(np.float32)
    grey = pyrender.MetallicRoughnessMaterial(baseColorFactor=[BACK_LEVEL / 255] * 3 + [1.0])
    by_texture: dict[int, list[Quad]] = {}
    for quad in reversed(scene.quads):
        by_texture.setdefault(id(quad.texture), []).append(quad)
    fronts = [_printed(quads) for quads in by_texture.values()]
    drawn.add(pyrender.Mesh([pyrender.Primitive(positions=backs, mode=4, material=grey), *fronts]))
    return drawn


def _printed(quads: list[Quad]) -> Any:
    order = [0, 2, 1, 0, 3, 2]  # counter-clockwise from the printed side
    corners_uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
    rgba = np.repeat(quads[0].texture.pixels[..., None], 4, axis=2)
    rgba[..., 3] = 255
    sampler = pyrender.Sampler(magFilter=LINEAR, minFilter=MIP_MAPPED, wrapS=CLAMPED, wrapT=CLAMPED)
    texture = pyrender.Texture(source=rgba, source_channels="RGBA", sampler=sampler)
    return pyrender.Primitive(
        positions=np.concatenate([quad.corners_m[order] for quad in quads]).astype(np.float32),
        texcoord_0=np.tile(corners_uv[order], (len(quads), 1)),
        mode=4,
        material=pyrender.MetallicRoughnessMaterial(baseColorTexture=texture, baseColorFactor=[1.0] * 4),
    )
