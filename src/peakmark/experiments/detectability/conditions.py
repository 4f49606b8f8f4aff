"""Images of one marker under one distortion at a time, as in Section 4.1, drawn by our renderer."""

from dataclasses import dataclass, field, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.camera import Camera
from peaksim.camera.frame import Frame
from peaksim.camera.sensor import Sensor, capture_image
from peaksim.geometry.pose import compose, rotation_about
from peaksim.rendering import render
from peaksim.scene.scene import Mark, Quad, Scene
from peaksim.scene.texture import Texture
from peaksim.shipped import ASSETS

from peakmark.errors import InputError
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import SIFT_SIDE_IN_SIGMA, dog_zero_crossing, plain_ground, sift_marker, surf_texture
from peakmark.score.wanted import polarity_of

KINDS = ("surf-dark", "surf-light", "surf-range-dark", "sift-dark", "sift-range-dark")
"""Markers that the experiments know; "sift-range-dark" is the plain disc."""

BACKGROUNDS = ("uniform", "gravel", "brick", "grass")
"""What is behind the marker: its plain ground, or a photograph, then with one white cell around it.

SURF's ground is `plain_ground`, as that of the reference signatures; a DoG's is the grey of its own rim."""

_CELL_TEXELS = 64
"""Of a SURF marker's cell: the largest marker is drawn with twice its pixels."""

_SIFT_TEXELS = 641
"""Of a SIFT marker's side; odd, so that its centre is a texel."""

_PHOTO_SIDES = 12.0
"""Width of the photograph behind a marker, in its sides: it fills the image wherever the marker is in front of it."""

_MID_GRAY = 127.5


@dataclass(frozen=True)
class Condition:
    """What the camera sees and what happens to the image."""

    marker: str = "surf-dark"
    """One of `KINDS`."""
    side_px: float = 147.0
    """Side of the marker without tilt; 12 σ for a SIFT marker, as it is printed."""
    image_px: int = 301
    """Side of the square image."""
    turn_deg: float | None = None
    """In-plane rotation; None draws one at random."""
    tilt_deg: float = 0.0
    """Out-of-plane rotation about a random axis in the image plane."""
    distance_sides: float = 20.0
    """Distance of the camera in marker sides: small is strong perspective."""
    noise: float = 0.0
    """σ of the noise, grey levels."""
    defocus_px: float = 0.0
    """Radius of the disc that a point becomes."""
    motion_px: float = 0.0
    """Length of the line, in a random direction, that a point becomes."""
    jpeg_quality: int = 0
    """1…100; 0 is no compression."""
    contrast: float = 1.0
    """Of the marker and its plain ground, about mid-grey."""
    background: str = "uniform"
    """One of `BACKGROUNDS`."""
    vignetting: float = 0.0
    """Share of light lost in the corners."""
    exposure: float = 1.0
    """Multiplier of the light."""
    off_axis_px: float = 0.0
    """Distance of the marker from the image's centre, in a random direction."""
    position_range_px: float = field(default=1.0, repr=False)  # streams are named by the rest
    """Side of the square, about that position, in which the centre is drawn: 1 px is a pixel's phase, 8 px that of
    octaves which take every 8th pixel."""
    is_centred: bool = False
    """As the paper has it: no sub-pixel phase, no rotation; tilted about the vertical, moved to the right."""

    @property
    def scenery(self) -> "Condition":
        """The condition without what happens to the image: conditions that share it share drawings."""
        plain = {name: getattr(Condition, name) for name in _CAMERA_FIELDS}
        return replace(self, **plain)

    def __post_init__(self) -> None:
        for name, value, choices in (("marker", self.marker, KINDS), ("background", self.background, BACKGROUNDS)):
            if value not in choices:
                raise InputError(f"{name}: expected one of {', '.join(choices)}, got {value!r}")
        if not 0 <= self.tilt_deg < 90:
            raise InputError(f"tilt_deg: expected 0…90, got {self.tilt_deg}")


_CAMERA_FIELDS = ("noise", "defocus_px", "motion_px", "jpeg_quality", "contrast", "vignetting", "exposure")


