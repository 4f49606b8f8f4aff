"""What a renderer returns: the picture, where it was taken from, and what is true of it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from peaksim.camera import Camera
from peaksim.pose import Pose


@dataclass(frozen=True)
class MarkerTruth:
    """Where one marker truly is in the image, from the projection that the renderer uses."""

    name: str
    """Name of the mark."""
    kind: str
    """Its printed pattern, such as "surf-dark"."""
    center_xy: NDArray[np.float64]
    """(2,) projection of the marker's centre, px; nan behind the camera."""
    corners_xy: NDArray[np.float64]
    """(4, 2) projections of the pattern's corners without border, top-left first and clockwise, px."""
    side_px: float
    """Square root of the area of the projected pattern, px."""
    distance_m: float
    """Distance of the marker's centre from the camera centre, metres."""
    tilt_deg: float
    """Angle between the marker's normal and the ray to the camera, degrees: 0 is seen squarely, > 90 from behind."""
    visible_fraction: float
    """Share of the pattern's image area that is inside the image and not occluded, 0…1; 0 from behind."""


@dataclass(frozen=True)
class Frame:
    """One picture and its truth."""

    image: NDArray[np.uint8]
    """(H, W) grey or (H, W, 3) RGB."""
    linear: NDArray[np.float32]
    """(H, W) or (H, W, 3) linear grey levels before rounding, the sensor's input; 255 is white."""
    camera: Camera
    """The camera that took it."""
    world_from_camera: Pose
    """(4, 4) pose of the camera (at mid-exposure of the middle row, where it moves)."""
    time_s: float
    """Time on the trajectory; 0 for a single picture."""
    truth: tuple[MarkerTruth, ...]
    """One record a marker of the scene, in the scene's order, whether in view or not."""
    renderer: str
    """"exact" or "gl": which renderer drew it."""
    gl_renderer: str | None
    """OpenGL's renderer string, None without GL."""
    surfaces: "Callable[[], Surfaces]"
    """Computes depth and ids on first use."""

    @cached_property
    def _surfaces(self) -> "Surfaces":
        return self.surfaces()

    @property
    def depth_m(self) -> NDArray[np.float32]:
        """(H, W) z in the camera frame at pixel centres, metres, analytic; inf where nothing is."""
        return self._surfaces.depth_m

    @property
    def quad_ids(self) -> NDArray[np.int32]:
        """(H, W) index into `scene.quads` at pixel centres; −1 where no quad is seen."""
        return self._surfaces.quad_ids


@dataclass(frozen=True)
class Surfaces:
    """What is seen at each pixel's centre."""

    depth_m: NDArray[np.float32]
    """(H, W) z in the camera frame, metres; inf where nothing is."""
    quad_ids: NDArray[np.int32]
    """(H, W) index into `scene.quads`, −1 elsewhere."""
    mesh_ids: NDArray[np.int32]
    """(H, W) index into `scene.meshes`, −1 elsewhere."""
    normals: NDArray[np.float32]
    """(H, W, 3) unit normal towards the camera, camera frame; 0 where nothing is."""
