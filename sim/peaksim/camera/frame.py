"""What a renderer returns: the image, the camera and its pose, and the truth about it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peaksim.camera.camera import Camera
from peaksim.camera.shutter import PosedCamera
from peaksim.geometry.pose import Pose
from peaksim.image_file import to_8_bits

TEXTURE_ERROR_RMS = {"exact": 0.5, "gl": 0.5}
"""Error budget of each renderer: rms against the area integral, grey levels; see `benchmarks/fidelity_render.py`."""


def error_budget(renderer: str) -> str:
    """Return the line of a report that states the error that a renderer's textures may have."""
    if renderer == "pyrender":
        return "Textures are OpenGL's, with mip levels: several grey levels rms on slanted ones, see the README"
    if renderer == "traced":
        return "Pixels carry the noise of path tracing, which falls with the square root of the samples"
    return f"Texture error budget: {TEXTURE_ERROR_RMS[renderer]} grey levels rms"


@dataclass(frozen=True)
class Ellipse:
    """An ellipse in the image."""

    center_xy: NDArray[np.float64]
    """(2,) px; under perspective this is not the image of the circle's centre."""
    semi_axes_px: tuple[float, float]
    """Longer and shorter half axis."""
    angle_deg: float
    """Direction of the longer axis, from x towards y, 0…180."""


def _unknown(*shape: int) -> NDArray[np.float64]:
    return np.full(shape, np.nan)


@dataclass(frozen=True)
class MarkerTruth:
    """Where one marker is in the image, from the projection that the renderer uses."""

    name: str
    """Name of the mark."""
    kind: str
    """Its printed pattern, such as "surf-dark"."""
    center_xy: NDArray[np.float64]
    """(2,) projection of the marker's centre, px; nan behind the camera."""
    corners_xy: NDArray[np.float64]
    """(4, 2) projections of the pattern's corners without border, top-left first and clockwise, px."""
    side_px: float
    """Square root of the area of the projected pattern, px; of its part inside the image where the pattern reaches
    behind the camera or beyond what the lens shows; nan where nothing of it is shown."""
    distance_m: float
    """Distance of the marker's centre from the camera centre, metres."""
    tilt_deg: float
    """Angle between the marker's normal and the ray to the camera, degrees: 0 is head-on, > 90 from behind."""
    visible_fraction: float
    """Share of the pattern's image area that is inside the image and not occluded, 0…1; 0 from behind. Of its printed
    area where it reaches behind the camera (but for a fisheye), for its image has no bounds then. Where the camera
    moves: at mid-exposure, as all fields above."""
    affinity: NDArray[np.float64] = field(default_factory=lambda: _unknown(2, 2))
    """(2, 2) px per side at the centre; columns are the pattern's x (right) and y (down) axes."""
    ellipse: Ellipse = field(default_factory=lambda: Ellipse(_unknown(2), (np.nan, np.nan), np.nan))
    """Picture of the circle inscribed in the pattern; nan where part of it is behind the camera."""
    blur_mean_xy: NDArray[np.float64] = field(default_factory=lambda: _unknown(2))
    """(2,) mean of `center_xy` over the exposure, px: the centroid of the blurred marker."""
    outline_xy: NDArray[np.float64] = field(default_factory=lambda: _unknown(4, 2))
    """(n, 2) px around the pattern, from its top left corner clockwise: `corners_xy`, or on bent paper 64 points."""
    blur_covariance_px2: NDArray[np.float64] = field(default_factory=lambda: _unknown(2, 2))
    """(2, 2) covariance of `center_xy` over the exposure, px²; 0 where the camera stands still."""


@dataclass(frozen=True)
class Frame:
    """One image and its truth."""

    image: NDArray[Any]
    """(H, W) grey or (H, W, 3) RGB; uint8, or uint16 after a sensor of more than 8 bits."""
    linear: NDArray[np.float32]
    """(H, W) or (H, W, 3) linear grey levels before rounding, the sensor's input; 255 is white."""
    camera: Camera
    """Intrinsics, lens and shutter."""
    world_from_camera: Pose
    """(4, 4) pose of the camera (at mid-exposure of the middle row, if it moves)."""
    time_s: float
    """Time on the trajectory; 0 for a single image."""
    truth: tuple[MarkerTruth, ...]
    """One record a marker of the scene, in the scene's order, in view or not."""
    renderer: str
    """"exact", "gl", "pyrender" or "traced": which renderer drew it."""
    gl_renderer: str | None
    """OpenGL's renderer string, None without GL."""
    surfaces: "Callable[[], Surfaces]"
    """Computes depth, ids and normals on first use."""
    posed_camera: PosedCamera
    """The one projection of image and truth: `posed_camera.project(points_m)` maps world points to px."""
    preview: "Callable[[float], NDArray[np.float32]]"
    """Draws the linear levels of a small sharp image at a time on the trajectory, by which a camera meters light."""

    def _repr_png_(self) -> bytes:
        """Return the image as the PNG that notebooks show."""
        buffer = BytesIO()
        Image.fromarray(to_8_bits(self.image)).save(buffer, "PNG")
        return buffer.getvalue()

    def show(self) -> None:
        """Open the image in the system's viewer; a notebook shows a frame that ends a cell by itself."""
        Image.fromarray(to_8_bits(self.image)).show()

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

    @property
    def mesh_ids(self) -> NDArray[np.int32]:
        """(H, W) index into `scene.meshes` at pixel centres; −1 where no mesh is seen."""
        return self._surfaces.mesh_ids

    @property
    def normals(self) -> NDArray[np.float32]:
        """(H, W, 3) unit normals towards the camera at pixel centres, camera frame; 0 where nothing is."""
        return self._surfaces.normals


@dataclass(frozen=True)
class Surfaces:
    """What is seen at each pixel's centre."""

    depth_m: NDArray[np.float32]
    """(H, W) z in the camera frame (of the row's pose), metres; inf where nothing is."""
    quad_ids: NDArray[np.int32]
    """(H, W) index into `scene.quads`, −1 elsewhere."""
    mesh_ids: NDArray[np.int32]
    """(H, W) index into `scene.meshes`, −1 elsewhere."""
    normals: NDArray[np.float32]
    """(H, W, 3) unit normal towards the camera, camera frame; 0 where nothing is."""
