"""The OpenGL renderer: pyrender on EGL or OSMesa, supersampled in the direction that each surface is compressed in.

The only module that imports pyrender. One renderer lives as long as the process; a scene's textures stay in it until
another scene is drawn.
"""

import atexit
import ctypes
import os
from collections.abc import Iterator
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.camera import Camera
from peaksim.errors import RendererError
from peaksim.faces import BACK_LEVEL, channels_of, mesh_levels
from peaksim.pose import Pose
from peaksim.scene import Quad, Scene

MINOR = 4
"""Samples a pixel along the axis in which a surface is least compressed; the other axis gets more."""
MOST = 24
"""Most samples a pixel along one axis."""
TILE = (512, 48)
"""Width and height, px, of the tiles that share one choice of samples."""
LOD_BIAS = -1.5
"""Mip levels by which textures are taken sharper than OpenGL would."""
NEAR_M, FAR_M = 0.02, 200.0
_FRAMES_OF_OSMESA = 20  # its contexts leak about 8 MB a frame, so that a new one is made from time to time


def is_available() -> bool:
    """Return whether an OpenGL context opens here."""
    try:
        gl_renderer()
    except RendererError:
        return False
    return True


def gl_renderer() -> str:
    """Return OpenGL's renderer string.

    Raises
    ------
    RendererError
        If no context opens.
    """
    return _context()[1]


def integrate(scene: Scene, camera: Camera, world_from_camera: Pose) -> NDArray[np.float32]:
    """Return the (h, w, channels) linear grey levels of a scene without lights, from a pinhole camera.

    Raises
    ------
    RendererError
        If OpenGL fails.
    """
    channels = channels_of(scene)
    out = np.empty((camera.height, camera.width, channels), dtype=np.float32)
    try:
        drawn = _drawn(scene)
        for x, y, width, height, across, down in tiles(scene, camera, world_from_camera):
            fine = _draw(drawn, camera, world_from_camera, (x, y, width, height), (across, down), channels)
            out[y : y + height, x : x + width] = box_means(fine, across, down)
    except (AssertionError, RuntimeError, ctypes.ArgumentError, OSError) as error:
        raise RendererError(f"OpenGL failed while drawing: {type(error).__name__} {error}") from error
    return out


# --- how many samples where ---------------------------------------------------------------------------------


def tiles(scene: Scene, camera: Camera, pose: Pose) -> Iterator[tuple[int, int, int, int, int, int]]:
    """Yield (x, y, width, height, samples across, samples down) of tiles that cover the picture."""
    for y in range(0, camera.height, TILE[1]):
        for x in range(0, camera.width, TILE[0]):
            width, height = min(TILE[0], camera.width - x), min(TILE[1], camera.height - y)
            yield x, y, width, height, *samples(scene, camera, pose, (x, y, width, height))


def samples(scene: Scene, camera: Camera, pose: Pose, tile: tuple[int, int, int, int]) -> tuple[int, int]:
    """Return how many samples a pixel across and down keep every texture in a tile evenly sampled."""
    x, y, width, height = tile
    xs, ys = np.meshgrid(np.linspace(x, x + width - 1, 5), np.linspace(y, y + height - 1, 5))
    rays = camera.unproject(np.stack([xs.ravel(), ys.ravel()], axis=1)) @ pose[:3, :3].T
    across = down = 1.0
    for quad in scene.quads:
        if quad.texture.pixels.size > 3:
            ratios = compression(quad, camera, pose, rays)
            across, down = max(across, ratios[0]), max(down, ratios[1])
    return min(MOST, int(np.ceil(MINOR * across))), min(MOST, int(np.ceil(MINOR * down)))


