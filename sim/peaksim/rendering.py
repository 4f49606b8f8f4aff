"""render: one call, four renderers; image and truth come from the same posed camera."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from time import perf_counter
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from peaksim import traced
from peaksim.area.faces import count_faces
from peaksim.area.integrate import integrate
from peaksim.area.light_map import LightMaps
from peaksim.camera.camera import Camera, resized
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import quantise
from peaksim.camera.shutter import PosedCamera, still_camera
from peaksim.errors import SceneError
from peaksim.geometry.trajectory import Trajectory
from peaksim.gl import integrate as render_gl
from peaksim.gl import textured
from peaksim.gl.context import why_not
from peaksim.notices import notice_once
from peaksim.scene.detail import suited_to
from peaksim.scene.needs import is_bakeable, left_out
from peaksim.scene.scene import Scene
from peaksim.truth.markers import marker_truth
from peaksim.truth.surfaces import surfaces, surfaces_at

Renderer = Literal["auto", "exact", "gl", "pyrender", "traced"]
DrawnBy = Literal["exact", "gl", "pyrender", "traced"]

MOST_FACES_EXACT = 1000
"""Most faces that "auto" leaves to "exact"; set by hand, from `benchmarks/renderer_choice.py`."""
MOST_MOMENTS = 256
"""Most sharp images that a motion blur is averaged from."""
_PREVIEW_PX, _PREVIEW_SAMPLES = 32, 16
"""Width of the images by which exposure is metered, and paths a pixel of the traced ones."""
_MOMENTS_PER_PX = 1.5
"""Sharp images for each pixel that the scene moves: steps of ⅔ px, below what a pixel resolves."""


def render(
    scene: Scene,
    camera: Camera,
    world_from_camera: ArrayLike | Trajectory,
    renderer: Renderer = "auto",
    time_s: float = 0.0,
    samples: int = traced.SAMPLES,
    seed: int | Sequence[int] = 0,
    max_depth: int = traced.MAX_DEPTH,
    bake: bool = True,
) -> Frame:
    """Return the image of a scene and its truth.

    Parameters
    ----------
    scene, camera
        What there is to see, and the camera that sees it.
    world_from_camera
        (4, 4) pose; or a trajectory, along which the camera moves while its rows are exposed one after another
        (`row_time_s`) and each over some time (`exposure_s`).
    renderer
        "exact" needs no GL; "gl" finds what is visible with pyrender; "auto" takes the quicker one, see
        `choose_renderer`; "pyrender" leaves textures to OpenGL too, unlit; "traced" follows light over area lamps,
        sky, gloss and lens with Mitsuba 3, and is noisy.
    time_s
        Mid-exposure of the middle row on the trajectory; kept in the frame.
    samples
        Of "traced" and "pyrender": paths, or samples, a pixel ("pyrender" draws n × n of them, at least so many).
    seed, max_depth
        Of "traced": the seed of its noise (a number or several), and the longest path in steps.
    bake
        Whether "exact" and "gl" show the light of lamps and sky, path-traced once a scene and kept on disk; where it
        cannot be, or is not wanted, that light is left out.

    Raises
    ------
    SceneError
        If the pose is not rigid, the time is not finite, or the renderer is unknown, missing or cannot draw this.
    RendererError
        If OpenGL fails.
    """
    posed = _posed_camera(camera, world_from_camera, time_s)
    if renderer not in get_args(Renderer):
        raise SceneError(f'renderer: expected "auto", "exact", "gl", "pyrender" or "traced", got {renderer!r}')
    chosen = choose_renderer(scene, posed, renderer)
    linear, gl_renderer = _draw_by(chosen, scene, posed, samples, seed, max_depth, bake)
    linear = linear[:, :, 0] if linear.shape[2] == 1 else linear
    return Frame(
        image=quantise(linear),
        linear=linear,
        camera=camera,
        world_from_camera=posed.pose,
        time_s=time_s,
        truth=marker_truth(scene, posed),
        renderer=chosen,
        gl_renderer=gl_renderer,
        surfaces=lambda: surfaces(scene, posed),
        posed_camera=posed,
        preview=partial(_preview, scene, posed, chosen, max_depth, bake),
    )


def _draw_by(
    renderer: DrawnBy,
    scene: Scene,
    posed: PosedCamera,
    samples: int,
    seed: int | Sequence[int],
    max_depth: int,
    bake: bool,
) -> tuple[NDArray[np.float32], str | None]:
    """Return (h, w, channels) linear grey levels, and OpenGL's renderer string where it drew them."""
    if renderer == "traced":
        return traced.integrate(scene, posed, samples, seed, max_depth), None
    return draw_levels(scene, posed, renderer, bake, samples)


def _preview(
    scene: Scene, posed: PosedCamera, renderer: DrawnBy, max_depth: int, bake: bool, time_s: float
) -> NDArray[np.float32]:
    """Return the (h, w, channels) linear levels of a small sharp image at a time on the trajectory."""
    camera = resized(posed.camera, _PREVIEW_PX / posed.camera.width)
    small = still_camera(replace(camera, exposure_s=0.0, row_time_s=0.0), posed.trajectory.at(time_s))
    return _draw_by(renderer, scene, small, _PREVIEW_SAMPLES, 0, max_depth, bake)[0]


