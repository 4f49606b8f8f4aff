"""render: one call, three renderers; pictures and truth come from the same shot."""

import sys
from collections.abc import Sequence
from functools import cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim import traced
from peaksim.area.integrate import integrate
from peaksim.camera.camera import Camera
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import quantise
from peaksim.camera.shutter import Shot, still
from peaksim.errors import SceneError
from peaksim.geometry.pose import rigid
from peaksim.geometry.trajectory import Trajectory
from peaksim.gl import integrate as render_gl
from peaksim.scene.needs import left_out
from peaksim.scene.scene import Scene
from peaksim.truth.markers import marker_truth
from peaksim.truth.surfaces import surfaces, surfaces_at

Renderer = Literal["auto", "exact", "gl", "traced"]
DrawnBy = Literal["exact", "gl", "traced"]

MOST_MOMENTS = 256
"""Most pictures that a motion blur is made of."""
_MOMENTS_PER_PX = 1.5


def render(
    scene: Scene,
    camera: Camera,
    world_from_camera: ArrayLike | Trajectory,
    renderer: Renderer = "auto",
    time_s: float = 0.0,
    samples: int = traced.SAMPLES,
    seed: int | Sequence[int] = 0,
    max_depth: int = traced.MAX_DEPTH,
) -> Frame:
    """Return the picture of a scene and its truth.

    Parameters
    ----------
    scene, camera
        What is seen, and by what.
    world_from_camera
        (4, 4) pose; or a trajectory, along which the camera moves while its rows are exposed one after another
        (`row_time_s`) and each over some time (`exposure_s`).
    renderer
        "exact" needs no GL; "gl" finds what is visible with pyrender; "auto" takes GL where a context opens and
        can draw this; "traced" follows light over area lamps, sky, gloss and lens with Mitsuba 3, and is noisy.
    time_s
        Mid-exposure of the middle row on the trajectory; kept in the frame.
    samples, seed, max_depth
        Of "traced": paths a pixel, the seed of their noise (a number or several), and the longest path in steps.

    Raises
    ------
    SceneError
        If the pose is not rigid, the time is not finite, or the renderer is unknown, missing or cannot draw this.
    RendererError
        If OpenGL fails.
    """
    shot = _shot(camera, world_from_camera, time_s)
    if renderer not in get_args(Renderer):
        raise SceneError(f'renderer: expected "auto", "exact", "gl" or "traced", got {renderer!r}')
    chosen = choose(shot, renderer)
    if chosen == "traced":
        linear, gl_renderer = traced.integrate(scene, shot, samples, seed, max_depth), None
    else:
        linear, gl_renderer = draw(scene, shot, chosen)
    linear = linear[:, :, 0] if linear.shape[2] == 1 else linear
    return Frame(
        image=quantise(linear),
        linear=linear,
        camera=camera,
        world_from_camera=shot.pose,
        time_s=time_s,
        truth=marker_truth(scene, shot),
        renderer=chosen,
        gl_renderer=gl_renderer,
        surfaces=lambda: surfaces(scene, shot),
        shot=shot,
    )


def _shot(camera: Camera, world_from_camera: ArrayLike | Trajectory, time_s: float) -> Shot:
    if not np.isfinite(time_s):
        raise SceneError(f"time_s: expected a finite time, got {time_s}")
    if isinstance(world_from_camera, Trajectory):
        return Shot(camera, world_from_camera, time_s)
    return still(camera, rigid(world_from_camera, "world_from_camera"))


def choose(shot: Shot, renderer: Renderer) -> DrawnBy:
    """Return the renderer to use; "auto" takes GL where a context opens and can draw this.

    Raises
    ------
    SceneError
        If "gl" is asked for what only "exact" draws: a rolling shutter.
    """
    if renderer in ("exact", "traced"):
        return renderer
    if renderer == "gl":
        if shot.is_rolling:
            raise SceneError('renderer: expected "exact" or "auto" for a rolling shutter, got "gl"')
        return "gl"
    if shot.is_rolling:
        return "exact"

    if render_gl.is_available():
        return "gl"
    _say_once("no OpenGL context opens here: going on with the exact renderer, which needs none")
    return "exact"


@cache
def _say_once(message: str) -> None:
    print(f"peaksim: {message}", file=sys.stderr)


def draw(scene: Scene, shot: Shot, renderer: Literal["exact", "gl"]) -> tuple[NDArray[np.float32], str | None]:
    """Return (h, w, channels) linear grey levels, and OpenGL's renderer string where it drew them."""
    if names := left_out(scene, shot.camera):
        _say_once(f'the {renderer} renderer leaves out {", ".join(names)}; renderer "traced" draws them')
    moments = shot.moments(count_moments(scene, shot)) if shot.is_blurred else (shot,)
    pictures = (_draw_sharp(scene, moment, renderer) for moment in moments)
    linear = next(pictures) / np.float32(len(moments)) if len(moments) > 1 else next(pictures)
    for picture in pictures:
        linear += picture / np.float32(len(moments))
    if renderer == "exact":
        return linear, None

    return linear, render_gl.gl_renderer()


def _draw_sharp(scene: Scene, shot: Shot, renderer: Literal["exact", "gl"]) -> NDArray[np.float32]:
    if renderer == "exact":
        return integrate(scene, shot.camera, shot.row_poses(np.arange(shot.camera.height)))

    return render_gl.integrate(scene, shot.camera, shot.pose)


def count_moments(scene: Scene, shot: Shot) -> int:
    """Return how many pictures a motion blur is made of: three for every two pixels that what is seen moves."""
    camera = shot.camera
    x, y = np.meshgrid(np.linspace(0, camera.width - 1, 9), np.linspace(0, camera.height - 1, 7))
    xy = np.stack([x, y], axis=2)
    poses, rays, world_rays = shot.rays(xy)
    depth = surfaces_at(scene, shot, xy).depth_m.ravel().astype(np.float64)
    reach = np.where(np.isfinite(depth), depth, 1e3) / np.maximum(rays[:, 2], 1e-3)
    points = poses[:, :3, 3] + reach[:, None] * world_rays
    way = np.stack([moment.project(points) for moment in shot.moments(4)])
    steps = np.linalg.norm(np.diff(way, axis=0), axis=2)
    motion_px = 4 * np.nanmax(steps, initial=0) if np.isfinite(steps).any() else 0.0
    return int(np.clip(np.ceil(_MOMENTS_PER_PX * motion_px), 2, MOST_MOMENTS))
