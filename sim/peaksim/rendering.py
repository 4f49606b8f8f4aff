"""render: one call, two renderers; pictures and truth come from the same camera and pose."""

import sys
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim.camera import Camera
from peaksim.errors import SceneError
from peaksim.frame import Frame
from peaksim.pose import Pose, rigid
from peaksim.scene import Scene
from peaksim.sensor import quantise
from peaksim.truth import marker_truth, surfaces

Renderer = Literal["auto", "exact", "gl"]


def render(
    scene: Scene,
    camera: Camera,
    world_from_camera: ArrayLike,
    renderer: Renderer = "auto",
    time_s: float = 0.0,
) -> Frame:
    """Return the picture of a scene and its truth.

    Parameters
    ----------
    scene, camera
        What is seen, and by what.
    world_from_camera
        (4, 4) pose.
    renderer
        "exact" draws without GL, "gl" with pyrender, "auto" with GL where a context opens.
    time_s
        Kept in the frame.

    Raises
    ------
    SceneError
        If the pose is not rigid, or the renderer is unknown.
    """
    pose = rigid(world_from_camera, "world_from_camera")
    if renderer not in ("auto", "exact", "gl"):
        raise SceneError(f'renderer: expected "auto", "exact" or "gl", got {renderer!r}')
    chosen = choose(scene, camera, renderer)
    linear, gl_renderer = draw(scene, camera, pose, chosen)
    linear = linear[:, :, 0] if linear.shape[2] == 1 else linear
    return Frame(
        image=quantise(linear),
        linear=linear,
        camera=camera,
        world_from_camera=np.array(pose),
        time_s=time_s,
        truth=marker_truth(scene, camera, pose),
        renderer=chosen,
        gl_renderer=gl_renderer,
        surfaces=lambda: surfaces(scene, camera, pose),
    )


def choose(scene: Scene, camera: Camera, renderer: Renderer) -> Literal["exact", "gl"]:
    """Return the renderer to use; "auto" takes GL where a context opens and can draw this.

    Raises
    ------
    SceneError
        If "gl" is asked for a scene with lights or a camera with a distorting lens, which only "exact" draws.
    """
    if renderer == "exact":
        return "exact"
    beyond_gl = "lights" if scene.lights else "" if camera.is_pinhole else "lens distortion"
    if renderer == "gl":
        if beyond_gl:
            raise SceneError(f'renderer: expected "exact" or "auto" for {beyond_gl}, got "gl"')
        return "gl"
    from peaksim import render_gl

    if beyond_gl:
        return "exact"
    if render_gl.is_available():
        return "gl"
    _say_once("no OpenGL context opens here: going on with the exact renderer, which needs none")
    return "exact"


@cache
def _say_once(message: str) -> None:
    print(f"peaksim: {message}", file=sys.stderr)


def draw(
    scene: Scene, camera: Camera, pose: Pose, renderer: Literal["exact", "gl"]
) -> tuple[NDArray[np.float32], str | None]:
    """Return (h, w, channels) linear grey levels, and OpenGL's renderer string where it drew them."""
    if renderer == "exact":
        from peaksim.area_integral import integrate

        return integrate(scene, camera, pose[None]), None
    from peaksim import render_gl

    return render_gl.integrate(scene, camera, pose), render_gl.gl_renderer()