@dataclass(frozen=True)
class Drawing:
    """What reaches the lens, and where the marker is."""

    linear: NDArray[np.float32]
    """(image_px, image_px) grey levels at full contrast."""
    faded: NDArray[np.float32]
    """The same at no contrast; what lies between is between the two."""
    center_xy: NDArray[np.float64]
    """(2,) projection of the marker's centre, px."""
    blob_xy: NDArray[np.float64]
    """(2,) centroid of the image of its central blob, which perspective moves away from `center_xy`."""
    side_px: float
    """Square root of the marker's area in the image."""
    direction_deg: float
    """Of a motion of the camera."""


@dataclass(frozen=True)
class MarkerImage:
    """One image and where its marker is."""

    image: NDArray[np.uint8]
    """(image_px, image_px)."""
    center_xy: NDArray[np.float64]
    """(2,) projection of the marker's centre, px."""
    blob_xy: NDArray[np.float64]
    """(2,) centroid of the image of its central blob, px."""
    side_px: float
    """Square root of the marker's area in the image."""


def render_image(condition: Condition, rng: np.random.Generator) -> MarkerImage:
    """Return an image under a condition: `draw_marker`, then `expose_drawing`."""
    return expose_drawing(draw_marker(condition, rng), condition, rng)


def draw_marker(condition: Condition, rng: np.random.Generator) -> Drawing:
    """Draw the scenery at a random position, with a random rotation, tilt axis and direction where they are free."""
    tilt_axis, rotation_deg, direction = (90.0, 0.0, 0.0) if condition.is_centred else rng.uniform(0, 360, 3)
    phase_px = np.zeros(2) if condition.is_centred else condition.position_range_px * rng.uniform(-0.5, 0.5, 2)
    photo_offset = rng.uniform(-4, 4, 2)
    rotation_deg = rotation_deg if condition.turn_deg is None else condition.turn_deg
    rotation = rotation_about("z", tilt_axis) @ rotation_about("x", condition.tilt_deg)
    rotation = rotation @ rotation_about("z", rotation_deg - tilt_axis) @ rotation_about("x", 180)
    heading = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    offset_px = phase_px + condition.off_axis_px * heading
    position = np.array([*(offset_px / condition.side_px), condition.distance_sides])
    camera = _camera(condition)

    def drawn(contrast: float) -> Frame:
        return render(
            _scene(condition, compose(rotation, position), photo_offset, contrast), camera, np.eye(4), "exact"
        )

    frame = drawn(1.0)
    return Drawing(
        linear=frame.linear,
        faded=drawn(0.0).linear if condition.background != "uniform" else np.full((1, 1), _MID_GRAY, np.float32),
        center_xy=frame.truth[0].center_xy,
        blob_xy=_blob_xy(condition.marker, rotation, position, camera),
        side_px=frame.truth[0].side_px,
        direction_deg=float(direction),
    )


def expose_drawing(drawing: Drawing, condition: Condition, rng: np.random.Generator) -> MarkerImage:
    """Take an image of a drawing with the condition's contrast, blur, light and noise."""
    linear = drawing.faded + np.float32(condition.contrast) * (drawing.linear - drawing.faded)
    linear = motion_blurred(linear, condition.motion_px, drawing.direction_deg)
    image = capture_image(linear, _sensor(condition), rng)
    return MarkerImage(image, drawing.center_xy, drawing.blob_xy, drawing.side_px)


def _camera(condition: Condition) -> Camera:
    """Return the camera that sees the marker without tilt at `side_px` from `distance_sides`."""
    middle = (condition.image_px - 1) / 2
    focal = condition.side_px * condition.distance_sides
    return Camera(condition.image_px, condition.image_px, focal, focal, middle, middle)