def _posed_camera(camera: Camera, world_from_camera: ArrayLike | Trajectory, time_s: float) -> PosedCamera:
    if not np.isfinite(time_s):
        raise SceneError(f"time_s: expected a finite time, got {time_s}")
    if isinstance(world_from_camera, Trajectory):
        return PosedCamera(camera, world_from_camera, time_s)
    return still_camera(camera, world_from_camera)


def choose_renderer(scene: Scene, posed: PosedCamera, renderer: Renderer) -> DrawnBy:
    """Return the renderer to use.

    "auto" is "exact" for scenes of up to `MOST_FACES_EXACT` faces, else "gl" where OpenGL opens and can draw this.

    Raises
    ------
    SceneError
        If "gl" or "pyrender" is requested for a rolling shutter, which only "exact" and "traced" draw.
    """
    if renderer in ("exact", "traced"):
        return renderer
    if renderer in ("gl", "pyrender"):
        if posed.is_rolling:
            raise SceneError(f'renderer: expected "exact" or "auto" for a rolling shutter, got "{renderer}"')
        return renderer
    if posed.is_rolling or count_faces(scene) <= MOST_FACES_EXACT:
        return "exact"
    return opengl_or_exact()


def opengl_or_exact() -> Literal["gl", "exact"]:
    """Return "gl" where OpenGL opens, else "exact", with a notice that says why."""
    reason = why_not()
    if reason is None:
        return "gl"
    notice_once(f"{reason}; drawing with the exact renderer, which needs no OpenGL")
    return "exact"


def draw_levels(
    scene: Scene,
    posed: PosedCamera,
    renderer: Literal["exact", "gl", "pyrender"],
    bake: bool = True,
    samples: int = traced.SAMPLES,
) -> tuple[NDArray[np.float32], str | None]:
    """Return (h, w, channels) linear grey levels, and OpenGL's renderer string where it drew them."""
    needs, why = left_out(scene, posed.camera, is_unlit=renderer == "pyrender"), ""
    maps = None
    if renderer == "pyrender":
        traced.check(samples, 0)
        if samples > textured.MOST_SAMPLES:
            raise SceneError(f'samples: expected at most {textured.MOST_SAMPLES} for "pyrender", got {samples}')
    elif bake and is_bakeable(scene):
        reason = traced.fault()
        if reason is None:
            needs = left_out(scene, posed.camera, is_baked=True)
            traced.check_lights(scene, posed.pose[:3, 3])
            scene, maps = _baked(scene)
        else:
            why = f", which {reason}"
    if needs:
        notice_once(f'the {renderer} renderer leaves out {", ".join(needs)}; renderer "traced" draws them{why}')
    moments = posed.moments(count_moments(scene, posed)) if posed.is_blurred else (posed,)
    if maps is None:
        scene = suited_to(scene, posed)
    images = (_draw_sharp(scene, moment, renderer, maps, samples) for moment in moments)
    linear = next(images) / np.float32(len(moments)) if len(moments) > 1 else next(images)
    for image in images:
        linear += image / np.float32(len(moments))
    if renderer == "exact":
        return linear, None

    return linear, render_gl.gl_renderer()


@lru_cache(maxsize=2)
def _baked(scene: Scene) -> tuple[Scene, LightMaps]:
    """Return a scene as it is drawn in baked light, and that light; the frames of a film share both."""
    start = perf_counter()
    maps, was_there = traced.cached_light(scene)
    if not was_there:
        size = f"{len(maps.texels)} texels of {100 * maps.texel_m:.2g} cm in {perf_counter() - start:.0f} s"
        errors = f"noise {maps.noise:.2g}, detail {maps.detail:.2g} grey levels on white"
        notice_once(f"baked the light of the scene: {size}; {errors}")
    return traced.lit_scene(scene), maps


def _draw_sharp(
    scene: Scene, posed: PosedCamera, renderer: Literal["exact", "gl", "pyrender"], maps: LightMaps | None, samples: int
) -> NDArray[np.float32]:
    if renderer == "exact":
        return integrate(scene, posed.camera, posed.row_poses(np.arange(posed.camera.height)), maps)

    if renderer == "pyrender":
        return textured.draw(scene, posed.camera, posed.pose, samples)
    return render_gl.integrate(scene, posed.camera, posed.pose, maps)


def count_moments(scene: Scene, posed: PosedCamera) -> int:
    """Return how many sharp images a motion blur is averaged from: three for every two pixels that the scene moves."""
    camera = posed.camera
    x, y = np.meshgrid(np.linspace(0, camera.width - 1, 9), np.linspace(0, camera.height - 1, 7))
    xy = np.stack([x, y], axis=2)
    poses, rays, world_rays = posed.rays(xy)
    depth = surfaces_at(scene, posed, xy).depth_m.ravel().astype(np.float64)
    reach = np.where(np.isfinite(depth), depth, 1e3) / np.maximum(rays[:, 2], 1e-3)
    points = poses[:, :3, 3] + reach[:, None] * world_rays
    paths_xy = np.stack([moment.project(points) for moment in posed.moments(4)])
    steps = np.linalg.norm(np.diff(paths_xy, axis=0), axis=2)
    motion_px = 4 * np.nanmax(steps, initial=0) if np.isfinite(steps).any() else 0.0
    return int(np.clip(np.ceil(_MOMENTS_PER_PX * motion_px), 2, MOST_MOMENTS))