def compression(quad: Quad, camera: Camera, pose: Pose, rays: NDArray[np.float64]) -> tuple[float, float]:
    """Return how many times more samples along x and along y a quad's pixels need to be seen evenly in texels.

    Where a pixel's footprint is r times as long as it is wide, it needs r times more samples in the direction in the
    picture that it is long in; a direction that slants between the axes needs more along both.
    """
    normal = quad.world_from_quad[:3, 2]
    depth = float((quad.world_from_quad[:3, 3] - pose[:3, 3]) @ normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = depth / (rays @ normal)
        local = (pose[:3, 3] + reach[:, None] * rays - quad.world_from_quad[:3, 3]) @ quad.world_from_quad[:3, :2]
        hit = (reach > 0) & (np.abs(local) <= np.array(quad.size_m) / 2).all(axis=1)
    if not hit.any():
        return 1.0, 1.0
    rays, reach = rays[hit], reach[hit]
    columns = []
    for axis, focal in ((0, camera.fx), (1, camera.fy)):
        step = pose[:3, axis] / focal
        # the plane point moves by reach·(a − n·a/n·ray·ray) when the ray turns by a pixel along axis a
        moved = reach[:, None] * (step - ((step @ normal) / (rays @ normal))[:, None] * rays)
        columns.append((moved @ quad.world_from_quad[:3, :2]) / np.array(quad.size_m) * quad.texture.size)
    footprint = np.stack(columns, axis=2)
    squares, directions = np.linalg.eigh(np.swapaxes(footprint, 1, 2) @ footprint)
    ratio = np.sqrt(squares[:, 1] / np.maximum(squares[:, 0], 1e-12 * squares[:, 1]))
    more = 1 + (ratio - 1)[:, None] * np.abs(directions[:, :, 1])
    return float(more[:, 0].max()), float(more[:, 1].max())


def box_means(fine: NDArray[np.uint8], across: int, down: int) -> NDArray[np.float32]:
    """Return the means of down × across blocks of an (h·down, w·across, c) picture."""
    height, width, channels = fine.shape[0] // down, fine.shape[1] // across, fine.shape[2]
    rows = fine.reshape(height, down, width * across, channels).sum(axis=1, dtype=np.uint16)
    blocks = rows.reshape(height, width, across, channels).sum(axis=2, dtype=np.uint32)
    return np.asarray(blocks / np.float32(across * down), dtype=np.float32)


# --- OpenGL ---------------------------------------------------------------------------------------------------


@cache
def _context() -> tuple[Any, str]:
    """Open the process's one renderer; EGL first, OSMesa second."""
    try:
        ctypes.CDLL("libGL.so.1")  # pyglet, which pyrender imports, loads it
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl" if _loads("libEGL.so.1") else "osmesa")
        import pyrender
        from OpenGL.GL import GL_RENDERER, glGetString

        _multisample_off()
        _sharpen()
        if os.environ["PYOPENGL_PLATFORM"] == "osmesa":
            _use_framebuffers()
        renderer = pyrender.OffscreenRenderer(TILE[0] * MINOR, TILE[1] * MINOR)
        name = glGetString(GL_RENDERER).decode()
        atexit.register(renderer.delete)  # before PyOpenGL's modules are gone
    except Exception as error:  # every driver fails in its own way
        raise RendererError(f"no OpenGL context opens: {type(error).__name__} {error}") from error
    renderer._renderer._read_main_framebuffer = _read_colours
    return renderer, name


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _use_framebuffers() -> None:
    """Let pyrender draw into framebuffers on OSMesa too, which then equals EGL bit for bit."""
    from pyrender.platforms.osmesa import OSMesaPlatform

    OSMesaPlatform.supports_framebuffers = lambda self: True


def _multisample_off() -> None:
    """Let pyrender draw with one sample a fragment: supersampling sees textures too, at half the cost."""
    from pyrender import renderer

    storage = renderer.glRenderbufferStorageMultisample
    renderer.glRenderbufferStorageMultisample = lambda target, _, *size: storage(target, 0, *size)


def _sharpen() -> None:
    """Let textures be filtered less than OpenGL does: samples are many, and their mean filters again."""
    from OpenGL import GL
    from pyrender.texture import Texture

    add = Texture._add_to_context

    def add_sharper(texture: Any) -> None:
        add(texture)
        GL.glBindTexture(GL.GL_TEXTURE_2D, texture._texid)
        GL.glTexParameterf(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_LOD_BIAS, LOD_BIAS)
        GL.glBindTexture(GL.GL_TEXTURE_2D, 0)

    Texture._add_to_context = add_sharper


def _read_colours(scene: Any, flags: int) -> tuple[NDArray[np.uint8], None]:
    """Read the picture alone, grey as one channel: depth and unused channels cost as much as drawing."""
    from OpenGL import GL

    renderer = _context()[0]._renderer
    width, height = renderer._main_fb_dims
    GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, renderer._main_fb_ms)
    GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, renderer._main_fb)
    GL.glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL.GL_COLOR_BUFFER_BIT, GL.GL_LINEAR)
    GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, renderer._main_fb)
    GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
    channels = scene.channels
    kind = GL.GL_RED if channels == 1 else GL.GL_RGB
    levels = np.empty((height, width, channels), np.uint8)
    GL.glReadPixels(0, 0, width, height, kind, GL.GL_UNSIGNED_BYTE, levels)
    return levels[::-1], None


