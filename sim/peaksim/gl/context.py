"""OpenGL by pyrender on EGL or OSMesa: one long-lived renderer, which draws the numbers of faces, or their textures.

No other module imports pyrender.
"""

import atexit
import ctypes
import os
import sys
from collections.abc import Callable
from functools import cache, lru_cache
from importlib import import_module
from itertools import count
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.area.faces import panels_m, triangles_m
from peaksim.area.shown import NUMBER_BITS
from peaksim.errors import RendererError, SceneError
from peaksim.extras import how_to_install, needs_extra
from peaksim.geometry.pose import Pose
from peaksim.gl.tiles import Window
from peaksim.scene.scene import Scene

_LINES, _TRIANGLES = 1, 4
_DRAWINGS_OF_OSMESA = 20
"""Contexts of OSMesa leak 2 to 8 MB a drawing, so a new one is opened after this many."""
_drawings = count(1)
_FAILURES = (AssertionError, RuntimeError, ctypes.ArgumentError, OSError)


def is_available() -> bool:
    """Return whether an OpenGL context opens here."""
    return why_not() is None


def why_not() -> str | None:
    """Return why no OpenGL context opens here, in one line; None where one does."""
    try:
        gl_renderer()
    except RendererError as error:
        return " ".join(str(error).split())
    return None


def gl_renderer() -> str:
    """Return OpenGL's renderer string.

    Raises
    ------
    RendererError
        If no context opens.
    """
    return open_context()[1]


def draw_numbers(
    scene: Scene, world_from_camera: Pose, window: Window, depths_m: tuple[float, float]
) -> NDArray[np.uint32]:
    """Return what a window shows: in the low 24 bits the number of the nearest face + 1, 0 for none.

    What is not between the two `depths_m` along the window's axis is not drawn. Faces are numbered as in `Faces`;
    of two that are equally far the one drawn first is shown, always the same.

    Raises
    ------
    RendererError
        If OpenGL fails.
    SceneError
        If there are too many faces to number.
    """
    levels = _draw(lambda: _drawn(scene), world_from_camera, window, depths_m)
    return np.ascontiguousarray(levels).view("<u4")[:, :, 0]


def draw_textured(
    drawn: Any, world_from_camera: Pose, window: Window, depths_m: tuple[float, float]
) -> NDArray[np.uint8]:
    """Return the (r, c, 4) colours that a window shows of a scene of pyrender's.

    Raises
    ------
    RendererError
        If OpenGL fails.
    """
    return _draw(lambda: drawn, world_from_camera, window, depths_m, is_mirrored=False)


def _draw(
    drawn: Callable[[], Any],
    world_from_camera: Pose,
    window: Window,
    depths_m: tuple[float, float],
    is_mirrored: bool = True,
) -> NDArray[np.uint8]:
    """Return the (r, c, 4) colours that a window shows, drawn upside down where that saves a copy.

    Upside down, faces that are seen from one side only are seen from the wrong one.
    """
    pyrender = load_pyrender()
    try:
        renderer, scene = open_context()[0], drawn()
        renderer.viewport_width, renderer.viewport_height = window.columns, window.rows
        (fx, _, cx), (_, fy, cy), _ = window.samples_from_window
        # OpenGL begins with the lowest row
        vertical = (-fy, window.rows - cy) if is_mirrored else (fy, cy)
        lens = pyrender.IntrinsicsCamera(fx, vertical[0], cx, vertical[1], znear=depths_m[0], zfar=depths_m[1])
        pose = world_from_camera.copy()
        pose[:3, :3] = world_from_camera[:3, :3] @ window.camera_from_window @ np.diag([1.0, -1.0, -1.0])
        node = scene.add(lens, pose=pose)
        try:
            levels, _ = renderer.render(scene, flags=pyrender.RenderFlags.FLAT)
        finally:
            scene.remove_node(node)
        if os.environ["PYOPENGL_PLATFORM"] == "osmesa" and next(_drawings) % _DRAWINGS_OF_OSMESA == 0:
            _close_context()
    except _FAILURES as error:
        raise RendererError(f"OpenGL failed while drawing: {type(error).__name__} {error}") from error
    return np.asarray(levels if is_mirrored else levels[::-1])


