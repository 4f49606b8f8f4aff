"""render: one call, two renderers; pictures and truth come from the same camera and pose."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from peaksim.camera import Camera
from peaksim.errors import SceneError
from peaksim.frame import Frame
from peaksim.pose import rigid
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
    from peaksim.render_exact import integrate

    pose = rigid(world_from_camera, "world_from_camera")
    if renderer not in ("auto", "exact", "gl"):
        raise SceneError(f'renderer: expected "auto", "exact" or "gl", got {renderer!r}')
    linear = integrate(scene, camera, pose[None])
    linear = linear[:, :, 0] if linear.shape[2] == 1 else linear
    return Frame(
        image=quantise(linear),
        linear=linear,
        camera=camera,
        world_from_camera=np.array(pose),
        time_s=time_s,
        truth=marker_truth(scene, camera, pose),
        renderer="exact",
        gl_renderer=None,
        surfaces=lambda: surfaces(scene, camera, pose),
    )