def _draw(
    drawn: Any, camera: Camera, pose: Pose, tile: tuple[int, int, int, int], per_pixel: tuple[int, int], channels: int
) -> NDArray[np.uint8]:
    """Return one tile with `per_pixel` samples across and down."""
    import pyrender

    x, y, width, height = tile
    across, down = per_pixel
    renderer = _context()[0]
    renderer.viewport_width, renderer.viewport_height = width * across, height * down
    lens = pyrender.IntrinsicsCamera(
        camera.fx * across,
        camera.fy * down,
        (camera.cx + 0.5 - x) * across,  # OpenGL's origin is the pixel's corner
        (camera.cy + 0.5 - y) * down,
        znear=NEAR_M,
        zfar=FAR_M,
    )
    node = drawn.add(lens, pose=pose @ np.diag([1.0, -1.0, -1.0, 1.0]))
    try:
        drawn.channels = channels
        levels, _ = renderer.render(drawn, flags=pyrender.RenderFlags.FLAT)
    finally:
        drawn.remove_node(node)
    return np.asarray(levels)


@lru_cache(maxsize=1)
def _drawn(scene: Scene) -> Any:
    """Return the scene for pyrender, as one mesh of many parts, so that the order of drawing never varies."""
    import pyrender

    level = scene.background / 255
    drawn = pyrender.Scene(bg_color=[level, level, level, 1.0])
    channels = channels_of(scene)
    # of touching faces OpenGL keeps the one drawn first, the scene means the later one
    parts = [_solid(mesh.triangles_m.reshape(-1, 3), mesh_levels(mesh, channels)) for mesh in reversed(scene.meshes)]
    if scene.quads:
        backs = np.concatenate([quad.corners_m[[0, 1, 2, 0, 2, 3]] for quad in scene.quads])
        parts.append(_solid(backs, np.array([BACK_LEVEL]), one_sided=True))
    by_texture: dict[int, list[Quad]] = {}
    for quad in reversed(scene.quads):
        by_texture.setdefault(id(quad.texture), []).append(quad)
    parts += [_printed(quads) for quads in by_texture.values()]
    if parts:
        drawn.add(pyrender.Mesh(parts))
    return drawn


def _solid(corners: NDArray[np.float64], levels: NDArray[np.float64], one_sided: bool = False) -> Any:
    """Return triangles of one colour, seen from both sides or only clockwise."""
    import pyrender

    colour = [*(np.broadcast_to(levels, 3) / 255).tolist(), 1.0]
    material = pyrender.MetallicRoughnessMaterial(baseColorFactor=colour, doubleSided=not one_sided)
    return pyrender.Primitive(positions=corners.astype(np.float32), mode=4, material=material)


def _printed(quads: list[Quad]) -> Any:
    """Return the printed faces of quads that share a texture, with its row 0 at v = 1."""
    import pyrender

    order = [0, 2, 1, 0, 3, 2]  # counter-clockwise from the printed side
    corners_uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
    pixels = quads[0].texture.pixels
    rgb = pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)
    rgba = np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])
    sampler = pyrender.Sampler(magFilter=9729, minFilter=9987, wrapS=33071, wrapT=33071)  # linear, mip-mapped, clamped
    material = pyrender.MetallicRoughnessMaterial(
        baseColorTexture=pyrender.Texture(source=rgba, source_channels="RGBA", sampler=sampler),
        baseColorFactor=[1.0, 1.0, 1.0, 1.0],
    )
    return pyrender.Primitive(
        positions=np.concatenate([quad.corners_m[order] for quad in quads]).astype(np.float32),
        texcoord_0=np.tile(corners_uv[order], (len(quads), 1)),
        mode=4,
        material=material,
    )