def _scene(
    condition: Condition, pose: NDArray[np.float64], photo_offset: NDArray[np.float64], contrast: float
) -> Scene:
    """Return a marker of side 1 m at `pose`, before its plain ground or one photograph wall."""
    on_photo = condition.background != "uniform"
    texture, side = _marker_texture(condition.marker, contrast, on_photo)
    marker = Quad("marker", texture, (side, side), pose, Mark("marker", condition.marker, 1.0))
    if not on_photo:
        return Scene((marker,), background=_ground(condition.marker, texture))
    behind = pose.copy()
    behind[:3, 3] -= 0.01 * pose[:3, 2] + pose[:3, :2] @ photo_offset
    wall = Quad("wall", _photo(condition.background), (_PHOTO_SIDES, _PHOTO_SIDES), behind)
    return Scene((marker, wall), background=_MID_GRAY)


def _ground(kind: str, texture: Texture) -> float:
    return float(plain_ground(polarity_of(kind)) if kind.startswith("surf") else texture.pixels[0, 0])


@cache
def _marker_texture(kind: str, contrast: float, framed: bool) -> tuple[Texture, float]:
    """Return a marker's texture, inside one white cell where `framed`, and its side in marker sides."""
    pattern = _MID_GRAY + contrast * (marker_pattern(kind) - _MID_GRAY)
    cell = len(pattern) // 9 if framed else 0
    levels = np.pad(pattern, cell, constant_values=255.0)
    return Texture.from_array(np.rint(levels).astype(np.uint8)), len(levels) / len(pattern)


@cache
def marker_pattern(kind: str) -> NDArray[np.float64]:
    """Return a marker finely drawn, without a border, grey levels 0…255."""
    polarity = polarity_of(kind)
    limit: Limit = "range" if "range" in kind else "energy"
    if kind.startswith("surf"):
        return surf_texture(polarity, limit, _CELL_TEXELS, border_cells=0).astype(np.float64)
    sigma = _SIFT_TEXELS / SIFT_SIDE_IN_SIGMA
    return sift_marker(sigma, _SIFT_TEXELS, polarity, limit).astype(np.float64)


@cache
def _photo(name: str) -> Texture:
    return Texture.from_file(ASSETS / "textures" / f"{name}.png")


def _sensor(condition: Condition) -> Sensor:
    return Sensor(
        defocus_px=condition.defocus_px,
        read_noise=condition.noise,
        jpeg_quality=condition.jpeg_quality,
        vignetting=condition.vignetting,
        exposure=condition.exposure,
    )


def _blob_points(kind: str) -> NDArray[np.float64]:
    """Return points that fill the central blob evenly: SURF's inner 5 × 5 cells, a SIFT marker's disc."""
    line = (np.arange(41) - 20) / 41
    square = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    if kind.startswith("surf"):
        return square * 5 / 9
    radius = dog_zero_crossing(1 / SIFT_SIDE_IN_SIGMA)
    disc: NDArray[np.float64] = square[np.linalg.norm(square, axis=1) <= 0.5] * 2 * radius
    return disc


def _blob_xy(
    kind: str, rotation: NDArray[np.float64], position: NDArray[np.float64], camera: Camera
) -> NDArray[np.float64]:
    """Return the centroid of the blob's image; a small patch's image area goes with 1 / depth³."""
    in_camera = _blob_points(kind) @ rotation[:, :2].T + position
    weights = in_camera[:, 2] ** -3.0
    return np.asarray(weights @ camera.project(in_camera) / weights.sum())


def motion_blurred(linear: NDArray[np.float32], length_px: float, direction_deg: float) -> NDArray[np.float32]:
    """Return the image averaged along a line, as a steady motion of the camera during exposure does."""
    if length_px <= 0:
        return linear
    reach = int(np.ceil(length_px / 2)) + 1
    along = (np.arange(256) + 0.5) / 256 - 0.5
    x = reach + length_px * along * np.cos(np.radians(direction_deg))
    y = reach + length_px * along * np.sin(np.radians(direction_deg))
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1))
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    for dx in (0, 1):
        for dy in (0, 1):
            np.add.at(kernel, (top + dy, left + dx), (1 - np.abs(x - left - dx)) * (1 - np.abs(y - top - dy)))
    blurred = cv2.filter2D(linear, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float32)