@lru_cache(maxsize=1)
def _drawn(scene: Scene) -> Any:
    """Return the scene for pyrender: one mesh with numbers for colours, so that the order of drawing never varies."""
    pyrender = load_pyrender()
    squares = panels_m(scene.quads)
    triangles = triangles_m(scene.meshes)
    total = len(squares) + len(triangles)
    if total >= NUMBER_BITS:
        raise SceneError(f'scene: expected fewer than {NUMBER_BITS} faces for "gl", got {total}')
    drawn = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0])
    quad_numbers, triangle_numbers = np.arange(1, len(squares) + 1), np.arange(len(squares) + 1, total + 1)
    # outlines show quads that are thinner than a sample
    parts = (
        (squares[:, [0, 1, 2, 0, 2, 3]], quad_numbers, _TRIANGLES),
        (squares[:, [0, 1, 1, 2, 2, 3, 3, 0]], quad_numbers, _LINES),
        (triangles, triangle_numbers, _TRIANGLES),
    )
    primitives = [_numbered(*part) for part in parts if len(part[0])]
    if primitives:
        drawn.add(pyrender.Mesh(primitives))
    return drawn


def _numbered(corners: NDArray[np.float64], numbers: NDArray[np.int64], mode: int) -> Any:
    """Return (n, k, 3) corners as lines or triangles, each in the colour of its number, seen from both sides."""
    pyrender = load_pyrender()
    colours = np.ones((*corners.shape[:2], 4), np.float32)
    colours[:, :, :3] = (numbers[:, None, None] >> np.array([0, 8, 16]) & 255) / 255
    material = pyrender.MetallicRoughnessMaterial(baseColorFactor=[1.0] * 4, doubleSided=True)
    positions = corners.reshape(-1, 3).astype(np.float32)
    return pyrender.Primitive(positions=positions, color_0=colours.reshape(-1, 4), mode=mode, material=material)


@cache
def open_context() -> tuple[Any, str]:
    """Return the one pyrender renderer, opened on first use (EGL, else OSMesa), and OpenGL's renderer string."""
    try:
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl" if _loads("libEGL.so.1") else "osmesa")
        pyrender = load_pyrender()
        from OpenGL.GL import GL_RENDERER, glGetString

        _multisample_off()
        if os.environ["PYOPENGL_PLATFORM"] == "osmesa":
            _use_framebuffers()
        renderer = pyrender.OffscreenRenderer(64, 64)
        name = glGetString(GL_RENDERER).decode()
        atexit.register(renderer.delete)  # before PyOpenGL's modules are gone
    except Exception as error:  # every driver fails differently
        missing = how_to_install(error) if isinstance(error, ModuleNotFoundError) else None
        reason = missing or f"{type(error).__name__} {error}"
        raise RendererError(f"no OpenGL context opens: {reason}") from error
    renderer._renderer._read_main_framebuffer = _read_colours
    return renderer, name


@cache
@needs_extra
def load_pyrender() -> Any:
    """Import pyrender without its viewer, whose window toolkit needs X libraries that machines without a screen lack.

    Who asks for `pyrender.Viewer` afterwards gets it all the same, where those libraries are.
    """
    if "pyrender" in sys.modules:
        return sys.modules["pyrender"]
    stand_in: Any = ModuleType("pyrender.viewer")
    stand_in.Viewer = None
    sys.modules[stand_in.__name__] = stand_in
    try:
        import pyrender
    finally:
        del sys.modules[stand_in.__name__]
    del pyrender.Viewer
    pyrender.__getattr__ = _viewer
    return pyrender


def _viewer(name: str) -> Any:
    """Answer what pyrender's module lacks (PEP 562)."""
    if name == "Viewer":
        return import_module("pyrender.viewer").Viewer
    raise AttributeError(f"module 'pyrender' has no attribute {name!r}")


def _close_context() -> None:
    """Close the renderer; the next drawing opens a new one."""
    renderer = open_context()[0]
    atexit.unregister(renderer.delete)
    renderer.delete()
    open_context.cache_clear()


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
    """Let pyrender draw with one sample a fragment: numbers must not be mixed."""
    from pyrender import renderer

    storage = renderer.glRenderbufferStorageMultisample
    renderer.glRenderbufferStorageMultisample = lambda target, _, *size: storage(target, 0, *size)


def _read_colours(scene: Any, flags: int) -> tuple[NDArray[np.uint8], None]:
    """Read the colours alone, as they lie in memory: pyrender itself also reads depth, and converts."""
    from OpenGL import GL

    renderer = open_context()[0]._renderer
    width, height = renderer._main_fb_dims
    GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, renderer._main_fb_ms)
    GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 4)
    levels = np.empty((height, width, 4), np.uint8)
    GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, levels)
    return levels, None
